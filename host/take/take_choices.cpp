// SPDX-License-Identifier: MIT
// Choices into what a take is made of.
#include "take/take_choices.hpp"

#include <fmt/format.h>

#include "develop/basis_record.hpp"

namespace ols {

Result<Calibration> open_calibration(const TakeChoices& choices, const StageConfig& stage) {
    const std::string folder = choices.calibration.empty() ? stage.calibration_dir : choices.calibration;
    if (choices.nominal) return nominal_calibration(stage);
    if (folder.empty())
        return fail(
            "no calibration: run `stagectl calibrate` and give --calibration DIR (or calibration in the "
            "stage), or give --nominal to take black level and gain as the stage states them");
    return read_calibration(folder, stage);
}

namespace {

TakeInfo take_info(const TakeChoices& choices, const Sequence& sequence, const StageConfig& stage,
                   const TakeTargets& targets) {
    TakeInfo info = choices.slate;
    info.frame_rate_hz = targets.every > 0 ? tracking_rate_hz(sequence) / targets.every
                                           : double(tick_hz) / double(sequence.cycle_ticks());
    info.basis = sequence.basis.name;
    info.value_unit = "reflectance";
    info.lights = image_lights(sequence.basis, stage.lamps);
    info.extra["basis"] = basis_record(sequence.basis);
    info.sample_type = choices.single_float ? SampleType::single_float : SampleType::half_float;
    return info;
}

}  // namespace

TakeMasks masks_of(const TakeChoices& choices) {
    TakeMasks masks;
    masks.fill_from_neighbours = choices.fill == "neighbours";
    masks.estimate = *estimate_named(choices.estimate);  // one of estimate_names(), as the option was checked
    return masks;
}

// A performance where --fps is given, one target a cycle else.
Result<TakeTargets> targets_of(const TakeChoices& choices, const Sequence& sequence) {
    TakeTargets targets;
    if (choices.fps == 0) {
        if (!choices.quality.empty())
            return fail("--quality is of a performance: give its targets a second, too, as --fps 24");
        return targets;
    }
    if (choices.fill == "neighbours")
        return fail(
            "--fill neighbours is for subjects that hold still; with --fps, lost slots come from the next cycle "
            "anyway");
    const auto every = tracking_frames_a_target(sequence, choices.fps);
    if (!every.ok()) return every.error();
    auto quality = motion_quality(choices.quality.empty() ? "standard" : choices.quality);
    if (!quality.ok()) return quality.error();
    if (target_numbers(sequence, *every).empty())
        return fail(fmt::format(
            "{} {} of the basis hold no target: half a cycle is needed before and after one; give --cycles {}",
            sequence.config.cycles, sequence.config.cycles == 1 ? "cycle" : "cycles", sequence.config.cycles + 1));
    targets.every = *every;
    targets.quality = std::move(*quality);
    return targets;
}

// Rates are whole ticks: 24 may be 24.0002, and where the cameras' rate was set for film on video, 23.976. Wenger's flow holds for
// 1/24 s; longer cycles take frames from farther away.
std::vector<std::string> notes_on_targets(const TakeChoices& choices, const Sequence& sequence,
                                          const TakeTargets& targets) {
    std::vector<std::string> notes;
    if (targets.every == 0) return notes;
    notes.push_back(fmt::format(
        "--fps {} is {:.7g} targets a second here, and so the archive says: {:.7g} tracking frames a second, {} to a "
        "target",
        choices.fps, target_rate_hz(sequence, targets.every), tracking_rate_hz(sequence), targets.every));
    const double reach_s = 0.5 * double(sequence.cycle_ticks()) / double(tick_hz);
    if (reach_s > 1.01 / 24)
        notes.push_back(
            fmt::format("a cycle lasts {:.1f} ms: frames up to {:.1f} ms from a target are aligned, more than 1/24 s; "
                        "fast motion may fail",
                        2e3 * reach_s, 1e3 * reach_s));
    return notes;
}

// The archive of -o, and those of --also, all made beside.
Result<std::vector<PlannedArchive>> plan_archives(const TakeChoices& choices, const Sequence& sequence,
                                                  const StageConfig& stage, const TakeTargets& targets) {
    std::vector<PlannedArchive> planned;
    const auto add = [&](const std::string& path, const TakeTargets& chosen) -> Status {
        auto archive =
            ArchiveWriter::create_beside(path, take_info(choices, sequence, stage, chosen), choices.overwrite);
        if (!archive.ok()) return archive.error();
        planned.push_back({path, chosen, std::move(*archive)});
        return Done{};
    };
    if (const Status added = add(choices.output, targets); !added.ok()) return added.error();
    for (const std::string& also : choices.also) {
        const size_t equals = also.find('=');
        if (targets.every == 0 || equals == std::string::npos || equals + 1 == also.size())
            return fail("--also " + also + ": give --fps, and QUALITY=ARCHIVE, as none=uncompensated.rfa");
        auto quality = motion_quality(also.substr(0, equals));
        if (!quality.ok()) return quality.error();
        if (const Status added = add(also.substr(equals + 1), {targets.every, std::move(*quality)}); !added.ok())
            return added.error();
    }
    return planned;
}

}  // namespace ols

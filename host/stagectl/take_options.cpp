// SPDX-License-Identifier: MIT
// Options into what a take is made of.
#include "stagectl/take_options.hpp"

#include <fmt/format.h>

#include "develop/basis_record.hpp"
#include "stagectl/session.hpp"

namespace ols {

Result<Calibration> open_calibration(const TakeOptions& options, const StageConfig& stage) {
    const std::string folder = options.calibration.empty() ? stage.calibration_dir : options.calibration;
    if (options.nominal) return nominal_calibration(stage);
    if (folder.empty())
        return fail(
            "no calibration: run `stagectl calibrate` and give --calibration DIR (or calibration in the "
            "stage), or give --nominal to take black level and gain as the stage states them");
    return read_calibration(folder, stage);
}

namespace {

TakeInfo take_info(const TakeOptions& options, const Sequence& sequence, const StageConfig& stage,
                   const TakeTargets& targets) {
    TakeInfo info = options.slate;
    info.frame_rate_hz = targets.every > 0 ? tracking_rate_hz(sequence) / targets.every
                                           : double(tick_hz) / double(sequence.cycle_ticks());
    info.basis = sequence.basis.name;
    info.value_unit = "reflectance";
    info.lights = image_lights(sequence.basis, stage.lamps);
    info.extra["basis"] = basis_record(sequence.basis);
    info.sample_type = options.single_float ? SampleType::single_float : SampleType::half_float;
    return info;
}

void add_to_account(LineFile& account, const Frame& frame) {
    account.add(fmt::format(R"({{"camera":{},"frame_id":{},"timestamp_ns":{},"cycle":{},"slot":{},"tick":{}}})",
                            frame.camera, frame.stamp.frame_id, frame.stamp.timestamp_ns, frame.cycle, frame.slot,
                            frame.tick));
}

// Rates are whole ticks: 24 may be 24.0002, and where the cameras' rate was set for film on video, 23.976.
void say_exact_rate(const TakeOptions& options, const Sequence& sequence, const TakeTargets& targets) {
    if (targets.every > 0)
        fmt::print(stderr,
                   "stagectl: --fps {} is {:.7g} targets a second here, and so the archive says: {:.7g} tracking "
                   "frames a second, {} to a target\n",
                   options.fps, target_rate_hz(sequence, targets.every), tracking_rate_hz(sequence), targets.every);
}

// Wenger's flow holds for 1/24 s; longer cycles take frames from farther away.
void warn_of_long_cycles(const Sequence& sequence, const TakeTargets& targets) {
    const double reach_s = 0.5 * double(sequence.cycle_ticks()) / double(tick_hz);
    if (targets.every > 0 && reach_s > 1.01 / 24)
        fmt::print(stderr,
                   "stagectl: a cycle lasts {:.1f} ms: frames up to {:.1f} ms from a target are aligned, more than "
                   "1/24 s; fast "
                   "motion may fail\n",
                   2e3 * reach_s, 1e3 * reach_s);
}

}  // namespace

TakeMasks masks_of(const TakeOptions& options) {
    TakeMasks masks;
    masks.fill_from_neighbours = options.fill == "neighbours";
    masks.estimate = *estimate_named(options.estimate);  // one of estimate_names(), as the option was checked
    return masks;
}

// A performance where --fps is given, one target a cycle else.
Result<TakeTargets> targets_of(const TakeOptions& options, const Sequence& sequence) {
    TakeTargets targets;
    if (options.fps == 0) {
        if (!options.quality.empty())
            return fail("--quality is of a performance: give its targets a second, too, as --fps 24");
        return targets;
    }
    if (options.fill == "neighbours")
        return fail(
            "--fill neighbours is for subjects that hold still; with --fps, lost slots come from the next cycle "
            "anyway");
    const auto every = tracking_frames_a_target(sequence, options.fps);
    if (!every.ok()) return every.error();
    auto quality = motion_quality(options.quality.empty() ? "standard" : options.quality);
    if (!quality.ok()) return quality.error();
    if (target_numbers(sequence, *every).empty())
        return fail(fmt::format(
            "{} {} of the basis hold no target: half a cycle is needed before and after one; give --cycles {}",
            sequence.config.cycles, sequence.config.cycles == 1 ? "cycle" : "cycles", sequence.config.cycles + 1));
    targets.every = *every;
    targets.quality = std::move(*quality);
    return targets;
}

void say_targets(const TakeOptions& options, const Sequence& sequence, const TakeTargets& targets) {
    say_exact_rate(options, sequence, targets);
    warn_of_long_cycles(sequence, targets);
}

// The archive of -o, and those of --also, all made beside.
Result<std::vector<PlannedArchive>> plan_archives(const TakeOptions& options, const Sequence& sequence,
                                                  const StageConfig& stage, const TakeTargets& targets) {
    std::vector<PlannedArchive> planned;
    const auto add = [&](const std::string& path, const TakeTargets& chosen) -> Status {
        auto archive =
            ArchiveWriter::create_beside(path, take_info(options, sequence, stage, chosen), options.overwrite);
        if (!archive.ok()) return archive.error();
        planned.push_back({path, chosen, std::move(*archive)});
        return Done{};
    };
    if (const Status added = add(options.output, targets); !added.ok()) return added.error();
    for (const std::string& also : options.also) {
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

TakeSinks sinks_of(std::vector<PlannedArchive>& planned, const TakeOptions& options, std::optional<LineFile>& account,
                   const char* progress_label) {
    TakeSinks sinks{
        {},
        [&](const Frame& frame) {
            if (!account) account.emplace(options.frames);
            add_to_account(*account, frame);
        },
        [progress_label](uint64_t decided, uint64_t total) { show_progress(progress_label, decided, total); }};
    for (PlannedArchive& one : planned) sinks.outputs.push_back({one.archive, one.targets});
    return sinks;
}

void TakeOptions::add_to(CLI::App& verb) {
    verb.add_option("--calibration", calibration, "folder of `stagectl calibrate`");
    verb.add_flag("--nominal", nominal, "no calibration: black level and gain as the stage states them");
    verb.add_option("-o,--output", output, "archive to make (take.rfa)")->required();
    verb.add_option(
            "--fps", fps,
            "a performance: targets a second, at tracking frames (of the paper's 120 a second: 24, 30, 60, 120 ...), "
            "each "
            "of the frames nearest to it, brought to its time. Otherwise one target a cycle, for subjects that "
            "hold still")
        ->check(CLI::PositiveNumber);
    verb.add_option(
            "--quality", quality,
            "motion compensation of a performance: none, preview, standard (if not said otherwise) or final; what "
            "each costs and errs: docs/accuracy.md")
        ->check(CLI::IsMember(motion_quality_names()));
    verb.add_option("--also", also,
                    "the same performance in another quality, too, in an archive of its own: QUALITY=ARCHIVE; may be "
                    "given several times, and shows what accuracy costs");
    verb.add_option("--frames", frames, "file for a JSON line a frame: its id and time, its cycle and slot");
    verb.add_option("--fill", fill,
                    "lost slots of the basis: none, or neighbours: the same slot of the cycles before and after; a "
                    "subject that moves smears")
        ->check(CLI::IsMember({"none", "neighbours"}));
    verb.add_option(
            "--estimate", estimate,
            "pixels whose lost and saturated samples the others do not determine: none: 0 and masked; smooth: "
            "neighbouring lamps give similar values; nonnegative: and no lamp less than nothing, no saturated "
            "sample less than white; some milliseconds a pixel; clipped: saturated samples count as they were read, "
            "so that a glint is about as bright as the camera's white. Estimates are masked; those of a prior have a "
            "bound of their bias")
        ->check(CLI::IsMember(estimate_names()));
    verb.add_option(
            "--witness-step", witness_step,
            "every so manieth pixel in x and in y is looked at for slots that do not fit the others and lamps that "
            "give less light; 0: none (docs/identity.md has what each step finds and costs)")
        ->check(CLI::Range(0, 1000));
    verb.add_flag("--overwrite", overwrite, "replace an archive of that name");
    verb.add_flag("--float", single_float, "store 32-bit floats; otherwise half floats");
    verb.add_option("--production", slate.production, "slate: production");
    verb.add_option("--scene", slate.scene, "slate: scene");
    verb.add_option("--take", slate.take, "slate: take");
    verb.add_option("--notes", slate.notes, "slate: notes");
    verb.add_option("--timecode", slate.timecode_start, "timecode of the first target, HH:MM:SS:FF");
    verb.add_flag("--json", json, "print the report as JSON");
}

}  // namespace ols

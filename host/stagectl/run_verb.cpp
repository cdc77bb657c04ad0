// SPDX-License-Identifier: MIT
// stagectl run: plays a sequence and records the take.
#include <fmt/format.h>

#include <optional>

#include "develop/basis_record.hpp"
#include "image/line_file.hpp"
#include "image/outputs.hpp"
#include "program.hpp"
#include "record/camera_record.hpp"
#include "stagectl/flicker_warning.hpp"
#include "stagectl/sequence_options.hpp"
#include "stagectl/session.hpp"
#include "stagectl/verbs.hpp"
#include "take/take.hpp"

namespace ols {

namespace {

struct Options {
    LinkOptions links;
    SequenceOptions sequence;
    std::string output, calibration, frames;
    TakeInfo slate;
    int cycles = 0, witness_step = TakeDescription{}.witness_step;
    std::string fill = "none", estimate = "none", quality;
    std::vector<std::string> also;  // QUALITY=ARCHIVE
    double fps = 0;
    bool nominal = false, overwrite = false, single_float = false, json = false;
};

Result<Calibration> open_calibration(const Options& options, const StageConfig& stage) {
    const std::string folder = options.calibration.empty() ? stage.calibration_dir : options.calibration;
    if (options.nominal) return nominal_calibration(stage);
    if (folder.empty())
        return fail(
            "no calibration: run `stagectl calibrate` and give --calibration DIR (or calibration in the "
            "stage), or give --nominal to take black level and gain as the stage states them");
    return read_calibration(folder, stage);
}

// An archive that the take is to make.
struct Planned {
    std::string path;
    TakeTargets targets;
    ArchiveWriter archive;
};

TakeInfo take_info(const Options& options, const Sequence& sequence, const StageConfig& stage,
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

nlohmann::json to_json(const OutputReport& report, const std::string& archive) {
    return {{"archive", archive},
            {"targets_written", report.targets_written},
            {"targets_missing", report.targets_missing},
            {"write_error", report.write_error},
            {"saturated_share", report.saturated_share},
            {"estimated_share", report.estimated_share},
            {"unsolved_share", report.unsolved_share},
            {"misaligned_share", report.misaligned_share},
            {"suspect_targets", report.suspicion.suspect_targets},
            {"suspicions", report.suspicion.targets},
            {"suspect_lamps", report.suspicion.lamps},
            {"seconds",
             {{"develop", report.seconds_develop},
              {"flow", report.seconds_motion.flow},
              {"planes", report.seconds_motion.planes},
              {"invert", report.seconds_motion.invert},
              {"matte", report.seconds_motion.matte},
              {"write", report.seconds_write}}}};
}

// The first archive's account with the recording's; those of --also in "also".
nlohmann::json to_json(const TakeReport& report, const std::vector<Planned>& planned) {
    const RecordReport& record = report.record;
    nlohmann::json json = to_json(report.outputs[0], planned[0].path);
    json.update({{"slots_total", record.slots_total},
                 {"slots_missing", record.slots_missing},
                 {"frames", record.frames},
                 {"frames_discarded", record.frames_discarded},
                 {"camera", camera_record(record.camera, record.camera_counts)},
                 {"duplicates", record.duplicates},
                 {"stale_buffers", record.stale_buffers},
                 {"frames_without_noise", record.frames_without_noise},
                 {"camera_restarts", record.camera_restarts},
                 {"clock_drift_ppm", record.clock_drift_ppm},
                 {"board_end", record.board_end},
                 {"camera_end", record.camera_end}});
    json["seconds"]["total"] = report.seconds_total;
    for (size_t n = 1; n < planned.size(); ++n) json["also"].push_back(to_json(report.outputs[n], planned[n].path));
    return json;
}

// What the first suspect target and each suspect lamp are suspected of.
void print_suspicion(const SuspicionReport& suspicion, const std::string& folder) {
    if (suspicion.suspect_targets > 0) {
        const nlohmann::json& first = suspicion.targets[0];
        fmt::print(
            stderr,
            "stagectl: {} targets have a slot that does not fit the others (suspect_targets in {}/manifest.json); "
            "target {}: {}{}\n",
            suspicion.suspect_targets, folder, first["target"].get<int>(), first["says"][0].get<std::string>(),
            first.contains("taken_as_missing") ? ", and was taken as missing" : "");
    }
    for (const auto& [name, lamp] : suspicion.lamps.items())
        fmt::print(stderr,
                   "stagectl: {} gave {:.2f} +- {:.2f} of the light that {}, from target {} on: look at the lamp\n",
                   name, lamp["factor"].get<double>(), lamp["spread"].get<double>(),
                   lamp["since_first_target"].get<bool>() ? "it gave in the first target" : "its neighbours foretell",
                   lamp["first_target"].get<int>());
}

void print_output(const OutputReport& report, const std::string& folder, const Options& options) {
    if (!options.json)
        fmt::print("{}: {} targets written, {} missing\n", folder, report.targets_written, report.targets_missing);
    if (report.unsolved_share > 0)
        fmt::print(
            stderr,
            "stagectl: {:.2g} % of the pixels have too few samples left, and are 0 and masked: {}--estimate smooth or "
            "nonnegative estimate lost ones{}\n",
            report.unsolved_share * 100,
            options.estimate == "clipped" ? "" : "--estimate clipped counts saturated ones as they were read, ",
            options.estimate == "clipped" ? "" : " too");
    print_suspicion(report.suspicion, folder);
    if (report.misaligned_share > 0)
        fmt::print(stderr,
                   "stagectl: motion compensation failed in up to {:.2g} % of a target's pixels, which are masked\n",
                   report.misaligned_share * 100);
    if (!report.write_error.empty()) fmt::print(stderr, "stagectl: {}\n", report.write_error);
    if (report.targets_missing > 0) fmt::print(stderr, "stagectl: why targets are missing: rf verify {}\n", folder);
}

void print_report(const TakeReport& report, bool is_estimate, const std::vector<Planned>& planned,
                  const Options& options) {
    const RecordReport& record = report.record;
    for (size_t n = 0; n < planned.size(); ++n) print_output(report.outputs[n], planned[n].archive.folder(), options);
    if (!options.json)
        fmt::print("{} of {} slots missing; {:.1f} s\n", record.slots_missing, record.slots_total,
                   report.seconds_total);
    if (!record.camera_end.empty()) fmt::print(stderr, "stagectl: {}\n", record.camera_end);
    if (!record.board_end.empty()) fmt::print(stderr, "stagectl: {}\n", record.board_end);
    if (record.stale_buffers > 0)
        fmt::print(stderr,
                   "stagectl: {} frames had the samples of an earlier one, bit for bit; their slots are missing: the "
                   "camera's driver or grabber hands out old buffers\n",
                   record.stale_buffers);
    if (!record.unfit_frame.empty())
        fmt::print(stderr, "stagectl: frames came as {}, which is not what the stage says of its camera\n",
                   record.unfit_frame);
    if (report.outputs[0].saturated_share > 0)
        fmt::print(stderr,
                   "stagectl: {:.2g} % of the pixels have saturated samples, which are left out where others make up "
                   "for them: shorten the exposure\n",
                   report.outputs[0].saturated_share * 100);
    if (is_estimate)
        fmt::print(stderr,
                   "stagectl: the basis has fewer independent rows than lamps: what was written is an estimate\n");
    if (record.slots_missing > 0)
        fmt::print(stderr, "stagectl: why slots are missing stands in {}/manifest.json, identification.missing\n",
                   planned[0].archive.folder());
}

// The account of identified frames, a JSON line each. It is opened with the first of them, so that a start that fails leaves an
// older one as it is.
Status check_account(const Options& options) {
    return check_outputs(
        {.inputs = {options.sequence.path, options.sequence.basis, options.links.stage_path, options.calibration},
         .streams = {options.frames}});
}

void add_to_account(LineFile& account, const Frame& frame) {
    account.add(fmt::format(R"({{"camera":{},"frame_id":{},"timestamp_ns":{},"cycle":{},"slot":{},"tick":{}}})",
                            frame.camera, frame.stamp.frame_id, frame.stamp.timestamp_ns, frame.cycle, frame.slot,
                            frame.tick));
}

TakeMasks masks_of(const Options& options) {
    TakeMasks masks;
    masks.fill_from_neighbours = options.fill == "neighbours";
    masks.estimate = *estimate_named(options.estimate);  // one of estimate_names(), as the option was checked
    return masks;
}

// A performance where --fps is given, one target a cycle else.
Result<TakeTargets> targets_of(const Options& options, const Sequence& sequence) {
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

// Rates are whole ticks: 24 may be 24.0002, and where the cameras' rate was set for film on video, 23.976.
void say_exact_rate(const Options& options, const Sequence& sequence, const TakeTargets& targets) {
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

// The archive of -o, and those of --also, all made beside.
Result<std::vector<Planned>> plan_outputs(const Options& options, const Sequence& sequence, const StageConfig& stage,
                                          const TakeTargets& targets) {
    std::vector<Planned> planned;
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

Result<int> run(const Options& options) {
    auto config = open_sequence(options.sequence);
    if (!config.ok()) return config.error();
    if (options.cycles > 0) config->cycles = options.cycles;
    const auto stage = open_stage(options.links);
    if (!stage.ok()) return stage.error();
    const auto sequence = compile_sequence(*config, *stage);
    if (!sequence.ok()) return sequence.error();
    if (!sequence->is_capture() || sequence->config.playback.start == StartSource::photo)
        return fail(
            options.sequence.path +
            ": a take is recorded from a capture basis, whose triggers come at an even pace; play listed slots, "
            "harmonics and start = \"photo\" with `stagectl play`");
    const auto calibration = open_calibration(options, *stage);
    if (!calibration.ok()) return calibration.error();
    const auto targets = targets_of(options, *sequence);
    if (!targets.ok()) return targets.error();
    say_exact_rate(options, *sequence, *targets);
    warn_of_long_cycles(*sequence, *targets);
    warn_of_flicker(*sequence);
    if (const Status writable = check_account(options); !writable.ok()) return writable.error();
    auto planned = plan_outputs(options, *sequence, *stage, *targets);
    if (!planned.ok()) return planned.error();
    auto session = open_session(options.links);
    if (!session.ok()) return session.error();

    const TakeDescription take{*sequence, *stage, *calibration, masks_of(options), options.witness_step};
    std::optional<LineFile> account;
    TakeSinks sinks{{},
                    [&](const Frame& frame) {
                        if (!account) account.emplace(options.frames);
                        add_to_account(*account, frame);
                    },
                    [](uint64_t decided, uint64_t total) { show_progress("recording", decided, total); }};
    for (Planned& one : *planned) sinks.outputs.push_back({one.archive, one.targets});
    const auto report = run_take(take, {*session->board, {session->camera.get()}}, sinks, stop_on_signal());
    if (!report.ok()) return report.error();
    print_report(*report, sequence->basis.is_estimate, *planned, options);
    if (options.json) print_json(to_json(*report, *planned));
    // The take is finished first, whatever became of its account.
    if (account)
        if (const Status told = account->finish(); !told.ok()) return told.error();
    int missing = 0;
    for (const OutputReport& output : report->outputs) {
        if (!output.write_error.empty()) return 1;
        missing += output.targets_missing;
    }
    return missing > 0 || report->record.slots_missing > 0 ? 2 : 0;
}

}  // namespace

void add_run_verb(CLI::App& app, int& exit_code) {
    auto options = std::make_shared<Options>();
    CLI::App* verb = app.add_subcommand("run", "play a sequence on the stage and record the take");
    verb->footer(
        "Example: stagectl run --sequence examples/sequence_s159.toml --stage examples/stage.toml \\\n"
        "           --board socket:run/board.sock --camera ring:run/cam0.ring --calibration cal -o take.rfa\n"
        "         stagectl run --sequence actor.toml --fps 24 --quality final ... -o performance.rfa\n"
        "         stagectl run --basis triangle --board usb: --camera ring:run/cam0.ring --calibration cal -o "
        "take.rfa\n"
        "Ctrl-C turns the light off and finishes the archive with what was recorded; a second one ends at once.\n"
        "Exit codes: 0 every slot and target is there; 1 an error; 2 the archive is finished, and slots or targets are "
        "missing.\nFlashing light can trigger seizures: see `stagectl sequence`.");
    options->sequence.add_to(*verb, "--sequence");
    verb->add_option("--cycles", options->cycles, "how often to play the cycle; otherwise as the sequence says")
        ->check(CLI::Range(1, 1'000'000));
    options->links.add_to(*verb, true);
    verb->add_option("--calibration", options->calibration, "folder of `stagectl calibrate`");
    verb->add_flag("--nominal", options->nominal, "no calibration: black level and gain as the stage states them");
    verb->add_option("-o,--output", options->output, "archive to make (take.rfa)")->required();
    verb->add_option(
            "--fps", options->fps,
            "a performance: targets a second, at tracking frames (of the paper's 120 a second: 24, 30, 60, 120 ...), "
            "each "
            "of the frames nearest to it, brought to its time. Otherwise one target a cycle, for subjects that "
            "hold still")
        ->check(CLI::PositiveNumber);
    verb->add_option(
            "--quality", options->quality,
            "motion compensation of a performance: none, preview, standard (if not said otherwise) or final; what "
            "each costs and errs: docs/accuracy.md")
        ->check(CLI::IsMember(motion_quality_names()));
    verb->add_option("--also", options->also,
                     "the same performance in another quality, too, in an archive of its own: QUALITY=ARCHIVE; may be "
                     "given several times, and shows what accuracy costs");
    verb->add_option("--frames", options->frames, "file for a JSON line a frame: its id and time, its cycle and slot");
    verb->add_option("--fill", options->fill,
                     "lost slots of the basis: none, or neighbours: the same slot of the cycles before and after; a "
                     "subject that moves smears")
        ->check(CLI::IsMember({"none", "neighbours"}));
    verb->add_option(
            "--estimate", options->estimate,
            "pixels whose lost and saturated samples the others do not determine: none: 0 and masked; smooth: "
            "neighbouring lamps give similar values; nonnegative: and no lamp less than nothing, no saturated "
            "sample less than white; some milliseconds a pixel; clipped: saturated samples count as they were read, "
            "so that a glint is about as bright as the camera's white. Estimates are masked; those of a prior have a "
            "bound of their bias")
        ->check(CLI::IsMember(estimate_names()));
    verb->add_option("--witness-step", options->witness_step,
                     "every so manieth pixel in x and in y is looked at for slots that do not fit the others and lamps "
                     "that give less "
                     "light; 0: none (docs/identity.md has what each step finds and costs)")
        ->check(CLI::Range(0, 1000));
    verb->add_flag("--overwrite", options->overwrite, "replace an archive of that name");
    verb->add_flag("--float", options->single_float, "store 32-bit floats; otherwise half floats");
    verb->add_option("--production", options->slate.production, "slate: production");
    verb->add_option("--scene", options->slate.scene, "slate: scene");
    verb->add_option("--take", options->slate.take, "slate: take");
    verb->add_option("--notes", options->slate.notes, "slate: notes");
    verb->add_option("--timecode", options->slate.timecode_start, "timecode of the first target, HH:MM:SS:FF");
    verb->add_flag("--json", options->json, "print the report as JSON");
    verb->callback([options, &exit_code] { exit_code = report_errors([&] { return run(*options); }); });
}

}  // namespace ols

// SPDX-License-Identifier: MIT
// Open, find the place in the cycle, develop.
#include "ingest/recording_verb.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <string_view>

#include "image/outputs.hpp"
#include "recordings/open_recording.hpp"
#include "stagectl/session.hpp"
#include "stagectl/take_options.hpp"

namespace ols {

namespace {

struct Options {
    TakeOptions take;
    RecordingOptions recording;
    std::string path, stage_path;
};

// The levels that the files state are the camera's.
void take_levels(const RecordingFacts& facts, CameraConfig& camera) {
    const auto take = [&](const char* name, const std::optional<double>& stated, double& level) {
        if (!stated) return;
        if (*stated != level)
            fmt::print(
                stderr,
                "stagectl: the recording's {} is {:g} counts, not {:g} as in the stage: the recording's is taken\n",
                name, *stated, level);
        level = *stated;
    };
    take("black", facts.black, camera.black);
    take("white", facts.white, camera.white);
}

void say_place(const RecordingFacts& facts, const RecordingPlace& place, const Sequence& sequence) {
    for (const std::string& said : facts.said) fmt::print(stderr, "stagectl: {}\n", said);
    fmt::print(
        stderr,
        "stagectl: {} frames, {} to {}, from slot {} of {} on; {} whole {}, counted from the first one (which of the "
        "play's it was cannot be known)\n",
        facts.frames(), facts.numbers.front(), facts.numbers.back(), place.first_slot, sequence.slots.size(),
        place.cycles, place.cycles == 1 ? "cycle" : "cycles");
}

Result<int> run(const Options& options) {
    auto config = open_sequence(options.take.sequence);
    if (!config.ok()) return config.error();
    Result<StageConfig> stage = options.stage_path.empty() ? default_stage() : read_stage(options.stage_path);
    if (!stage.ok()) return stage.error();
    if (stage->cameras.size() != 1)
        return fail(fmt::format("the stage has {} cameras and a recording is of one: keep one [[camera]] in the stage",
                                stage->cameras.size()));
    auto sequence = compile_sequence(*config, *stage);
    if (!sequence.ok()) return sequence.error();
    if (!sequence->is_capture())
        return fail(
            "a take is made of a capture basis: listed slots and harmonics are played and watched, and not inverted");
    RecordingOptions recording = options.recording;
    recording.files.bits = stage->cameras[0].bits;
    const auto frames = open_recording(options.path, recording, stage->cameras[0]);
    if (!frames.ok()) return frames.error();
    take_levels((*frames)->facts(), stage->cameras[0]);
    const auto calibration = open_calibration(options.take, *stage);
    if (!calibration.ok()) return calibration.error();
    const Status writable = check_outputs({.inputs = {options.take.sequence.path, options.take.sequence.basis,
                                                      options.stage_path, options.take.calibration, options.path},
                                           .streams = {options.take.frames}});
    if (!writable.ok()) return writable.error();

    const auto place =
        find_place(**frames, *sequence, stage->cameras[0], measured_black(*calibration, 0), stop_on_signal().wanted);
    if (!place.ok()) return place.error();
    say_place((*frames)->facts(), *place, *sequence);
    sequence->config.cycles = int(place->cycles);
    const auto targets = targets_of(options.take, *sequence);
    if (!targets.ok()) return targets.error();
    say_targets(options.take, *sequence, *targets);
    auto planned = plan_archives(options.take, *sequence, *stage, *targets);
    if (!planned.ok()) return planned.error();

    TakeDescription take{*sequence, *stage, *calibration, masks_of(options.take)};
    take.witness_step = options.take.witness_step;
    take.witnesses = {(*frames)->facts().has_times ? "camera number and time" : "file number", "optical code"};
    std::optional<LineFile> account;
    const TakeSinks sinks = sinks_of(*planned, options.take, account, "ingesting");
    const auto report = ingest_take(take, **frames, *place, sinks, stop_on_signal().wanted);
    if (!report.ok()) return report.error();
    return finish_take(*report, sequence->basis.is_estimate, *planned, options.take, account,
                       origin_of(**frames, *place, *sequence));
}

}  // namespace

bool is_recording(int argc, char** argv) {
    return std::any_of(argv + 1, argv + argc, [](const char* word) {
        const std::string_view text = word;
        return text == "--sequence" || text == "--basis" || text.starts_with("--sequence=") ||
               text.starts_with("--basis=");
    });
}

void add_recording_options(CLI::App& app, int& exit_code) {
    auto options = std::make_shared<Options>();
    app.description("make an archive from a recording in a camera's own memory and the sequence that was played");
    app.footer(
        "Example: stagectl ingest take.cine --sequence examples/sequence_s159.toml --stage stage.toml --calibration "
        "cal -o take.rfa\n"
        "         stagectl ingest frames/ --sequence examples/sequence_s159.toml --nominal -o take.rfa\n"
        "         stagectl ingest frames/ --raw 640x480:12p --range 1000:9000 --sequence s.toml --nominal -o take.rfa\n"
        "The optical code tells where in the cycle the recording begins; cycle 0 is its first whole one. A frame that "
        "is missing "
        "costs its group: docs/cameras.md.\n"
        "Exit codes: 0 every slot and target is there; 1 an error; 2 the archive is finished, and slots or targets are "
        "missing.");
    app.add_option("recording", options->path,
                   "a Phantom .cine, a folder of numbered PNG, TIFF, OpenEXR or DNG files, or one file of the series")
        ->required();
    options->take.sequence.add_to(app, "--sequence");
    app.add_option("--stage", options->stage_path, "stage.toml; without it, the default stage");
    app.add_option(
        "--raw", options->recording.files.raw,
        "files without a header, a frame each or behind one another: WIDTHxHEIGHT:LAYOUT, as 640x480:12p; layouts: " +
            raw_layout_names());
    app.add_option("--full-scale", options->recording.files.full_scale,
                   "value of the camera's largest count in pictures that were scaled (65520: 12 bits in the upper of "
                   "16; 1: floats)")
        ->check(CLI::Range(1e-6, 1e12));
    app.add_option("--range", options->recording.range,
                   "FIRST:LAST, which frames by their own numbers (a Phantom's trigger is 0), as -2000:12000");
    options->take.add_to(app);
    app.callback([options, &exit_code] { exit_code = report_errors([&] { return run(*options); }); });
}

}  // namespace ols

// SPDX-License-Identifier: MIT
// Options into what a take is made of.
#include "stagectl/take_options.hpp"

#include <fmt/format.h>

#include "stagectl/session.hpp"

namespace ols {

namespace {

void add_to_account(LineFile& account, const Frame& frame) {
    account.add(fmt::format(R"({{"camera":{},"frame_id":{},"timestamp_ns":{},"cycle":{},"slot":{},"tick":{}}})",
                            frame.camera, frame.stamp.frame_id, frame.stamp.timestamp_ns, frame.cycle, frame.slot,
                            frame.tick));
}

}  // namespace

void say_targets(const TakeOptions& options, const Sequence& sequence, const TakeTargets& targets) {
    say(notes_on_targets(options, sequence, targets));
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

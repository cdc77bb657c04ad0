// SPDX-License-Identifier: MIT
// stagectl run: plays a sequence and records the take.
#include <fmt/format.h>

#include "image/outputs.hpp"
#include "stagectl/flicker_warning.hpp"
#include "stagectl/session.hpp"
#include "stagectl/take_options.hpp"
#include "stagectl/verbs.hpp"

namespace ols {

namespace {

struct Options {
    LinkOptions links;
    TakeOptions take;
    int cycles = 0;
    uint64_t memory_mb = 0, spill_mb = 0;
    std::string spill;
    std::optional<bool> arm;  // whether to wait for the button; otherwise where there is one
};

// The account of identified frames, a JSON line each. It is opened with the first of them, so that a start that fails leaves an
// older one as it is.
Status check_account(const Options& options) {
    return check_outputs({.inputs = {options.take.sequence.path, options.take.sequence.basis, options.links.stage_path,
                                     options.take.calibration},
                          .streams = {options.take.frames}});
}

TakeMemory memory_of(const Options& options) {
    return {options.memory_mb * 1'000'000, options.spill, options.spill_mb * 1'000'000};
}

// Of --arm and --no-arm, or else of the stage.
Result<bool> waits_for_arm(const Options& options, const StageWatch& watch) {
    if (options.arm.value_or(false) && !watch.has_arm_button())
        return fail("--arm: the stage has no arm button: add [gpio.arm] to the stage");
    return options.arm.value_or(watch.has_arm_button());
}

Result<int> run(const Options& options) {
    auto config = open_sequence(options.take.sequence);
    if (!config.ok()) return config.error();
    if (options.cycles > 0) config->cycles = options.cycles;
    const auto stage = open_stage(options.links);
    if (!stage.ok()) return stage.error();
    const auto sequence = compile_sequence(*config, *stage);
    if (!sequence.ok()) return sequence.error();
    if (!sequence->is_capture() || sequence->config.playback.start == StartSource::photo)
        return fail(
            options.take.sequence.path +
            ": a take is recorded from a capture basis, whose triggers come at an even pace; play listed slots, "
            "harmonics and start = \"photo\" with `stagectl play`");
    const auto calibration = open_calibration(options.take, *stage);
    if (!calibration.ok()) return calibration.error();
    const auto targets = targets_of(options.take, *sequence);
    if (!targets.ok()) return targets.error();
    say_targets(options.take, *sequence, *targets);
    warn_of_flicker(*sequence);
    if (const Status writable = check_account(options); !writable.ok()) return writable.error();
    auto planned = plan_archives(options.take, *sequence, *stage, *targets);
    if (!planned.ok()) return planned.error();
    StopRequest& stop = stop_on_signal();
    auto session = open_session(options.links);
    if (!session.ok()) return session.error();
    auto watch = StageWatch::open(*stage, stop);  // behind the session, whose wait is for a virtual stage's bus, too
    if (!watch.ok()) return watch.error();
    const auto waits = waits_for_arm(options, *watch);
    if (!waits.ok()) return waits.error();

    TakeDescription take{*sequence, *stage, *calibration, masks_of(options.take)};
    take.witness_step = options.take.witness_step;
    take.memory = memory_of(options);
    std::optional<LineFile> account;
    nlohmann::json watched;  // of the recording
    TakeSinks sinks = sinks_of(*planned, options.take, account, "recording");
    sinks.account = [&] {
        say(watch->end_take());
        return watched = watch->account();
    };
    std::vector<Camera*> cameras;
    for (const auto& camera : session->cameras) cameras.push_back(camera.get());
    if (*waits)
        if (const Status armed = wait_for_arm(*watch); !armed.ok()) return armed.error();
    if (const Status ready = watch->begin_take(); !ready.ok()) return ready.error();
    const auto report = run_take(take, {*session->board, cameras}, sinks, stop);
    if (!report.ok()) return because_of(stop, report.error());
    return finish_take(*report, sequence->basis.is_estimate, *planned, options.take, account, watched);
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
        "missing or were left out.\nFlashing light can trigger seizures: see `stagectl sequence`.");
    options->take.sequence.add_to(*verb, "--sequence");
    verb->add_option("--cycles", options->cycles, "how often to play the cycle; otherwise as the sequence says")
        ->check(CLI::Range(1, 1'000'000));
    options->links.add_to(*verb, true);
    options->take.add_to(*verb);
    verb->add_option("--memory-mb", options->memory_mb,
                     "memory for frames that are not developed yet; otherwise "
                     "as much as "
                     "developing must hold at once")
        ->check(CLI::Range(1, 1 << 24));
    verb->add_option("--spill", options->spill,
                     "folder on a fast disk for frames that the memory does not hold; they are gone with the take");
    verb->add_option("--spill-mb", options->spill_mb, "there, at most; otherwise as much as the disk has")
        ->needs("--spill")
        ->check(CLI::Range(1, 1 << 26));
    verb->add_flag("--arm,!--no-arm", options->arm,
                   "wait for the arm button, or not; otherwise where the stage has one ([gpio.arm])");
    verb->callback([options, &exit_code] { exit_code = report_errors([&] { return run(*options); }); });
}

}  // namespace ols

// SPDX-License-Identifier: MIT
// stagectl swap: loads a second sequence into a board that plays, which follows at the end of a cycle.
#include <fmt/format.h>

#include <nlohmann/json.hpp>

#include "program.hpp"
#include "stage/playback.hpp"
#include "stagectl/daemon_options.hpp"
#include "stagectl/flicker_warning.hpp"
#include "stagectl/sequence_options.hpp"
#include "stagectl/session.hpp"
#include "stagectl/verbs.hpp"

namespace ols {

namespace {

struct Options {
    DaemonLink daemon;
    LinkOptions links;
    SequenceOptions sequence;
    int cycles = -1;
    bool no_wait = false, json = false;
};

// What a board says before it would take a program.
Status check_board(const Board& board, const ols_status_reply& status, const Sequence& sequence,
                   const StageConfig& stage) {
    const ols_hello_reply& info = board.info();
    if (!(info.capabilities & OLS_CAN_SWAP))
        return fail(board.name() +
                    " cannot swap programs while it plays: flash the firmware of this release: make flash");
    if (status.state == OLS_STATE_FAULT)
        return fail("nothing plays: the board has a latched fault, " + fault_text(status) +
                    "; when the cause is gone, run `stagectl status --clear-fault`");
    if (status.state != OLS_STATE_PLAYING)
        return fail(
            fmt::format("nothing plays: {} is {}; begin with `stagectl play`", board.name(), state_name(status.state)));
    if (status.next == OLS_NEXT_SWAPPING)
        return fail(board.name() + " is about to swap to another program: wait until that one plays");
    if (stage.chain_bits != info.chain_bits)
        return fail(
            fmt::format("the stage's chain has {} bits and the board's {}: give the stage that plays by --stage",
                        stage.chain_bits, uint16_t(info.chain_bits)));
    if (sequence.slots.size() > info.slots_max)
        return fail(fmt::format("the sequence has {} slots a cycle and the board takes {} at most: shorten it",
                                sequence.slots.size(), uint16_t(info.slots_max)));
    return Done{};
}

// Waits until the new program plays, or play has ended.
Result<ols_status_reply> wait_for_swap(Board& board) {
    for (;;) {
        auto status = board.status();
        if (!status.ok() || status->next != OLS_NEXT_SWAPPING) return status;
    }
}

void print_result(const Options& options, const Sequence& sequence, const ols_swap_reply& swap, bool has_followed) {
    const int cycles = sequence.config.cycles;
    if (options.json) {
        print_json({{"program", swap.program},
                    {"after_cycles", uint32_t(swap.after_cycles)},
                    {"slots", sequence.slots.size()},
                    {"cycles", cycles},
                    {"follows", has_followed}});
        return;
    }
    fmt::print("{}: {} slots, {}, {} after cycle {} of the program before, as program {}\n", options.sequence.path,
               sequence.slots.size(), cycles == 0 ? "until stopped" : fmt::format("{} cycles", cycles),
               has_followed ? "plays" : "will play", uint32_t(swap.after_cycles), swap.program);
}

// For the takes to come of the daemon's stage.
Result<int> swap_by_daemon(const Options& options) {
    if (options.sequence.path.empty() || !options.sequence.basis.empty() || options.cycles >= 0 ||
        options.sequence.exposure_us > 0 || options.no_wait)
        return fail(
            "the daemon takes the name of a sequence, in its folder of sequences, or of a basis, and nothing else; a "
            "board that "
            "`stagectl play` plays is named by --board");
    return call_and_print(options.daemon, "swap", {{"sequence", options.sequence.path}},
                          [&](const nlohmann::json& swapped) {
                              if (options.json) return print_json(swapped);
                              fmt::print("takes are recorded with {}{}\n", swapped["sequence"].get<std::string>(),
                                         swapped["armed"].get<bool>() ? ", with which the stage is armed" : "");
                          });
}

Result<int> run(const Options& options) {
    if (options.links.names_nothing()) return swap_by_daemon(options);
    const auto stage = open_stage(options.links);
    if (!stage.ok()) return stage.error();
    const auto sequence = open_compiled(options.sequence, options.cycles, *stage);
    if (!sequence.ok()) return sequence.error();
    auto board = open_board(options.links, *stage);
    if (!board.ok()) return board.error();
    const auto status = board->status();
    if (!status.ok()) return status.error();
    if (const Status fits = check_board(*board, *status, *sequence, *stage); !fits.ok()) return fits.error();
    warn_of_flicker(*sequence);
    const Status loaded =
        board->load(encode_program(*sequence, *stage), uint16_t(sequence->slots.size()), uint16_t(stage->chain_bits),
                    uint32_t(sequence->config.cycles), sequence->config.playback);
    if (!loaded.ok()) return fail(loaded.error().message + "; what plays goes on");
    const auto swap = board->swap();
    if (!swap.ok()) return fail(swap.error().message + "; what plays goes on");
    if (options.no_wait) {
        print_result(options, *sequence, *swap, false);
        return 0;
    }
    const auto after = wait_for_swap(*board);
    if (!after.ok()) return after.error();
    if (after->state == OLS_STATE_FAULT) return fail("the board stopped with fault " + fault_text(*after));
    if (after->next == OLS_NEXT_READY)
        return fail("play was stopped before the swap; the board's next start plays the sequence");
    print_result(options, *sequence, *swap, true);
    return 0;
}

}  // namespace

void add_swap_verb(CLI::App& app, int& exit_code) {
    auto options = std::make_shared<Options>();
    CLI::App* verb = app.add_subcommand(
        "swap", "another sequence for the daemon's takes, or for a board that plays: at a cycle's end");
    verb->footer(
        "Example: stagectl swap s159\n"
        "         stagectl swap examples/sequence_s159.toml --board socket:run/shared.sock\n"
        "The first is for the takes of the daemon, by the name of a sequence in its folder, or of a basis. The second "
        "is for a "
        "board, where the board is played by `stagectl play examples/sequence_single.toml --cycles 0 --share "
        "run/shared.sock`. "
        "Both sequences must have the same trigger polarities and lead.\n"
        "Ends when the sequence plays, and leaves it playing. Exit codes: 0 it plays (with --no-wait: it will); 1 an "
        "error, and what played goes on.\n"
        "Flashing light can trigger seizures: see `stagectl sequence`.");
    options->sequence.add_to(*verb, "sequence");
    options->links.add_to(*verb, false);
    options->daemon.add_to(*verb);
    verb->add_option("--cycles", options->cycles,
                     "how often to play the cycle, 0 until stopped; otherwise as the sequence says")
        ->check(CLI::Range(0, OLS_CYCLES_MAX));
    verb->add_flag("--no-wait", options->no_wait, "do not wait for the cycle's end at which it follows");
    verb->add_flag("--json", options->json, "print as JSON from which cycle on it plays");
    verb->callback([options, &exit_code] { exit_code = report_errors([&] { return run(*options); }); });
}

}  // namespace ols

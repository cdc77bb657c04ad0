// SPDX-License-Identifier: MIT
// stagectl play: plays a sequence without recording it, and follows every trigger.
#include <fmt/format.h>

#include <algorithm>
#include <nlohmann/json.hpp>

#include "device/board_relay.hpp"
#include "program.hpp"
#include "record/board_log.hpp"
#include "record/recorder.hpp"
#include "stagectl/flicker_warning.hpp"
#include "stagectl/sequence_options.hpp"
#include "stagectl/session.hpp"
#include "stagectl/verbs.hpp"

namespace ols {

namespace {

struct Options {
    LinkOptions links;
    SequenceOptions sequence;
    std::string share;  // path of a socket
    int cycles = -1;
    bool arm = false, json = false;
};

// What the board's log told; with `json`, prints a line for each trigger.
struct Account {
    uint64_t triggers = 0, fired = 0;
    LogEnd end;

    uint64_t unseen() const { return fired - triggers; }  // gone from the log before they were read
    void add(const LogNews& news, bool json) {
        fired = std::max(fired, news.next_counter);
        for (const auto& entry : news.entries) {
            ++triggers;
            if (json)
                print_json({{"counter", uint32_t(entry.counter)},
                            {"cycle", uint32_t(entry.cycle)},
                            {"slot", uint16_t(entry.slot)},
                            {"program", entry.program},
                            {"tick", uint64_t(entry.rise_ticks)}},
                           on_one_line);
        }
    }
};

// Others may use the board meanwhile, through the relay.
void follow(Board& board, const Sequence& sequence, const StopRequest& stop, BoardRelay* relay, bool json,
            Account& account) {
    const auto serve = [&]() -> Status {
        if (relay) return relay->serve(board);
        return Done{};
    };
    const BoardLog log(
        board, relay ? PlayBounds() : PlayBounds(sequence), [] { return std::vector<uint64_t>(); },
        [&] { return stop.reason(); }, [&](const LogNews& news) { account.add(news, json); },
        [&](LogEnd end) { account.end = std::move(end); }, serve);
    // Its destructor waits for the end.
}

Result<int> run(const Options& options) {
    const auto stage = open_stage(options.links);
    if (!stage.ok()) return stage.error();
    const auto sequence = open_compiled(options.sequence, options.cycles, *stage);
    if (!sequence.ok()) return sequence.error();
    StopRequest& stop = stop_on_signal();
    auto board = open_board(options.links, *stage);
    if (!board.ok()) return board.error();
    auto watch = StageWatch::open(*stage, stop);
    if (!watch.ok()) return watch.error();
    if (options.arm && !watch->has_arm_button())
        return fail("--arm: the stage has no arm button: add [gpio.arm] to the stage");
    std::unique_ptr<BoardRelay> relay;
    if (!options.share.empty()) {
        auto listening = BoardRelay::listen(options.share);
        if (!listening.ok()) return listening.error();
        relay = std::move(*listening);
    }
    warn_of_flicker(*sequence);
    if (options.arm)
        if (const Status armed = wait_for_arm(*watch); !armed.ok()) return armed.error();
    if (const Status ready = watch->begin_take(); !ready.ok()) return ready.error();
    if (const Status status = start_board(*board, *sequence, *stage); !status.ok()) return status.error();
    Account account;
    follow(*board, *sequence, stop, relay.get(), options.json, account);
    say(watch->end_take());
    if (account.end.is_lost)
        return fail(fmt::format("{}; after {} triggers the board's log could not be read", account.end.why.text,
                                account.triggers));
    const auto status = board->status();
    if (!status.ok()) return status.error();
    fmt::print(stderr, "{} triggers", account.triggers);
    if (account.unseen()) fmt::print(stderr, ", {} more were gone before they were read", account.unseen());
    if (sequence->config.playback.start == StartSource::photo)
        fmt::print(stderr, "; {} edges, {} of them missed", uint32_t(status->edges_seen),
                   uint32_t(status->edges_missed));
    fmt::print(stderr, "\n");
    if (!account.end.why.empty() && !stop.is_by_user()) return fail(account.end.why.text);
    return account.unseen() ? 2 : 0;
}

}  // namespace

void add_play_verb(CLI::App& app, int& exit_code) {
    auto options = std::make_shared<Options>();
    CLI::App* verb = app.add_subcommand("play", "play a sequence without recording it");
    verb->footer(
        "Example: stagectl play examples/sequence_photo.toml --board socket:run/board.sock --json\n"
        "Ctrl-C turns the light off. Exit codes: 0 played, or stopped by you; 1 an error or a fault; 2 triggers were "
        "not seen.\n"
        "Flashing light can trigger seizures: see `stagectl sequence`.");
    options->sequence.add_to(*verb, "sequence");
    options->links.add_to(*verb, false);
    verb->add_option("--cycles", options->cycles,
                     "how often to play the cycle, 0 until stopped; otherwise as the sequence says")
        ->check(CLI::Range(0, OLS_CYCLES_MAX));
    verb->add_option("--share", options->share,
                     "path of a socket at which other programs may use the board meanwhile, as --board socket:PATH: "
                     "`stagectl swap`, `stagectl status`");
    verb->add_flag("--arm", options->arm, "wait for the arm button ([gpio.arm] of the stage)");
    verb->add_flag("--json", options->json, "print a JSON line for each trigger");
    verb->callback([options, &exit_code] { exit_code = report_errors([&] { return run(*options); }); });
}

}  // namespace ols

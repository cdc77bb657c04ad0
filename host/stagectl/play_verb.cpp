// SPDX-License-Identifier: MIT
// stagectl play: plays a sequence without recording it, and follows every trigger.
#include <fmt/format.h>

#include <algorithm>
#include <nlohmann/json.hpp>

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
    int cycles = -1;
    bool json = false;
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
                            {"tick", uint64_t(entry.rise_ticks)}},
                           on_one_line);
        }
    }
};

Result<Sequence> compile(const Options& options, const StageConfig& stage) {
    auto config = open_sequence(options.sequence);
    if (!config.ok()) return config.error();
    if (options.cycles >= 0) config->cycles = options.cycles;
    return compile_sequence(*config, stage);
}

void follow(Board& board, const Sequence& sequence, const std::atomic<bool>& stop, bool json, Account& account) {
    const BoardLog log(
        board, PlayBounds(sequence), [] { return std::vector<uint64_t>(); },
        [&] {
            return stop ? Reason{Cause::stopped, "stopped by you"} : Reason{};
        },
        [&](const LogNews& news) { account.add(news, json); }, [&](LogEnd end) { account.end = std::move(end); });
    // Its destructor waits for the end.
}

Result<int> run(const Options& options) {
    const auto stage = open_stage(options.links);
    if (!stage.ok()) return stage.error();
    const auto sequence = compile(options, *stage);
    if (!sequence.ok()) return sequence.error();
    auto board = open_board(options.links, *stage);
    if (!board.ok()) return board.error();
    warn_of_flicker(*sequence);
    const std::atomic<bool>& stop = stop_on_signal();
    if (const Status status = start_board(*board, *sequence, *stage); !status.ok()) return status.error();
    Account account;
    follow(*board, *sequence, stop, options.json, account);
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
    if (!account.end.why.empty() && !stop) return fail(account.end.why.text);
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
    verb->add_flag("--json", options->json, "print a JSON line for each trigger");
    verb->callback([options, &exit_code] { exit_code = report_errors([&] { return run(*options); }); });
}

}  // namespace ols

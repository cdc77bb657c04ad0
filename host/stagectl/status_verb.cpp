// SPDX-License-Identifier: MIT
// stagectl status: what the board says of itself, and the end of a latched fault.
#include <fmt/format.h>

#include <nlohmann/json.hpp>

#include "device/cycle_check.hpp"
#include "stagectl/session.hpp"
#include "stagectl/verbs.hpp"

namespace ols {

namespace {

struct Options {
    LinkOptions links;
    bool clear_fault = false, cycles = false, json = false;
};

// Reads the log that the board keeps and holds it against the digests it keeps.
Status print_cycles(Board& board) {
    std::vector<ols_trigger_log_entry> entries;
    for (uint32_t next = 0;;) {
        const auto log = board.read_trigger_log(next);
        if (!log.ok()) return log.error();
        if (log->entries.empty()) break;
        entries.insert(entries.end(), log->entries.begin(), log->entries.end());
        next = entries.back().counter + 1;
    }
    for (uint32_t next = 0;;) {
        const auto read = board.read_digests(next);
        if (!read.ok()) return read.error();
        if (read->digests.empty()) return Done{};
        for (const ols_cycle_digest& digest : read->digests) {
            const Status checked = check_cycle(digest, entries);
            fmt::print("cycle {} of program {}: {} triggers, {} to {} ticks, {}{}\n", uint32_t(digest.cycle),
                       digest.program, uint16_t(digest.trigger_count), uint64_t(digest.first_rise_ticks),
                       uint64_t(digest.last_rise_ticks), checked.ok() ? "as logged" : checked.error().message,
                       digest.flags & OLS_DIGEST_INCOMPLETE ? " (incomplete)" : "");
        }
        next = read->first_digest + uint32_t(read->digests.size());
    }
}

Result<int> run(const Options& options) {
    const auto stage = open_stage(options.links);
    if (!stage.ok()) return stage.error();
    auto board = open_board(options.links, *stage);
    if (!board.ok()) return board.error();
    if (options.clear_fault)
        if (const Status status = board->clear_fault(); !status.ok()) return status.error();
    const auto status = board->status();
    if (!status.ok()) return status.error();
    const auto& info = board->info();
    if (options.json) {
        const nlohmann::json json = {{"board", board->id()},
                                     {"board_name", info.board},
                                     {"firmware", info.firmware_version},
                                     {"state", state_name(status->state)},
                                     {"fault", fault_text(*status)},
                                     {"chain_bits", uint16_t(info.chain_bits)},
                                     {"slots_max", uint16_t(info.slots_max)},
                                     {"slot_gap_ticks", uint32_t(info.slot_gap_ticks)},
                                     {"triggers_fired", uint32_t(status->triggers_fired)},
                                     {"cycles_played", uint32_t(status->cycles_played)},
                                     {"log_entries_lost", uint32_t(status->log_entries_lost)}};
        fmt::print("{}\n", json.dump(1));
    } else {
        fmt::print("board {} ({}), firmware {}: {}\nfault: {}\nchain of {} bits, {} slots at most, {} triggers fired\n",
                   board->id(), info.board, info.firmware_version, state_name(status->state), fault_text(*status),
                   uint16_t(info.chain_bits), uint16_t(info.slots_max), uint32_t(status->triggers_fired));
    }
    if (options.cycles && !options.json)
        if (const Status printed = print_cycles(*board); !printed.ok()) return printed.error();
    return 0;
}

}  // namespace

void add_status_verb(CLI::App& app, int& exit_code) {
    auto options = std::make_shared<Options>();
    CLI::App* verb = app.add_subcommand("status", "ask the board how it is");
    verb->footer("Example: stagectl status --board usb:");
    options->links.add_to(*verb, false);
    verb->add_flag("--clear-fault", options->clear_fault, "end a latched fault, once its cause is gone");
    verb->add_flag("--cycles", options->cycles, "check the cycles that the board still keeps against its trigger log");
    verb->add_flag("--json", options->json, "print as JSON");
    verb->callback([options, &exit_code] { exit_code = report_errors([&] { return run(*options); }); });
}

}  // namespace ols

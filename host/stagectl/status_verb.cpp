// SPDX-License-Identifier: MIT
// stagectl status: what the board says of itself, and the end of a latched fault.
#include <fmt/format.h>

#include <nlohmann/json.hpp>

#include "device/cycle_check.hpp"
#include "device/log_reader.hpp"
#include "program.hpp"
#include "stagectl/daemon_status.hpp"
#include "stagectl/session.hpp"
#include "stagectl/verbs.hpp"

namespace ols {

namespace {

struct Options {
    DaemonLink daemon;
    LinkOptions links;
    bool clear_fault = false, cycles = false, json = false;
    bool watch = false, metrics = false;
};

// A cycle that the board still keeps, and what holding its digest against its log gave.
struct CheckedCycle {
    ols_cycle_digest digest;
    std::string problem;  // empty: as logged

    bool is_incomplete() const { return digest.flags & OLS_DIGEST_INCOMPLETE; }
};

Result<std::vector<CheckedCycle>> check_cycles(Board& board) {
    const auto entries = read_kept_log(board);
    if (!entries.ok()) return entries.error();
    const auto digests = read_kept_digests(board);
    if (!digests.ok()) return digests.error();
    std::vector<CheckedCycle> cycles;
    for (const ols_cycle_digest& digest : *digests) {
        const Status checked = check_cycle(digest, *entries);
        cycles.push_back({digest, checked.ok() ? "" : checked.error().message});
    }
    return cycles;
}

void print_cycles(const std::vector<CheckedCycle>& cycles) {
    for (const CheckedCycle& cycle : cycles)
        fmt::print("cycle {} of program {}: {} triggers, {} to {} ticks, {}{}\n", uint32_t(cycle.digest.cycle),
                   cycle.digest.program, uint16_t(cycle.digest.trigger_count), uint64_t(cycle.digest.first_rise_ticks),
                   uint64_t(cycle.digest.last_rise_ticks), cycle.problem.empty() ? "as logged" : cycle.problem,
                   cycle.is_incomplete() ? " (incomplete)" : "");
}

nlohmann::json to_json(const std::vector<CheckedCycle>& cycles) {
    auto json = nlohmann::json::array();
    for (const CheckedCycle& cycle : cycles)
        json.push_back({{"cycle", uint32_t(cycle.digest.cycle)},
                        {"program", cycle.digest.program},
                        {"triggers", uint16_t(cycle.digest.trigger_count)},
                        {"first_tick", uint64_t(cycle.digest.first_rise_ticks)},
                        {"last_tick", uint64_t(cycle.digest.last_rise_ticks)},
                        {"as_logged", cycle.problem.empty()},
                        {"problem", cycle.problem},
                        {"incomplete", cycle.is_incomplete()}});
    return json;
}

Result<int> run(const Options& options) {
    if (options.links.names_nothing() && !options.cycles)
        return daemon_status(options.daemon, {options.clear_fault, options.watch, options.metrics, options.json});
    if (options.watch || options.metrics)
        return fail("--watch and --metrics are of the daemon: leave out --stage and --board");
    const auto stage = open_stage(options.links);
    if (!stage.ok()) return stage.error();
    auto board = open_board(options.links, *stage);
    if (!board.ok()) return board.error();
    if (options.clear_fault)
        if (const Status status = board->clear_fault(); !status.ok()) return status.error();
    const auto status = board->status();
    if (!status.ok()) return status.error();
    std::vector<CheckedCycle> cycles;
    if (options.cycles) {
        auto checked = check_cycles(*board);
        if (!checked.ok()) return checked.error();
        cycles = std::move(*checked);
    }
    const auto& info = board->info();
    if (options.json) {
        nlohmann::json json = {{"board", board->id()},
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
        if (options.cycles) json["cycles"] = to_json(cycles);
        print_json(json);
    } else {
        fmt::print("board {} ({}), firmware {}: {}\nfault: {}\nchain of {} bits, {} slots at most, {} triggers fired\n",
                   board->id(), info.board, info.firmware_version, state_name(status->state), fault_text(*status),
                   uint16_t(info.chain_bits), uint16_t(info.slots_max), uint32_t(status->triggers_fired));
    }
    if (!options.json) print_cycles(cycles);
    return 0;
}

}  // namespace

void add_status_verb(CLI::App& app, int& exit_code) {
    auto options = std::make_shared<Options>();
    CLI::App* verb = app.add_subcommand("status", "how the daemon's stage is, or with --board a board of one's own");
    verb->footer(
        "Example: stagectl status --watch\n"
        "         stagectl status --board usb:\n"
        "Exit codes: 0; 1 an error, or the stage is in a fault.");
    options->links.add_to(*verb, false);
    options->daemon.add_to(*verb);
    verb->add_flag("--watch", options->watch, "go on: what changes, until Ctrl-C");
    verb->add_flag("--metrics", options->metrics, "the daemon's figures in Prometheus' text format");
    verb->add_flag("--clear-fault", options->clear_fault, "end a latched fault, once its cause is gone");
    verb->add_flag("--cycles", options->cycles, "check the cycles that the board still keeps against its trigger log");
    verb->add_flag("--json", options->json, "print as JSON");
    verb->callback([options, &exit_code] { exit_code = report_errors([&] { return run(*options); }); });
}

}  // namespace ols

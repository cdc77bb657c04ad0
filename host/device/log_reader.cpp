// SPDX-License-Identifier: MIT
// Counters that must rise from message to message.
#include "device/log_reader.hpp"

#include <fmt/format.h>

#include <algorithm>

namespace ols {

namespace {

constexpr const char* what_to_do = ": reset it and start over";

}  // namespace

Status LogReader::check(const TriggerLog& log) const {
    const auto wrong = [&](const std::string& what) { return fail(board_.name() + " " + what + what_to_do); };
    if (log.next_counter < fired_ || log.entries_lost < lost_)
        return wrong(fmt::format("counts back, from {} triggers to {}", fired_, log.next_counter));
    if (log.next_counter > triggers_max_)
        return wrong(
            fmt::format("says that it fired {} times, and the program does {} times", log.next_counter, triggers_max_));
    if (any_ && !log.entries.empty() && log.entries.front().rise_ticks <= last_rise_ticks_)
        return wrong(fmt::format("logged trigger {} at tick {}, and one before it at tick {}",
                                 uint32_t(log.entries.front().counter), uint64_t(log.entries.front().rise_ticks),
                                 last_rise_ticks_));
    return Done{};
}

Result<TriggerLog> LogReader::read_on() {
    auto log = board_.read_trigger_log(next_, fired_);
    if (!log.ok()) return log;
    if (const Status goes_on = check(*log); !goes_on.ok()) return goes_on.error();
    next_ = log->first_counter + uint32_t(log->entries.size());
    fired_ = log->next_counter;
    lost_ = log->entries_lost;
    if (!log->entries.empty()) {
        next_ = log->entries.back().counter + 1;
        last_rise_ticks_ = log->entries.back().rise_ticks;
        any_ = true;
    }
    return log;
}

Result<std::vector<ols_trigger_log_entry>> read_kept_log(Board& board) {
    LogReader reader(board);
    std::vector<ols_trigger_log_entry> kept;
    for (uint32_t end = 0;;) {
        const auto log = reader.read_on();
        if (!log.ok()) return log.error();
        if (end == 0) {
            end = log->next_counter;
            if (end - log->first_counter > log_entries_kept)
                return fail(fmt::format("{} keeps {} triggers, and a board has room for {}{}", board.name(),
                                        end - log->first_counter, log_entries_kept, what_to_do));
        }
        kept.insert(kept.end(), log->entries.begin(), log->entries.end());
        if (reader.next() >= end) return kept;
    }
}

Result<std::vector<ols_cycle_digest>> read_kept_digests(Board& board) {
    std::vector<ols_cycle_digest> kept;
    for (uint32_t next = 0, end = 0;;) {
        const auto read = board.read_digests(next);
        if (!read.ok()) return read.error();
        if (end == 0) {
            end = read->next_digest;
            if (end - read->first_digest > digests_kept)
                return fail(fmt::format("{} keeps {} digests, and a board has room for {}{}", board.name(),
                                        end - read->first_digest, digests_kept, what_to_do));
        }
        kept.insert(kept.end(), read->digests.begin(), read->digests.end());
        next = read->first_digest + uint32_t(read->digests.size());
        if (next >= end) return kept;
    }
}

}  // namespace ols

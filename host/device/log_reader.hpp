// SPDX-License-Identifier: MIT
// LogReader: the board's trigger log from its begin on, message by message, as long as each goes on where the one before ended.
#pragma once

#include "device/board.hpp"

namespace ols {

// Entries and digests that a board keeps (PROTOCOL.md, "trigger log", "cycle digests").
constexpr uint32_t log_entries_kept = 1024, digests_kept = 32;

class LogReader {
  public:
    // Of a program that fires `triggers_max` times at most.
    explicit LogReader(Board& board, uint64_t triggers_max = UINT32_MAX) : board_(board), triggers_max_(triggers_max) {}

    // What is new; no entries: all that fired has been read, or is gone. Errors: the board's, or in which way its log does not go
    // on from what it told before, or that it fires more often than the program.
    Result<TriggerLog> read_on();

    uint32_t next() const { return next_; }    // the counter that is read next
    uint32_t fired() const { return fired_; }  // triggers, as far as the board has told

  private:
    Status check(const TriggerLog& log) const;

    Board& board_;
    const uint64_t triggers_max_;
    uint32_t next_ = 0, fired_ = 0, lost_ = 0;
    uint64_t last_rise_ticks_ = 0;
    bool any_ = false;
};

// All entries, or digests, that the board keeps at the time of the first request. The error says what is wrong with them.
Result<std::vector<ols_trigger_log_entry>> read_kept_log(Board& board);
Result<std::vector<ols_cycle_digest>> read_kept_digests(Board& board);

}  // namespace ols

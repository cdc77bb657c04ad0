// SPDX-License-Identifier: MIT
// Replies of the board whose length or content the wire's structs leave open, checked before anything is taken from them.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "result.hpp"
#include "wire.h"

namespace ols {

// What the trigger log says of one request.
struct TriggerLog {
    std::vector<ols_trigger_log_entry> entries;  // counters one after the other
    uint32_t first_counter = 0;                  // of the first of them
    uint32_t next_counter = 0;                   // that the next trigger will have
    uint32_t entries_lost = 0;                   // since start: the board's log had no room
};

// The digests of cycles that one request gave.
struct CycleDigests {
    std::vector<ols_cycle_digest> digests;
    uint32_t first_digest = 0;  // number of the first of them
    uint32_t next_digest = 0;   // number that the next one will have
    uint32_t digests_lost = 0;  // since start: overwritten before they were read
};

// The payload of a reply to `asked`. Errors say what is wrong with it, to stand behind the board's name ("sent ..."): a length
// or a count that is not the other's, more than was asked for, what comes before it, counters with gaps, ticks that do not rise.
Result<TriggerLog> parse_trigger_log(std::span<const uint8_t> payload, const ols_read_trigger_log& asked);
Result<CycleDigests> parse_digests(std::span<const uint8_t> payload, const ols_read_digests& asked);

// Appends what is new in `more`, the reply to a later request: when what was asked for is gone, replies begin alike. The error is
// as above.
Status append_log(TriggerLog& log, const TriggerLog& more);

// Text of the board's, up to its zero: ASCII to be printed. Anything else (what is not UTF-8, a terminal's commands) becomes '?'.
std::string printable(std::span<const char> text);

}  // namespace ols

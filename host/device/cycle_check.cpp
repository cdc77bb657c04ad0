// SPDX-License-Identifier: MIT
// Cycle check: the digest made anew from the entries.
#include "device/cycle_check.hpp"

#include <fmt/format.h>

#include "frame.h"

namespace ols {

Status check_cycle(const ols_cycle_digest& digest, std::span<const ols_trigger_log_entry> entries) {
    ols_cycle_digest own{};
    for (const ols_trigger_log_entry& entry : entries) {
        if (entry.cycle != digest.cycle || entry.program != digest.program) continue;
        if (own.trigger_count++ == 0) {
            own.first_counter = entry.counter;
            own.first_rise_ticks = entry.rise_ticks;
        }
        own.last_rise_ticks = entry.rise_ticks;
        own.entries_crc32 = ols_crc32(own.entries_crc32, &entry, sizeof entry);
    }
    const std::string cycle = fmt::format("cycle {} of program {}: ", uint32_t(digest.cycle), digest.program);
    if (own.trigger_count != digest.trigger_count)
        return fail(fmt::format("{}{} triggers were read and {} fired: read the log before the board overwrites it",
                                cycle, uint16_t(own.trigger_count), uint16_t(digest.trigger_count)));
    if (own.first_counter != digest.first_counter)
        return fail(fmt::format("{}begins with trigger {} and not {}", cycle, uint32_t(own.first_counter),
                                uint32_t(digest.first_counter)));
    if (own.first_rise_ticks != digest.first_rise_ticks || own.last_rise_ticks != digest.last_rise_ticks)
        return fail(fmt::format("{}from tick {} to {} as read, {} to {} as the board says", cycle,
                                uint64_t(own.first_rise_ticks), uint64_t(own.last_rise_ticks),
                                uint64_t(digest.first_rise_ticks), uint64_t(digest.last_rise_ticks)));
    if (own.entries_crc32 != digest.entries_crc32)
        return fail(cycle + "the entries that were read are not those that the board logged (CRC): read them again");
    return Done{};
}

}  // namespace ols

// SPDX-License-Identifier: MIT
// Counts and counters of the board's log and digests.
#include "device/board_replies.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cstring>

namespace ols {

namespace {

// Ticks are added and subtracted by who reads them; the board's clock gets there in a thousand years.
constexpr uint64_t ticks_max = uint64_t(1) << 62;

// Head and items of a reply, of which `count_of` tells how many there are.
template <typename Head, typename Item, typename Count>
Result<std::pair<Head, std::vector<Item>>> split(std::span<const uint8_t> payload, const char* what, size_t items_max,
                                                 Count count_of) {
    Head head;
    if (payload.size() < sizeof head)
        return fail(fmt::format("sent {} of {} bytes, less than its head", what, payload.size()));
    std::memcpy(&head, payload.data(), sizeof head);
    const size_t count = count_of(head);
    if (count > items_max)
        return fail(fmt::format("sent {} of {} entries, and {} were asked for at most", what, count, items_max));
    if (payload.size() != sizeof head + count * sizeof(Item))
        return fail(fmt::format("sent {} of {} bytes, which are not its {} entries", what, payload.size(), count));
    std::vector<Item> items(count);
    if (count > 0) std::memcpy(items.data(), payload.data() + sizeof head, count * sizeof(Item));
    return std::pair(head, std::move(items));
}

// Numbers `first` to `first` + `count` of `next` that there are so far, where they were asked for from `asked` on.
Status check_numbers(const char* what, uint32_t asked, uint32_t first, size_t count, uint32_t next) {
    if (next < asked)
        return fail(
            fmt::format("has counted {} {} only, after it had counted {}: was it started anew?", next, what, asked));
    if (first < asked)
        return fail(fmt::format("sent {} from {} on where those from {} on were asked for", what, first, asked));
    if (uint64_t(first) + count > next)
        return fail(fmt::format("sent {} up to {} of {} that there are", what, uint64_t(first) + count, next));
    if (count == 0 && first != next) return fail(fmt::format("has {} {} and sends none from {} on", next, what, first));
    return Done{};
}

Status check_order(const ols_trigger_log_entry& before, const ols_trigger_log_entry& entry) {
    if (entry.rise_ticks > before.rise_ticks) return Done{};
    return fail(fmt::format("logged trigger {} at tick {} and trigger {} at tick {}, which is not later",
                            uint32_t(before.counter), uint64_t(before.rise_ticks), uint32_t(entry.counter),
                            uint64_t(entry.rise_ticks)));
}

Status check_entries(const TriggerLog& log) {
    for (size_t n = 0; n < log.entries.size(); ++n) {
        const ols_trigger_log_entry& entry = log.entries[n];
        if (entry.counter != log.first_counter + n)
            return fail(fmt::format("sent trigger {} in the place of trigger {}", uint32_t(entry.counter),
                                    log.first_counter + n));
        if (entry.rise_ticks >= ticks_max)
            return fail(fmt::format("logged trigger {} at tick {}, which no board reaches", uint32_t(entry.counter),
                                    uint64_t(entry.rise_ticks)));
        if (n == 0) continue;
        if (const Status rises = check_order(log.entries[n - 1], entry); !rises.ok()) return rises;
    }
    return Done{};
}

Status check_digests(const std::vector<ols_cycle_digest>& digests) {
    for (size_t n = 0; n < digests.size(); ++n) {
        const ols_cycle_digest& digest = digests[n];
        if (digest.first_rise_ticks > digest.last_rise_ticks || digest.last_rise_ticks >= ticks_max)
            return fail(fmt::format("sent a digest of cycle {} from tick {} to tick {}", uint32_t(digest.cycle),
                                    uint64_t(digest.first_rise_ticks), uint64_t(digest.last_rise_ticks)));
        if (n > 0 && digest.first_counter <= digests[n - 1].first_counter)
            return fail(fmt::format("sent a digest that begins with trigger {} behind one that begins with trigger {}",
                                    uint32_t(digest.first_counter), uint32_t(digests[n - 1].first_counter)));
    }
    return Done{};
}

}  // namespace

Result<TriggerLog> parse_trigger_log(std::span<const uint8_t> payload, const ols_read_trigger_log& asked) {
    auto parts = split<ols_trigger_log_reply, ols_trigger_log_entry>(
        payload, "a trigger log", asked.entries_max, [](const auto& head) { return size_t(head.entry_count); });
    if (!parts.ok()) return parts.error();
    auto& [head, entries] = *parts;
    TriggerLog log{std::move(entries), head.first_counter, head.next_counter, head.entries_lost};
    if (const Status numbered =
            check_numbers("triggers", asked.first_counter, log.first_counter, log.entries.size(), log.next_counter);
        !numbered.ok())
        return numbered.error();
    if (const Status ordered = check_entries(log); !ordered.ok()) return ordered.error();
    return log;
}

Status append_log(TriggerLog& log, const TriggerLog& more) {
    if (more.next_counter < log.next_counter || more.entries_lost < log.entries_lost)
        return fail(fmt::format("counts back, from {} triggers to {}: was it started anew?", log.next_counter,
                                more.next_counter));
    if (log.entries.empty()) log.first_counter = more.first_counter;
    log.next_counter = more.next_counter;
    log.entries_lost = more.entries_lost;
    for (const ols_trigger_log_entry& entry : more.entries) {
        if (!log.entries.empty() && entry.counter <= log.entries.back().counter) continue;
        if (!log.entries.empty())
            if (const Status rises = check_order(log.entries.back(), entry); !rises.ok()) return rises;
        log.entries.push_back(entry);
    }
    return Done{};
}

Result<CycleDigests> parse_digests(std::span<const uint8_t> payload, const ols_read_digests& asked) {
    auto parts = split<ols_digests_reply, ols_cycle_digest>(payload, "a list of digests", asked.digests_max,
                                                            [](const auto& head) { return size_t(head.digest_count); });
    if (!parts.ok()) return parts.error();
    auto& [head, digests] = *parts;
    CycleDigests read{std::move(digests), head.first_digest, head.next_digest, head.digests_lost};
    if (const Status numbered =
            check_numbers("digests", asked.first_digest, read.first_digest, read.digests.size(), read.next_digest);
        !numbered.ok())
        return numbered.error();
    if (const Status ordered = check_digests(read.digests); !ordered.ok()) return ordered.error();
    return read;
}

std::string printable(std::span<const char> text) {
    std::string ascii(text.begin(), std::find(text.begin(), text.end(), '\0'));
    for (char& c : ascii)
        if (c < ' ' || c > '~') c = '?';
    return ascii;
}

}  // namespace ols

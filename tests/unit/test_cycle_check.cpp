// SPDX-License-Identifier: MIT
// The check of a cycle's log entries, with a digest that zlib made, and with each of its numbers wrong.
// links: ols_device z
#include "device/cycle_check.hpp"

#include <gtest/gtest.h>
#include <zlib.h>

#include <vector>

namespace ols {
namespace {

std::vector<ols_trigger_log_entry> log_of_three_cycles() {
    std::vector<ols_trigger_log_entry> entries;
    for (uint32_t n = 0; n < 12; n++) entries.push_back({100 + 50ull * n, n, n / 4, uint16_t(n % 4), 1, 0});
    return entries;
}

ols_cycle_digest digest_of_the_second(const std::vector<ols_trigger_log_entry>& entries) {
    const uLong crc = crc32(0, reinterpret_cast<const Bytef*>(&entries[4]), 4 * sizeof entries[4]);
    return {300, 450, 4, 1, uint32_t(crc), 4, 0, 0};
}

std::string difference(const ols_cycle_digest& digest, std::span<const ols_trigger_log_entry> entries) {
    const Status status = check_cycle(digest, entries);
    return status.ok() ? "" : status.error().message;
}

TEST(CycleCheck, EntriesThatAreTheBoardsPassWhateverElseWasRead) {
    const auto entries = log_of_three_cycles();
    EXPECT_EQ(difference(digest_of_the_second(entries), entries), "");
    EXPECT_EQ(difference(digest_of_the_second(entries), std::span(entries).subspan(4, 4)), "");
}

TEST(CycleCheck, EveryDifferenceIsNamed) {
    const auto entries = log_of_three_cycles();
    const ols_cycle_digest right = digest_of_the_second(entries);
    EXPECT_NE(difference(right, std::span(entries).subspan(5)).find("3 triggers were read and 4 fired"),
              std::string::npos);
    auto damaged = entries;
    damaged[6].slot ^= 1;
    EXPECT_NE(difference(right, damaged).find("CRC"), std::string::npos);
    damaged = entries;
    damaged[4].rise_ticks++;
    EXPECT_NE(difference(right, damaged).find("from tick 301 to 450 as read, 300 to 450"), std::string::npos);
    ols_cycle_digest other = right;
    other.first_counter = 3;
    EXPECT_NE(difference(other, entries).find("begins with trigger 4 and not 3"), std::string::npos);
    other = right;
    other.program = 1;
    EXPECT_NE(difference(other, entries).find("0 triggers were read"), std::string::npos);
}

}  // namespace
}  // namespace ols

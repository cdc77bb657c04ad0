// SPDX-License-Identifier: MIT
// Cycle digests against what zlib and plain loops make of the same entries.
// links: ols_firmware z
#include "cycle_digest.h"

#include <gtest/gtest.h>
#include <zlib.h>

#include <cstring>
#include <vector>

namespace ols {
namespace {

ols_trigger_log_entry entry(uint32_t counter, uint32_t cycle, uint8_t program = 0) {
    return {1'000'000 + 57'870ull * counter, counter, cycle, uint16_t(counter % 3), 1, program};
}

uint32_t crc_of(uint32_t first, uint32_t count, uint32_t cycle, uint8_t program = 0) {
    uLong crc = 0;
    for (uint32_t n = first; n < first + count; n++) {
        const ols_trigger_log_entry one = entry(n, cycle, program);
        crc = crc32(crc, reinterpret_cast<const Bytef*>(&one), sizeof one);
    }
    return uint32_t(crc);
}

void add(uint32_t first, uint32_t count, uint32_t cycle, uint8_t program = 0) {
    for (uint32_t n = first; n < first + count; n++) {
        const ols_trigger_log_entry one = entry(n, cycle, program);
        cycle_digest_begin_turn(1);
        cycle_digest_add(&one);
    }
}

struct Reading {
    ols_digests_reply head;
    std::vector<ols_cycle_digest> digests;
};

Reading read(uint32_t first, uint16_t most = OLS_DIGESTS_MAX) {
    Reading reading{{}, std::vector<ols_cycle_digest>(most)};
    cycle_digest_read(first, most, &reading.head, reading.digests.data());
    reading.digests.resize(reading.head.digest_count);
    return reading;
}

TEST(CycleDigest, SaysOfEachCycleWhatItsEntriesSay) {
    cycle_digest_begin();
    add(0, 3, 0);
    EXPECT_EQ(read(0).head.next_digest, 0u) << "the cycle may have more triggers";
    add(3, 2, 1);
    cycle_digest_end(true);
    const Reading all = read(0);
    ASSERT_EQ(all.digests.size(), 2u);
    const ols_cycle_digest& second = all.digests[1];
    EXPECT_EQ(uint64_t(second.first_rise_ticks), 1'000'000 + 57'870ull * 3);
    EXPECT_EQ(uint64_t(second.last_rise_ticks), 1'000'000 + 57'870ull * 4);
    EXPECT_EQ(uint32_t(second.first_counter), 3u);
    EXPECT_EQ(uint32_t(second.cycle), 1u);
    EXPECT_EQ(uint16_t(second.trigger_count), 2);
    EXPECT_EQ(uint32_t(second.entries_crc32), crc_of(3, 2, 1));
    EXPECT_EQ(uint32_t(all.digests[0].entries_crc32), crc_of(0, 3, 0));
    EXPECT_EQ(second.flags, 0);
}

TEST(CycleDigest, TheSameCycleOfTheNextProgramIsAnother) {
    cycle_digest_begin();
    add(0, 2, 0, 0);
    add(2, 2, 0, 1);
    cycle_digest_end(true);
    const Reading all = read(0);
    ASSERT_EQ(all.digests.size(), 2u);
    EXPECT_EQ(all.digests[1].program, 1);
    EXPECT_EQ(uint32_t(all.digests[1].entries_crc32), crc_of(2, 2, 0, 1));
}

TEST(CycleDigest, LostTriggersAndAStopMarkTheCyclesTheyTouch) {
    cycle_digest_begin();
    add(0, 3, 0);
    add(3, 1, 1);
    cycle_digest_skip();  // the rest of cycle 1, cycle 2, the begin of cycle 3
    add(8, 1, 3);
    add(9, 3, 4);
    add(12, 1, 5);
    cycle_digest_end(false);
    std::vector<int> flags;
    std::vector<uint32_t> cycles;
    for (const auto& digest : read(0).digests) {
        flags.push_back(digest.flags);
        cycles.push_back(digest.cycle);
    }
    EXPECT_EQ(cycles, (std::vector<uint32_t>{0, 1, 3, 4, 5}));
    EXPECT_EQ(flags, (std::vector<int>{0, OLS_DIGEST_INCOMPLETE, OLS_DIGEST_INCOMPLETE, 0, OLS_DIGEST_INCOMPLETE}));
}

TEST(CycleDigest, MoreThanATurnHasTimeForIsLeftOutAndSaid) {
    cycle_digest_begin();
    add(0, 50, 0);
    cycle_digest_begin_turn(65);
    for (uint32_t n = 50; n < 115; n++) {
        const ols_trigger_log_entry one = entry(n, n / 60);
        cycle_digest_add(&one);
    }
    add(115, 5, 1);
    add(120, 5, 2);
    cycle_digest_end(true);
    const Reading all = read(0);
    ASSERT_EQ(all.digests.size(), 3u);
    EXPECT_EQ(uint16_t(all.digests[0].trigger_count), 50);
    EXPECT_EQ(uint16_t(all.digests[1].trigger_count), 5);
    EXPECT_EQ(all.digests[0].flags, OLS_DIGEST_INCOMPLETE);
    EXPECT_EQ(all.digests[1].flags, OLS_DIGEST_INCOMPLETE);
    EXPECT_EQ(all.digests[2].flags, 0);
}

TEST(CycleDigest, OverwrittenOnesAreCountedUnlessTheyWereRead) {
    cycle_digest_begin();
    for (uint32_t n = 0; n < 32; n++) add(n, 1, n);
    EXPECT_EQ(read(0).digests.size(), 31u);  // the 32nd is under way
    for (uint32_t n = 32; n < 100; n++) add(n, 1, n);
    cycle_digest_end(true);
    const Reading rest = read(0);
    EXPECT_EQ(rest.head.next_digest, 100u);
    EXPECT_EQ(rest.head.first_digest, 68u) << "32 are kept";
    EXPECT_EQ(rest.head.digests_lost, 68u - 31u);
    EXPECT_EQ(uint32_t(rest.digests[0].cycle), 68u);
    EXPECT_EQ(read(200).head.digest_count, 0u);
}

TEST(CycleDigest, TellingGivesEachOnceInOrderAndAfterANewStartFromTheFirst) {
    ols_cycle_digest digest;
    cycle_digest_begin();
    add(0, 1, 0);
    add(1, 1, 1);
    ASSERT_TRUE(cycle_digest_tell(&digest));
    EXPECT_EQ(uint32_t(digest.cycle), 0u);
    EXPECT_FALSE(cycle_digest_tell(&digest));
    for (uint32_t n = 2; n < 50; n++) add(n, 1, n);
    ASSERT_TRUE(cycle_digest_tell(&digest));
    EXPECT_EQ(uint32_t(digest.cycle), 17u) << "those before are overwritten";
    cycle_digest_begin();
    EXPECT_FALSE(cycle_digest_tell(&digest));
    add(0, 1, 0);
    cycle_digest_end(true);
    ASSERT_TRUE(cycle_digest_tell(&digest));
    EXPECT_EQ(uint32_t(digest.cycle), 0u);
}

}  // namespace
}  // namespace ols

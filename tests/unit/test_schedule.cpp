// SPDX-License-Identifier: MIT
// The firmware's schedule against triggers reckoned here, slot by slot, for random programs and swaps; and what it must
// notice: a trigger early, late, missing, or one too many.
// links: ols_firmware
#include "schedule.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <memory>
#include <random>
#include <vector>

namespace {

using Slots = std::vector<ols_slot>;

std::unique_ptr<sequence> sequence_of(const Slots& slots, uint32_t cycles, uint8_t skip_kinds, int32_t offset_ticks) {
    auto made = std::make_unique<sequence>();
    made->header.slot_count = uint16_t(slots.size());
    made->header.cycles = cycles;
    made->header.triggers[0].skip_kinds = skip_kinds;
    made->header.triggers[0].offset_ticks = offset_ticks;
    std::copy(slots.begin(), slots.end(), reinterpret_cast<ols_slot*>(made->words));
    return made;
}

Slots random_slots(std::mt19937& pick, int count, int one_in) {
    Slots slots;
    for (int n = 0; n < count; n++) {
        const int32_t offset_ticks = int32_t(pick() % 400) - 200;
        const uint8_t mask = uint8_t(pick() % 8 << 1 | (pick() % unsigned(one_in) == 0));
        slots.push_back({uint8_t(pick() % 4), mask, 0, 0, 200, 1300 + uint32_t(pick() % 100'000), offset_ticks});
    }
    return slots;
}

// Rises of `cycles` cycles from `begin_ticks` on, which is moved behind them.
void add_rises(const sequence& played, const Slots& slots, uint32_t cycles, int64_t& begin_ticks,
               std::vector<int64_t>& rises) {
    const ols_trigger trigger = played.header.triggers[0];
    for (uint32_t cycle = 0; cycle < cycles; cycle++)
        for (const ols_slot& slot : slots) {
            if ((slot.trigger_mask & 1) != 0 && (trigger.skip_kinds >> slot.kind & 1) == 0)
                rises.push_back(begin_ticks + slot.trigger_offset_ticks + trigger.offset_ticks);
            begin_ticks += slot.period_ticks;
        }
}

// The witness counts down every second tick; where its count begins, nobody knows.
uint32_t stamp_at(int64_t ticks) {
    return ~uint32_t(uint64_t(ticks + 1'000'000'017) / 2);
}

bool take(int64_t ticks) {
    const bool good = schedule_take(stamp_at(ticks));
    schedule_seek();
    return good;
}

TEST(Schedule, knows_every_trigger_of_random_programs_and_the_time_to_the_next) {
    std::mt19937 pick(1);
    for (int round = 0; round < 300; round++) {
        const Slots slots = random_slots(pick, 1 + int(pick() % 40), 1 + int(pick() % 6));
        const uint32_t cycles = 1 + uint32_t(pick() % 5);
        const auto played = sequence_of(slots, cycles, uint8_t(pick() % 16), int32_t(pick() % 200) - 100);
        std::vector<int64_t> rises;
        int64_t end_ticks = 0;
        add_rises(*played, slots, cycles, end_ticks, rises);
        schedule_begin(played.get(), false);
        for (size_t n = 0; n < rises.size(); n++) {
            ASSERT_TRUE(take(rises[n])) << "round " << round << ", trigger " << n;
            ASSERT_EQ(schedule_ticks_to_next(), n + 1 < rises.size() ? uint32_t(rises[n + 1] - rises[n]) : 0u);
        }
        EXPECT_EQ(schedule_taken(), rises.size());
        EXPECT_FALSE(take(end_ticks)) << "one too many";
    }
}

TEST(Schedule, follows_swaps_also_from_and_to_programs_that_never_trigger) {
    std::mt19937 pick(2);
    for (int round = 0; round < 300; round++) {
        std::vector<std::unique_ptr<sequence>> programs;
        std::vector<Slots> slots;
        std::vector<uint32_t> cycles;
        for (int n = 0; n < 4; n++) {
            slots.push_back(random_slots(pick, 1 + int(pick() % 12), 1 + int(pick() % 3)));
            cycles.push_back(3 + uint32_t(pick() % 4));
            if (pick() % 4 == 0)
                for (ols_slot& slot : slots.back()) slot.trigger_mask &= uint8_t(~1u);
            programs.push_back(sequence_of(slots.back(), n < 3 ? 0 : cycles.back(), 0, 0));
        }
        int64_t now_ticks = 0;
        schedule_begin(programs[0].get(), false);
        bool settle_due = false;  // since the swap that came last
        for (int n = 0; n < 4; n++) {
            std::vector<int64_t> rises;
            const int64_t begin_ticks = now_ticks;
            add_rises(*programs[size_t(n)], slots[size_t(n)], cycles[size_t(n)], now_ticks, rises);
            // The swap is announced in the third-last cycle, as player_swap does at the latest.
            const int64_t swap_ticks = now_ticks - 3 * (now_ticks - begin_ticks) / cycles[size_t(n)] + 300;
            bool announced = n == 3;
            for (const int64_t rise : rises) {
                const bool announces = !announced && rise >= swap_ticks;
                // Some time after the swap: before the first trigger, or after it, but before another swap.
                if (settle_due && (announces || rise > begin_ticks + (now_ticks - begin_ticks) / 8)) {
                    schedule_settle();
                    settle_due = false;
                }
                if (announces) {
                    schedule_swap(programs[size_t(n) + 1].get(), cycles[size_t(n)]);
                    announced = true;
                }
                ASSERT_TRUE(take(rise)) << "round " << round << ", program " << n << ", tick " << rise;
            }
            if (settle_due) schedule_settle();
            if (!announced) schedule_swap(programs[size_t(n) + 1].get(), cycles[size_t(n)]);
            settle_due = true;
        }
    }
}

TEST(Schedule, notices_the_very_trigger_that_is_off_by_more_than_the_tolerance_and_no_other) {
    std::mt19937 pick(3);
    for (int round = 0; round < 200; round++) {
        const Slots slots = random_slots(pick, 20, 1);
        const auto played = sequence_of(slots, 0, 0, 0);
        std::vector<int64_t> rises;
        int64_t end_ticks = 0;
        add_rises(*played, slots, 3, end_ticks, rises);
        const size_t wrong = 1 + pick() % (rises.size() - 1);
        const int64_t slip_ticks = (SCHEDULE_TOLERANCE_TICKS + 1 + int64_t(pick() % 1000)) * (pick() % 2 ? 1 : -1);
        const int64_t jitter_ticks = pick() % 2;  // a stamp is a floor to two ticks
        schedule_begin(played.get(), false);
        for (size_t n = 0; n < wrong; n++) ASSERT_TRUE(take(rises[n] + jitter_ticks * int64_t(n % 2)));
        EXPECT_FALSE(take(rises[wrong] + slip_ticks + (slip_ticks > 0 ? 1 : -1))) << slip_ticks;
    }
}

// One play of two triggers, the second off by `slip_ticks`; the first at an even or odd count of the witness.
bool passes(int64_t first_ticks, int64_t slip_ticks) {
    const Slots slots = {{OLS_BASIS, 1, 0, 0, 200, 5'000, 0}};
    const auto played = sequence_of(slots, 0, 0, 0);
    schedule_begin(played.get(), false);
    EXPECT_TRUE(take(first_ticks));
    return take(first_ticks + 5'000 + slip_ticks);
}

TEST(Schedule, lets_pass_what_an_echo_of_the_stated_cable_does_to_an_edge_and_nothing_a_tick_beyond_the_tolerance) {
    // 3 m of 5 ns there and back are 30 ns, 4 ticks of 8 ns.
    EXPECT_EQ(BOARD_CABLE_TRIGGER_ECHO_TICKS, 4);
    EXPECT_EQ(SCHEDULE_TOLERANCE_TICKS, 7);
    for (const int64_t first_ticks : {0, 1})
        for (const int64_t sign : {-1, 1})
            for (int64_t ticks = 0; ticks <= BOARD_CABLE_TRIGGER_ECHO_TICKS + 1; ticks++)
                EXPECT_TRUE(passes(first_ticks, sign * ticks)) << "late by the echo, and by the synchroniser's tick";
    // The witness begins to count at an odd tick of this test: from there stamps of an even distance are exact.
    EXPECT_TRUE(passes(1, SCHEDULE_TOLERANCE_TICKS));
    EXPECT_FALSE(passes(1, SCHEDULE_TOLERANCE_TICKS + 1));
    EXPECT_TRUE(passes(0, -SCHEDULE_TOLERANCE_TICKS));
    EXPECT_FALSE(passes(0, -SCHEDULE_TOLERANCE_TICKS - 1));
}

TEST(Schedule, begins_anew_with_each_cycle_that_waits_but_holds_within_it) {
    std::mt19937 pick(4);
    for (int round = 0; round < 200; round++) {
        const Slots slots = random_slots(pick, 2 + int(pick() % 20), 1);
        const auto played = sequence_of(slots, 0, 0, 0);
        schedule_begin(played.get(), true);
        int64_t begin_ticks = 0;
        for (int cycle = 0; cycle < 4; cycle++) {
            std::vector<int64_t> rises;
            add_rises(*played, slots, 1, begin_ticks, rises);
            for (size_t n = 0; n < rises.size(); n++) {
                const bool slips = cycle == 3 && n + 1 == rises.size();
                ASSERT_EQ(take(rises[n] + (slips ? SCHEDULE_TOLERANCE_TICKS + 3 : 0)), !slips)
                    << "round " << round << ", cycle " << cycle;
                ASSERT_EQ(schedule_ticks_to_next(), n + 1 < rises.size() ? uint32_t(rises[n + 1] - rises[n]) : 0u)
                    << "nothing is due while an edge is waited for";
            }
            begin_ticks += pick() % 2 ? int64_t(pick() % 100'000) : int64_t(pick()) * 3;  // more than 32 bits of ticks
        }
    }
}

TEST(Schedule, notices_a_trigger_that_has_been_left_out) {
    const Slots slots = {{OLS_BASIS, 1, 0, 0, 200, 5'000, 0}, {OLS_BASIS, 1, 0, 0, 200, 6'000, 0}};
    const auto played = sequence_of(slots, 0, 0, 0);
    schedule_begin(played.get(), false);
    EXPECT_TRUE(take(0));
    EXPECT_EQ(schedule_ticks_to_next(), 5'000u);
    EXPECT_FALSE(take(11'000));
}

TEST(Schedule, gives_no_time_to_a_trigger_that_32_bits_of_ticks_do_not_reach) {
    const Slots slots = {{OLS_BASIS, 1, 0, 0, 200, 3'000'000'000, 0}, {OLS_BASIS, 0, 0, 0, 200, 3'000'000'000, 0}};
    const auto played = sequence_of(slots, 0, 0, 0);
    schedule_begin(played.get(), false);
    EXPECT_TRUE(take(0));
    EXPECT_EQ(schedule_ticks_to_next(), 0u);
    EXPECT_TRUE(take(6'000'000'000)) << "and yet it is known";
    EXPECT_FALSE(take(12'000'000'010));
}

}  // namespace

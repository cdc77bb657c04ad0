// SPDX-License-Identifier: MIT
// The firmware's trigger log: which slot a trigger was, when it rose, and what is told when some are missed.
// links: ols_firmware
#include "trigger_log.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <initializer_list>
#include <memory>
#include <vector>

#include "cycle_digest.h"
#include "schedule.h"

namespace {

constexpr uint64_t first_rise = 20;  // ticks after start

std::unique_ptr<sequence> sequence_of(std::initializer_list<ols_slot> slots) {
    auto made = std::make_unique<sequence>();
    made->header.slot_count = uint16_t(slots.size());
    std::copy(slots.begin(), slots.end(), reinterpret_cast<ols_slot*>(made->words));
    return made;
}

ols_slot slot(uint8_t trigger_mask, uint32_t period_ticks, int32_t offset_ticks = 0) {
    return {OLS_BASIS, trigger_mask, 0, 0, 1000, period_ticks, offset_ticks};
}

// Slot 2 does not fire TRIG0.
std::unique_ptr<sequence> sequence_of_four() {
    return sequence_of({slot(1, 50'000), slot(3, 60'000), slot(2, 70'000), slot(1, 80'000)});
}

uint32_t stamp_at(uint64_t ticks) {
    return ~uint32_t(ticks / 2);
}

std::vector<ols_trigger_log_entry> read_all(uint32_t first, ols_trigger_log_reply& header) {
    std::vector<ols_trigger_log_entry> entries(4096);
    trigger_log_read(first, 4096, &header, entries.data());
    entries.resize(header.entry_count);
    return entries;
}

TEST(TriggerLog, names_the_slot_and_cycle_of_each_trigger) {
    const auto played = sequence_of_four();
    trigger_log_begin(played.get(), false);
    EXPECT_EQ(trigger_log_slot(), OLS_NO_SLOT);
    const uint64_t rises[] = {0, 50'000, 180'000, 260'000, 310'000, 440'000};
    for (const uint64_t rise : rises) EXPECT_TRUE(trigger_log_add(stamp_at(first_rise + rise), rise + 9000));
    ols_trigger_log_reply header;
    const auto entries = read_all(0, header);
    ASSERT_EQ(entries.size(), 6u);
    const uint16_t slots[] = {0, 1, 3, 0, 1, 3};
    for (uint32_t n = 0; n < 6; n++) {
        EXPECT_EQ(entries[n].counter, n);
        EXPECT_EQ(entries[n].slot, slots[n]);
        EXPECT_EQ(entries[n].cycle, n / 3);
        EXPECT_EQ(uint64_t(entries[n].rise_ticks), first_rise + rises[n]);  // it is not aligned
    }
    EXPECT_EQ(entries[1].trigger_mask, 3);
}

constexpr int64_t beyond_ticks = SCHEDULE_TOLERANCE_TICKS + 1;

TEST(TriggerLog, lets_an_echo_of_the_cable_pass) {
    for (const int64_t slip : {-BOARD_CABLE_TRIGGER_ECHO_TICKS, +BOARD_CABLE_TRIGGER_ECHO_TICKS}) {
        const auto played = sequence_of_four();
        trigger_log_begin(played.get(), false);
        EXPECT_TRUE(trigger_log_add(stamp_at(20), 30));
        EXPECT_TRUE(trigger_log_add(stamp_at(uint64_t(50'020 + slip)), 50'030)) << slip;
    }
}

TEST(TriggerLog, notices_a_trigger_that_is_not_where_it_was_scheduled) {
    for (const int64_t slip : {int64_t(-1000), -beyond_ticks, beyond_ticks, int64_t(1000)}) {
        const auto played = sequence_of_four();
        trigger_log_begin(played.get(), false);
        EXPECT_TRUE(trigger_log_add(stamp_at(20), 30));
        EXPECT_TRUE(trigger_log_add(stamp_at(50'020 + 2), 50'030)) << "the stamp's resolution is no slip";
        EXPECT_FALSE(trigger_log_add(stamp_at(uint64_t(180'020 + slip)), 180'030)) << slip;
    }
}

TEST(TriggerLog, expects_each_trigger_at_its_own_offset) {
    const auto played = sequence_of({slot(1, 50'000, -4000), slot(3, 60'000, 2500), slot(2, 70'000), slot(1, 80'000)});
    trigger_log_begin(played.get(), false);
    EXPECT_TRUE(trigger_log_add(stamp_at(20), 30));
    EXPECT_TRUE(trigger_log_add(stamp_at(20 + 50'000 + 6500), 60'000));
    EXPECT_FALSE(trigger_log_add(stamp_at(20 + 180'000), 190'000)) << "that one is due at 184 000";
}

TEST(TriggerLog, notices_slow_drift_though_no_single_period_is_off) {
    const auto played = sequence_of_four();
    trigger_log_begin(played.get(), false);
    bool on_time = true;
    uint64_t rise = 20, n = 0;
    for (const uint64_t periods[] = {50'000, 130'000, 80'000}; on_time && n < 20; n++) {
        on_time = trigger_log_add(stamp_at(rise), rise + 50);
        rise += periods[n % 3] + 1;
    }
    EXPECT_FALSE(on_time);
    EXPECT_LE(n, SCHEDULE_TOLERANCE_TICKS + 3u) << "a tick each, a tick of the stamp, and the one that is beyond";
}

TEST(TriggerLog, cycles_that_wait_may_begin_at_any_time_but_not_slip_within) {
    const auto played = sequence_of_four();
    trigger_log_begin(played.get(), true);
    const uint64_t begins[] = {20, 300'000, 123'456'790};
    ols_digests_reply digests;
    ols_cycle_digest digest;
    for (uint32_t n = 0; n < 3; n++) {
        const uint64_t begin = begins[n];
        for (const uint64_t rise : {0, 50'000, 180'000})
            EXPECT_TRUE(trigger_log_add(stamp_at(begin + rise), begin + rise + 100)) << begin << " " << rise;
        cycle_digest_read(n, 1, &digests, &digest);
        ASSERT_EQ(digests.digest_count, 1) << "made with the cycle's last trigger, whenever the next one may come";
        EXPECT_EQ(digest.cycle, n);
        EXPECT_EQ(digest.trigger_count, 3);
        EXPECT_EQ(digest.flags, 0);
    }
    const uint64_t late = 200'000'000;
    EXPECT_TRUE(trigger_log_add(stamp_at(late), late));
    EXPECT_FALSE(trigger_log_add(stamp_at(late + 50'000 + uint64_t(beyond_ticks)), late + 50'100));
    ols_trigger_log_reply header;
    const auto entries = read_all(0, header);
    EXPECT_EQ(entries[6].rise_ticks, begins[2]);
    EXPECT_EQ(entries[6].cycle, 2u);
}

TEST(TriggerLog, rise_times_outlast_the_wrap_of_the_stamps) {
    const auto slow = sequence_of({slot(1, 4'000'000'001u)});  // 32 s; the stamps wrap every 68.7 s
    trigger_log_begin(slow.get(), false);
    for (uint64_t n = 0; n < 20; n++) {
        const uint64_t rise = first_rise + n * 4'000'000'001u;
        EXPECT_TRUE(trigger_log_add(stamp_at(rise), rise + (n % 5) * 500'000'000));  // read up to 16 s late
        ols_trigger_log_reply header;
        ols_trigger_log_entry entry;
        trigger_log_read(uint32_t(n), 1, &header, &entry);
        EXPECT_EQ(entry.rise_ticks, rise / 2 * 2);
    }
}

TEST(TriggerLog, what_the_host_did_not_read_in_time_is_counted_as_lost) {
    const auto fast = sequence_of({slot(1, 2000)});
    trigger_log_begin(fast.get(), false);
    auto fire = [&, n = uint64_t(0)](int count) mutable {
        for (; count > 0; count--, n++) ASSERT_TRUE(trigger_log_add(stamp_at(n * 2000), n * 2000));
    };
    fire(1024);
    ols_trigger_log_reply header;
    EXPECT_EQ(read_all(0, header).size(), 1024u);
    fire(1024);
    EXPECT_EQ(trigger_log_lost(), 0u) << "all of the first 1024 had been read";
    fire(100);
    EXPECT_EQ(trigger_log_lost(), 100u);
    const auto entries = read_all(1024, header);
    EXPECT_EQ(header.first_counter, 1124u);
    EXPECT_EQ(header.next_counter, 2148u);
    EXPECT_EQ(entries.front().counter, 1124u);
}

TEST(TriggerLog, skipped_stamps_are_lost_but_the_slots_after_them_are_right) {
    const auto played = sequence_of_four();
    trigger_log_begin(played.get(), false);
    EXPECT_TRUE(trigger_log_add(stamp_at(20), 20));
    trigger_log_skip(3);  // slots 1, 3, 0
    EXPECT_TRUE(trigger_log_add(stamp_at(20 + 310'000), 310'000));
    EXPECT_EQ(trigger_log_slot(), 1);
    EXPECT_EQ(trigger_log_cycle(), 1u);
    EXPECT_EQ(trigger_log_fired(), 5u);
    EXPECT_EQ(trigger_log_lost(), 4u) << "three never read from the witness, one never read by the host";
    ols_trigger_log_reply header;
    const auto entries = read_all(0, header);
    ASSERT_EQ(entries.size(), 1u);
    EXPECT_EQ(entries[0].counter, 4u);
}

TEST(TriggerLog, reading_past_the_end_gives_nothing) {
    const auto played = sequence_of_four();
    trigger_log_begin(played.get(), false);
    EXPECT_TRUE(trigger_log_add(stamp_at(20), 20));
    ols_trigger_log_reply header;
    EXPECT_TRUE(read_all(7, header).empty());
    EXPECT_EQ(header.next_counter, 1u);
}

TEST(TriggerLog, follows_a_swap_to_the_next_program_at_its_cycle) {
    const auto first = sequence_of_four();
    const auto second = sequence_of({slot(1, 30'000), slot(1, 40'000)});
    trigger_log_begin(first.get(), false);
    EXPECT_TRUE(trigger_log_add(stamp_at(20), 20));
    trigger_log_swap(second.get(), 1);
    for (const uint64_t rise : {50'000, 180'000, 260'000, 290'000, 330'000})
        EXPECT_TRUE(trigger_log_add(stamp_at(20 + rise), rise + 100)) << rise;
    ols_trigger_log_reply header;
    const auto entries = read_all(0, header);
    ASSERT_EQ(entries.size(), 6u);
    const uint16_t slots[] = {0, 1, 3, 0, 1, 0}, programs[] = {0, 0, 0, 1, 1, 1}, cycles[] = {0, 0, 0, 0, 0, 1};
    for (int n = 0; n < 6; n++) {
        EXPECT_EQ(entries[n].slot, slots[n]);
        EXPECT_EQ(entries[n].program, programs[n]);
        EXPECT_EQ(entries[n].cycle, cycles[n]);
    }
}

TEST(TriggerLog, a_program_without_watched_triggers_is_passed_on_the_way_to_the_next) {
    const auto silent = sequence_of({slot(2, 50'000), slot(2, 50'000)});
    const auto second = sequence_of({slot(1, 30'000)});
    trigger_log_begin(silent.get(), false);
    trigger_log_swap(second.get(), 3);
    EXPECT_TRUE(trigger_log_add(stamp_at(300'020), 300'100));
    EXPECT_TRUE(trigger_log_add(stamp_at(330'020), 330'100));
    EXPECT_EQ(trigger_log_cycle(), 1u);
    trigger_log_begin(silent.get(), false);
    EXPECT_FALSE(trigger_log_add(stamp_at(20), 20)) << "without a swap, it is a trigger that nobody asked for";
}

}  // namespace

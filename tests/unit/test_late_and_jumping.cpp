// SPDX-License-Identifier: MIT
// Frames that come far too late, stamps that are wrong alike, clocks that jump by whole cycles: what costs its own slot must cost no
// more, and what looks like another slot's must not be taken for it.
// links: ols_record
#include <gtest/gtest.h>

#include "synthetic_take.hpp"

using namespace ols;
using namespace ols::test;

namespace {

class LateAndJumping : public testing::Test {
  protected:
    // The frame of trigger n comes behind `by` later ones.
    void delay(uint64_t n, ptrdiff_t by) {
        const auto at = std::ranges::find_if(take_.frames, [n](const Delivery& frame) { return frame.lit_by == n; });
        std::rotate(at, at + 1, at + by + 1);
    }
    void jump_clock(uint64_t from, int64_t ns) {
        for (size_t n = from; n < take_.frames.size(); ++n) take_.frames[n].witness.stamp.timestamp_ns += uint64_t(ns);
    }
    Outcome outcome(size_t poll = 13) { return play(take_, stage_.sequence, poll); }

    SyntheticStage stage_{"single", 4};
    Take take_ = record(stage_);
    const uint64_t cycle_ns_ = uint64_t(double(stage_.sequence.cycle_ticks()) * 8 * (1 + clock_drift));
};

}  // namespace

TEST_F(LateAndJumping, neighbours_that_come_far_too_late_cost_their_own_slots_and_are_no_restart) {
    for (const uint64_t n : {0u, 220u, 221u, 222u, 223u, 224u}) delay(n, 60);
    const Outcome late = outcome();
    EXPECT_EQ(late.missing, (std::set<uint64_t>{0, 220, 221, 222, 223, 224}));
    for (const uint64_t n : {220u, 224u}) EXPECT_EQ(late.notes.at(n).why.cause, Cause::link_lost_it);
    EXPECT_EQ(late.discarded.of(Cause::link_lost_it), 6u);
    EXPECT_EQ(late.mislabelled, 0);
}

TEST_F(LateAndJumping, neighbours_with_stamps_that_are_wrong_alike_cost_their_own_slots_and_came) {
    const std::set<uint64_t> struck = {300, 301, 302};
    for (const uint64_t n : struck) take_.frames[n].witness.stamp.timestamp_ns += 150'000;
    take_.frames.erase(take_.frames.begin() + 303);  // a loss beside them stays one
    const Outcome wrong = outcome();
    EXPECT_EQ(wrong.missing, (std::set<uint64_t>{300, 301, 302, 303}));
    for (const uint64_t n : struck) EXPECT_EQ(wrong.notes.at(n).why.text, "its time fits no trigger") << n;
    EXPECT_EQ(wrong.notes.at(303).why.cause, Cause::link_lost_it);
}

TEST_F(LateAndJumping, a_clock_that_jumps_by_whole_groups_or_cycles_moves_no_frame_into_another) {
    const Take whole = take_;
    for (const int64_t groups : {1, 3, 10, 20, -1, -10})
        for (const uint64_t from : {200u, 290u, 361u}) {
            SCOPED_TRACE(std::to_string(groups) + " groups at " + std::to_string(from));
            take_ = whole;
            jump_clock(from, groups * int64_t(cycle_ns_) / 10);
            const Outcome jumped = outcome();
            EXPECT_EQ(jumped.mislabelled, 0);
            EXPECT_TRUE(jumped.accounted);
            EXPECT_LT(jumped.missing.size(), 40u);
            EXPECT_EQ(outcome(100).mislabelled, 0) << "also where the board's log comes late";
        }
}

TEST_F(LateAndJumping, a_clock_that_is_ahead_of_what_the_board_has_fired_is_not_believed) {
    // By a whole group and one more: the landmarks tell, but they come late.
    jump_clock(200, 19 * int64_t(cycle_ns_ / stage_.sequence.slots.size()));
    const Outcome jumped = outcome();
    EXPECT_EQ(jumped.mislabelled, 0);
    EXPECT_LT(jumped.missing.size(), 20u);
}

TEST_F(LateAndJumping, a_count_that_passes_more_ids_than_there_were_triggers_is_not_believed_with_its_clock) {
    // The link loses a group and one more, and the clock goes back by the group: by its times nothing is missing.
    take_.frames.erase(take_.frames.begin() + 201, take_.frames.begin() + 220);
    jump_clock(201, -19 * int64_t(cycle_ns_ / stage_.sequence.slots.size()));
    EXPECT_EQ(outcome().mislabelled, 0);
}

// Four in a row fit each other, ids as times, and lie further apart than the sequence is long: no stretch is made of them.
TEST_F(LateAndJumping, strays_that_step_beyond_the_sequence_in_ids_and_times_are_no_stretch) {
    constexpr uint64_t far = 1'000'000'000;
    const auto period_ns = uint64_t(cycle_ns_ / stage_.sequence.slots.size());
    for (uint64_t n = 300; n < 304; ++n) {
        CameraStamp& stamp = take_.frames[n].witness.stamp;
        stamp.frame_id += far * (n - 299), stamp.timestamp_ns += far * (n - 299) * period_ns;
    }
    const Outcome far_off = outcome();
    EXPECT_EQ(far_off.mislabelled, 0);
    EXPECT_TRUE(far_off.accounted);
    for (uint64_t n = 300; n < 304; ++n) EXPECT_TRUE(far_off.missing.contains(n)) << n;
}

TEST_F(LateAndJumping, what_is_wrong_with_a_frame_itself_is_its_cause_where_its_run_is_not_proved) {
    take_.frames[212].witness.unfit = {Cause::stale, "stale"};
    take_.frames[216].witness.summary = take_.frames[220].witness.summary;  // a tracking slot that looks like a lamp
    const Outcome unproved = outcome();
    EXPECT_EQ(unproved.notes.at(212).why.cause, Cause::stale);
    EXPECT_EQ(unproved.notes.at(213).why.cause, Cause::not_proved);
}

TEST_F(LateAndJumping, a_matte_slot_without_light_tells_of_the_lamps_as_a_tracking_slot_does) {
    const uint64_t matte = find_slot(stage_.sequence, SlotKind::matte, 1, 3);
    take_.frames[matte].witness.summary =
        take_.frames[find_slot(stage_.sequence, SlotKind::dark, 0, 0)].witness.summary;
    EXPECT_EQ(outcome().notes.at(matte).why.cause, Cause::no_light);
}

// SPDX-License-Identifier: MIT
// Identification against every fault, in every kind of slot. The truth, which trigger a frame's light came from, is kept
// beside the frames where the code under test cannot see it: whatever goes wrong, no frame may be mislabelled.
// links: ols_record
#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <random>
#include <set>

#include "synthetic_take.hpp"

using namespace ols;
using namespace ols::test;

namespace {

std::set<uint64_t> range(uint64_t first, uint64_t end) {
    std::set<uint64_t> set;
    for (; first < end; ++first) set.insert(first);
    return set;
}

// The last slot before trigger n that looks like no basis slot. Here a quarter of the single lamps look dark, and rows
// of a multiplexed basis look like tracking: half of the lamps for 100 us against all of them for 50.
uint64_t proof_before(const Sequence& sequence, uint64_t n) {
    const SlotKind mistakable = sequence.basis.name == "single" ? SlotKind::dark : SlotKind::tracking;
    SlotKind kind;
    do kind = sequence.slots[--n % sequence.slots.size()].kind;
    while (kind == SlotKind::basis || kind == mistakable);
    return n;
}

// Frames before the first dark slot prove their place only together with what follows.
bool can_stand_alone(const Sequence& sequence, uint64_t frames) {
    return frames > find_slot(sequence, SlotKind::dark, 0, 0);
}

// The slots that must be missing; nothing where only mislabelling is ruled out.
using Expected = std::optional<std::set<uint64_t>>;

struct Fault {
    const char* name;
    std::function<void(Take&, uint64_t n)> spoil;
    std::function<Expected(const Sequence&, uint64_t n)> expect;
};

Expected nothing(const Sequence&, uint64_t) {
    return std::set<uint64_t>{};
}
Expected only_it(const Sequence&, uint64_t n) {
    return std::set<uint64_t>{n};
}

void restart_camera(Take& take, uint64_t n, bool reset_clock) {
    const uint64_t id = take.frames[n].witness.stamp.frame_id - 1;
    const uint64_t back_ns = reset_clock ? take.frames[n].witness.stamp.timestamp_ns - 123'456 : 0;
    for (size_t i = n; i < take.frames.size(); ++i) {
        take.frames[i].witness.stamp.frame_id -= id;
        take.frames[i].witness.stamp.timestamp_ns -= back_ns;
    }
}

const Fault faults[] = {
    {"none", [](Take&, uint64_t) {}, nothing},
    {"dropped frame", [](Take& t, uint64_t n) { t.frames.erase(t.frames.begin() + ptrdiff_t(n)); }, only_it},
    {"dropped trigger",
     [](Take& t, uint64_t n) {
         for (size_t i = n + 1; i < t.frames.size(); ++i) --t.frames[i].witness.stamp.frame_id;
         t.frames.erase(t.frames.begin() + ptrdiff_t(n));
     },
     only_it},
    {"duplicate",
     [](Take& t, uint64_t n) { t.frames.insert(t.frames.begin() + ptrdiff_t(n) + 3, Delivery(t.frames[n])); }, nothing},
    {"late by ten frames",
     [](Take& t, uint64_t n) {
         const auto at = t.frames.begin() + ptrdiff_t(n);
         std::rotate(at, at + 1, at + 11);
     },
     nothing},
    {"late beyond the window",
     [](Take& t, uint64_t n) {
         const auto at = t.frames.begin() + ptrdiff_t(n);
         std::rotate(at, at + 1, at + 40);
     },
     only_it},
    {"swapped", [](Take& t, uint64_t n) { std::swap(t.frames[n], t.frames[n + 1]); }, nothing},
    {"wrong size",
     [](Take& t, uint64_t n) {
         t.frames[n].witness.unfit = {Cause::wrong_size, "its size"};
     },
     only_it},
    {"bad timestamp", [](Take& t, uint64_t n) { t.frames[n].witness.stamp.timestamp_ns += 150'000; }, only_it},
    {"log entry lost", [](Take& t, uint64_t n) { t.log.erase(t.log.begin() + ptrdiff_t(n)); }, only_it},
    {"log entry of another slot", [](Take& t, uint64_t n) { ++t.log[n].slot; }, only_it},
    {"log entry of another time", [](Take& t, uint64_t n) { t.log[n].rise_ticks += 100; }, only_it},
    {"camera restarted, clock kept", [](Take& t, uint64_t n) { restart_camera(t, n, false); }, nothing},
    {"camera restarted, clock reset", [](Take& t, uint64_t n) { restart_camera(t, n, true); },
     [](const Sequence& s, uint64_t n) { return can_stand_alone(s, n) ? range(0, 0) : range(0, n); }},
    {"camera restarted, three frames lost",
     [](Take& t, uint64_t n) {
         restart_camera(t, n + 3, false);
         t.frames.erase(t.frames.begin() + ptrdiff_t(n), t.frames.begin() + ptrdiff_t(n) + 3);
     },
     [](const Sequence&, uint64_t n) { return range(n, n + 3); }},
    {"board reset",
     [](Take& t, uint64_t n) {
         t.frames.resize(n);
         t.log.resize(n);
         t.log_end = {Cause::board_gone, "the board was reset"};
     },
     // The light of the last trigger that it told of may have been cut off.
     [](const Sequence& s, uint64_t n) { return range(can_stand_alone(s, n) ? n - 1 : 0, s.trigger_count()); }},
    // Stamps go on and pixels come one frame late: only the optical code can tell, and only at landmarks.
    {"pixels one frame behind their stamps",
     [](Take& t, uint64_t n) {
         for (size_t i = t.frames.size() - 1; i >= n; --i) {
             t.frames[i].witness.summary = t.frames[i - 1].witness.summary;
             t.frames[i].lit_by = t.frames[i - 1].lit_by;
         }
     },
     [](const Sequence& s, uint64_t n) -> Expected {
         if (n < s.slots.size()) return std::nullopt;  // before the lock: whichever side of the shift is proved first
         return range(proof_before(s, n) + 1, s.trigger_count());
     }},
};

class IdentifyFaults : public testing::TestWithParam<const char*> {};

}  // namespace

TEST_P(IdentifyFaults, leave_the_expected_slots_missing_in_every_kind_of_slot_and_never_a_mislabelled_frame) {
    SyntheticStage stage(GetParam(), 3);
    const Take clean = record(stage);
    const bool one_dark = std::string(GetParam()) == "s159";
    for (const Fault& fault : faults)
        for (const SlotKind kind : {SlotKind::tracking, SlotKind::matte, SlotKind::dark, SlotKind::basis})
            for (const int cycle : {0, 1}) {
                const uint64_t n = find_slot(stage.sequence, kind, cycle, one_dark && kind == SlotKind::dark ? 0 : 2);
                Take take = clean;
                fault.spoil(take, n);
                const Outcome outcome = play(take, stage.sequence);
                SCOPED_TRACE(std::string(fault.name) + " in " + slot_kind_name(kind) + " slot, trigger " +
                             std::to_string(n));
                EXPECT_EQ(outcome.mislabelled, 0);
                EXPECT_TRUE(outcome.accounted);
                const Expected expected = fault.expect(stage.sequence, n);
                EXPECT_EQ(outcome.missing, expected.value_or(outcome.missing));
            }
}

INSTANTIATE_TEST_SUITE_P(Bases, IdentifyFaults, testing::Values("single", "s159", "hadamard156"));

TEST(Identify, the_last_light_of_a_board_that_is_stopped_may_have_been_cut_off) {
    SyntheticStage stage("single", 3);
    Take take = record(stage);
    const uint64_t last = find_slot(stage.sequence, SlotKind::basis, 1, 7);
    take.frames.resize(last + 1);
    take.log.resize(last + 1);
    take.log_end = {Cause::stopped, "stopped by you"};
    const Outcome stopped = play(take, stage.sequence);
    EXPECT_EQ(stopped.missing, range(last, take.triggers));
    EXPECT_EQ(stopped.notes.at(last).why, (Reason{Cause::stopped, "its light may have been cut off: stopped by you"}));
    EXPECT_EQ(stopped.notes.at(last + 1).why, take.log_end);
    // It fired once more, and that frame was lost: this one had all of its light.
    take.log.push_back(record(stage).log[last + 1]);
    EXPECT_EQ(play(take, stage.sequence).missing, range(last + 1, take.triggers));
}

TEST(Identify, a_camera_that_is_gone_is_why_its_later_frames_are_missing_and_not_why_an_earlier_one_is) {
    SyntheticStage stage("single", 3);
    Take take = record(stage);
    const uint64_t lost = find_slot(stage.sequence, SlotKind::basis, 1, 7);
    const uint64_t last = find_slot(stage.sequence, SlotKind::tracking, 2, 4);
    take.frames.resize(last + 1);
    take.frames.erase(take.frames.begin() + ptrdiff_t(lost));
    take.frames_end = {Cause::camera_gone, "the camera is gone"};
    const Outcome outcome = play(take, stage.sequence);
    auto expected = range(last + 1, take.triggers);
    expected.insert(lost);
    EXPECT_EQ(outcome.missing, expected);
    EXPECT_EQ(outcome.notes.at(last + 1).why, take.frames_end);
    EXPECT_EQ(outcome.notes.at(take.triggers - 1).why, take.frames_end);
    EXPECT_EQ(outcome.notes.at(lost).why.cause, Cause::link_lost_it);
}

TEST(Identify, an_unfit_frame_costs_its_own_slot_whatever_it_looks_like) {
    SyntheticStage stage("single", 3);
    const Take clean = record(stage);
    const auto& slots = stage.sequence.slots;
    for (const SlotKind kind : {SlotKind::tracking, SlotKind::matte, SlotKind::dark, SlotKind::basis}) {
        size_t slot = 40;
        while (slots[slot].kind != kind) ++slot;
        const size_t trigger = slots.size() + slot;
        Take take = clean;
        take.frames[trigger].witness.unfit = {Cause::stale, "stale"};
        take.frames[trigger].witness.summary = take.frames[trigger - 1].witness.summary;
        const Outcome outcome = play(take, stage.sequence);
        EXPECT_EQ(outcome.missing, std::set<uint64_t>{trigger}) << slot_kind_name(kind);
        EXPECT_EQ(outcome.notes.at(trigger).why.cause, Cause::stale);
        EXPECT_TRUE(outcome.notes.at(trigger).board && outcome.notes.at(trigger).camera && outcome.accounted);
        EXPECT_EQ(outcome.mislabelled, 0);
    }
}

TEST(Identify, duplicates_are_counted) {
    SyntheticStage stage("single", 2);
    Take take = record(stage);
    for (const size_t n : {5u, 40u, 200u}) take.frames.insert(take.frames.begin() + n, Delivery(take.frames[n - 1]));
    const Outcome outcome = play(take, stage.sequence);
    EXPECT_EQ(outcome.duplicates, 3);
    EXPECT_TRUE(outcome.missing.empty());
}

TEST(Identify, a_missing_slot_tells_which_witnesses_it_had) {
    SyntheticStage stage("single", 2);
    Take take = record(stage);
    take.frames[216].witness.summary = take.frames[220].witness.summary;  // a tracking slot that looks like a lamp
    take.frames[50].witness.unfit = {Cause::wrong_size, "its size"};
    take.frames.erase(take.frames.begin() + 100);
    take.log.erase(take.log.begin() + 150);
    const Outcome outcome = play(take, stage.sequence);
    const auto& notes = outcome.notes;
    EXPECT_TRUE(notes.at(50).board && notes.at(50).camera);
    EXPECT_EQ(notes.at(50).why.cause, Cause::wrong_size);
    EXPECT_EQ(notes.at(216).optical, Sight::disagrees);
    EXPECT_TRUE(notes.at(100).board && !notes.at(100).camera);
    EXPECT_EQ(notes.at(100).why.cause, Cause::link_lost_it);
    EXPECT_TRUE(!notes.at(150).board && notes.at(150).camera);
    // The landmark that looks wrong takes down its own group's tail, back to the matte slot before it.
    auto expected = range(200, 217);
    expected.insert({50, 100, 150});
    EXPECT_EQ(outcome.missing, expected);
}

TEST(Identify, a_bad_landmark_in_the_first_cycle_costs_the_frames_up_to_it) {
    SyntheticStage stage("single", 2);
    Take take = record(stage);
    take.frames[36].witness.summary = take.frames[40].witness.summary;
    const Outcome outcome = play(take, stage.sequence);
    EXPECT_EQ(outcome.mislabelled, 0);
    EXPECT_EQ(outcome.missing, range(0, 54));
}

TEST(Identify, the_verdicts_do_not_depend_on_when_the_log_is_read) {
    SyntheticStage stage("single", 3);
    Take take = record(stage);
    restart_camera(take, 217, true);
    take.frames.erase(take.frames.begin() + 100);
    const Outcome often = play(take, stage.sequence, 1);
    EXPECT_EQ(often.missing, (std::set<uint64_t>{100}));
    for (const size_t poll : {7u, 45u, 130u}) EXPECT_EQ(play(take, stage.sequence, poll, 20).missing, often.missing);
}

TEST(Identify, a_camera_that_comes_in_late_is_placed_by_the_optical_code) {
    SyntheticStage stage("single", 3);
    for (const size_t late : {1u, 18u, 54u, 179u}) {
        Take take = record(stage);
        take.frames.erase(take.frames.begin(), take.frames.begin() + ptrdiff_t(late));
        for (Delivery& frame : take.frames) frame.witness.stamp.frame_id -= late;
        const Outcome outcome = play(take, stage.sequence);
        EXPECT_EQ(outcome.mislabelled, 0);
        EXPECT_EQ(outcome.missing, range(0, late)) << late;
    }
}

TEST(Identify, a_camera_that_misses_a_whole_cycle_at_the_start_is_not_believed) {
    SyntheticStage stage("single", 3);
    Take take = record(stage);
    take.frames.erase(take.frames.begin(), take.frames.begin() + 180);
    EXPECT_EQ(play(take, stage.sequence).missing, range(0, 540));
}

TEST(Identify, the_time_since_the_start_tells_the_cycle_where_the_board_has_played_on) {
    SyntheticStage stage("s159", 4);
    const Take take = record(stage);
    const auto played = [&](const Take& some, uint64_t camera_ns_at_start) {
        IdentifyOptions options;
        options.camera_ns_at_start = camera_ns_at_start;
        return play(some, stage.sequence, 13, 0, options, true);
    };
    EXPECT_FALSE(played(take, 0).missing.empty());  // any cycle could be the first
    EXPECT_EQ(played(take, clock_offset_ns).missing, std::set<uint64_t>());
    // Known a cycle too early it is of no use, and does no harm.
    const uint64_t early_ns = clock_offset_ns - 100'000'000;
    EXPECT_EQ(played(take, early_ns).mislabelled, 0);
    EXPECT_FALSE(played(take, early_ns).missing.empty());
    // Nor when the first cycle is lost.
    Take late = take;
    late.frames.erase(late.frames.begin(), late.frames.begin() + 180);
    EXPECT_EQ(played(late, clock_offset_ns).mislabelled, 0);
}

TEST(Identify, frames_that_could_be_of_either_of_two_places_are_missing) {
    // Twenty frames of one group, between two restarts that reset the clock: every group looks alike without its dark
    // slot, and the board's bound admits several.
    SyntheticStage stage("single", 3);
    Take take = record(stage);
    restart_camera(take, 220, true);
    take.frames.resize(238);
    const Outcome outcome = play(take, stage.sequence);
    EXPECT_EQ(outcome.mislabelled, 0);
    EXPECT_EQ(outcome.missing, range(220, 540));
}

TEST(Identify, random_storms_of_faults_never_mislabel_a_frame) {
    SyntheticStage stage("single", 3);
    const Take clean = record(stage);
    std::mt19937 random(7);
    for (int storm = 0; storm < 60; ++storm) {
        Take take = clean;
        for (int i = 0; i < 12; ++i) {
            const Fault& fault = faults[random() % (std::size(faults) - 1)];
            if (take.frames.size() < 300 || std::string(fault.name) == "board reset") continue;
            const uint64_t n = 60 + random() % (take.frames.size() - 120);
            if (n < take.log.size()) fault.spoil(take, n);
        }
        const Outcome outcome = play(take, stage.sequence);
        EXPECT_EQ(outcome.mislabelled, 0) << "storm " << storm;
        EXPECT_TRUE(outcome.accounted) << "storm " << storm;
    }
}

TEST(Identify, an_unsteady_subject_keeps_its_lock) {
    // Brightness that wanders by a third over a cycle: each landmark is compared with the one before it.
    SyntheticStage stage("single", 3);
    Take take = record(stage);
    for (size_t n = 0; n < take.frames.size(); ++n)
        for (float& block : take.frames[n].witness.summary.blocks)
            block *= float(1 + 0.33 * std::sin(2 * M_PI * double(n) / 180));
    const Outcome outcome = play(take, stage.sequence);
    EXPECT_EQ(outcome.mislabelled, 0);
    EXPECT_TRUE(outcome.missing.empty());
}

TEST(TriggerGrid, drift_is_measured_and_times_between_triggers_are_refused) {
    const double period_ns = 462'960, drift = 40e-6;
    const auto time = [&](uint64_t n) { return uint64_t(5e9 + double(n) * period_ns * (1 + drift)); };
    TriggerGrid grid(period_ns, time(0), 180);
    for (uint64_t n = 1; n <= 400; ++n) {
        ASSERT_EQ(grid.steps_to(time(n)), 1u);
        grid.advance(1, time(n));
    }
    EXPECT_NEAR(grid.drift_ppm(), 40, 0.1);
    // A pause of ten seconds: 400 us of drift would be a trigger's width if it were not known.
    EXPECT_EQ(grid.steps_to(time(22000)), 21600u);
    EXPECT_EQ(TriggerGrid(period_ns, time(400), 180).steps_to(time(22000)), std::nullopt);
    EXPECT_EQ(grid.steps_to(time(401) + 30'000), std::nullopt);
    EXPECT_EQ(grid.steps_to(time(400)), std::nullopt);
    EXPECT_EQ(grid.steps_to(time(399)), std::nullopt);
    EXPECT_NEAR(double(grid.time_after_ns(-3)), double(time(397)), 2);
}

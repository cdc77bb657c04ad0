// SPDX-License-Identifier: MIT
// Identification against every fault, in every kind of slot. The truth, which trigger a frame's light came from, is kept
// beside the frames where the code under test cannot see it: whatever goes wrong, no frame may be mislabelled.
// links: ols_record
#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <random>
#include <set>

#include "record/identify.hpp"

using namespace ols;

namespace {

constexpr int width = 32, height = 24;
constexpr double black = 64;
constexpr uint64_t clock_offset_ns = 77'000'000'000;
constexpr double clock_drift = 23e-6;

// A subject of 156 lamps: each lights a spot, every fourth stands behind it and lights nothing.
class SyntheticStage {
  public:
    SyntheticStage(const std::string& basis, int cycles) {
        SequenceConfig config;
        config.basis = basis;
        config.cycles = cycles;
        config.basis_exposure_us = basis == "single" ? 412 : 100;
        sequence = *compile_sequence(config, default_stage());
    }

    // The image of one slot, with fresh noise of the paper's camera.
    Frame expose(const Slot& slot) {
        std::vector<double> light(width * height, 0);
        for (size_t lamp = 0; lamp < slot.lit.size(); ++lamp) {
            if (!slot.lit[lamp]) continue;
            const bool matte = lamp >= 156;
            if (!matte && lamp % 4 == 3) continue;
            const double x = matte ? 2 + 5.0 * double(lamp - 156) : double(lamp * 7 % width);
            const double y = matte ? 1 : double(lamp * 5 % height);
            for (int p = 0; p < width * height; ++p) {
                const double dx = p % width - x, dy = p / width - y;
                light[size_t(p)] += (matte ? 0.5 : 0.4) * std::exp(-(dx * dx + dy * dy) / 40);
            }
        }
        Frame frame;
        frame.width = width;
        frame.height = height;
        frame.pitch_bytes = width * 2;
        frame.samples.resize(width * height * 2);
        auto* samples = reinterpret_cast<uint16_t*>(frame.samples.data());
        for (int p = 0; p < width * height; ++p) {
            const double mu = light[size_t(p)] * slot.exposure_ticks / 125.0;
            const double counts = black + mu + (2.68 + 0.492 * std::sqrt(mu)) * gauss_(random_);
            samples[p] = uint16_t(std::clamp(std::lround(counts), 0L, 4095L));
        }
        return frame;
    }

    Sequence sequence;

  private:
    std::mt19937 random_{1};
    std::normal_distribution<double> gauss_;
};

struct Delivery {
    FrameWitness witness;
    uint64_t lit_by;  // the trigger whose light is in the pixels
};

// A take as it would go without faults, to be spoiled by a test and then played to an Identifier.
struct Take {
    std::vector<Delivery> frames;  // frames[n] is trigger n's, in order of delivery
    std::vector<ols_trigger_log_entry> log;
    Reason log_end;     // why the log stopped early
    Reason frames_end;  // why frames did
    size_t triggers = 0;
};

Take record(SyntheticStage& stage) {
    Take take;
    const Sequence& sequence = stage.sequence;
    take.triggers = sequence.trigger_count();
    for (uint32_t n = 0; n < take.triggers; ++n) {
        const size_t slot = n % sequence.slots.size();
        const uint64_t rise_ticks = 1000 + uint64_t(n) * sequence.slots[0].period_ticks;
        take.log.push_back({rise_ticks & ~1ull, n, uint32_t(n / sequence.slots.size()), uint16_t(slot), 1, 0});
        FrameWitness witness;
        witness.stamp.frame_id = n + 1;
        witness.stamp.timestamp_ns = clock_offset_ns + uint64_t(double(rise_ticks) * 8 * (1 + clock_drift));
        witness.summary = summarize_frame(stage.expose(sequence.slots[slot]), black, NoiseModel{});
        take.frames.push_back({witness, n});
    }
    return take;
}

struct Outcome {
    std::set<uint64_t> missing;
    std::map<uint64_t, MissingSlot> notes;
    int mislabelled = 0, duplicates = 0;
    CauseCounts discarded;
    bool accounted = true;  // one verdict for each frame and each trigger
};

// Plays a take: the log is asked for every `poll` frames, `lag` triggers behind the camera.
Outcome play(const Take& take, const Sequence& sequence, size_t poll = 13, size_t lag = 0,
             const IdentifyOptions& options = {}, bool board_is_ahead = false, uint64_t host_drops = 0) {
    Identifier identifier(sequence, options);
    Outcome outcome;
    std::set<uint64_t> frames_seen, triggers_seen;
    const auto collect = [&] {
        for (const Verdict& verdict : identifier.take_verdicts()) {
            if (verdict.kind != Verdict::missing) outcome.accounted &= frames_seen.insert(verdict.arrival).second;
            if (verdict.kind == Verdict::identified) {
                outcome.accounted &= triggers_seen.insert(verdict.entry.counter).second;
                outcome.mislabelled += take.frames[verdict.arrival].lit_by != verdict.entry.counter;
            } else if (verdict.kind == Verdict::missing) {
                outcome.accounted &= triggers_seen.insert(verdict.slot.counter).second;
                outcome.missing.insert(verdict.slot.counter);
                outcome.notes[verdict.slot.counter] = verdict.slot;
            } else {
                outcome.discarded.add(verdict.why.cause);
                outcome.duplicates += verdict.why.text.starts_with("duplicate");
            }
        }
    };
    size_t told = 0;
    uint64_t fired = 0;
    const auto tell_log = [&](uint64_t until, uint64_t arrivals) {
        std::vector<ols_trigger_log_entry> entries;
        for (; told < take.log.size() && take.log[told].counter < until; ++told) entries.push_back(take.log[told]);
        identifier.add_log(entries, std::max(until, fired), arrivals);
    };
    if (board_is_ahead) fired = take.triggers;
    for (size_t arrival = 0; arrival < take.frames.size(); ++arrival) {
        FrameWitness witness = take.frames[arrival].witness;
        witness.arrival = arrival;
        fired = std::max(fired, take.frames[arrival].lit_by + 1);
        identifier.add_frame(witness);
        if (arrival % poll == poll - 1) tell_log(fired > lag ? fired - lag : 0, arrival + 1);
        collect();
    }
    tell_log(take.triggers, take.frames.size());
    identifier.end_log(take.log_end);
    identifier.end_frames(take.frames_end, 0, host_drops);
    collect();
    outcome.accounted &= frames_seen.size() == take.frames.size() && triggers_seen.size() == take.triggers;
    return outcome;
}

// The counter of the k-th slot of a kind in a cycle.
uint64_t find_slot(const Sequence& sequence, SlotKind kind, int cycle, int k) {
    for (uint64_t s = 0; s < sequence.slots.size(); ++s)
        if (sequence.slots[s].kind == kind && k-- == 0) return uint64_t(cycle) * sequence.slots.size() + s;
    return UINT64_MAX;
}

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
     [](const Sequence& s, uint64_t n) { return range(can_stand_alone(s, n) ? n : 0, s.trigger_count()); }},
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

// Causes that only all of a gap's facts tell: how many triggers, how many ids, and how many of them we dropped.
TEST(Identify, a_gap_is_split_into_what_the_camera_missed_what_the_link_lost_and_what_we_dropped) {
    SyntheticStage stage("single", 3);
    Take take = record(stage);
    const auto causes = [&](const Outcome& outcome) {
        CauseCounts counts;
        for (const auto& [trigger, note] : outcome.notes) counts.add(note.why.cause);
        return counts.to_json();
    };
    const auto drop = [&](size_t first, size_t count) {
        take.frames.erase(take.frames.begin() + ptrdiff_t(first), take.frames.begin() + ptrdiff_t(first + count));
    };
    const auto shift_ids = [&](size_t from, uint64_t by) {
        for (size_t n = from; n < take.frames.size(); ++n) take.frames[n].witness.stamp.frame_id -= by;
    };
    // Seven triggers without a frame: the camera saw five of them, of which we dropped three, one while the disk was late. That we
    // did is known two frames before the gap comes up, as it is when frames wait to be read.
    drop(250, 7);
    shift_ids(250, 2);
    for (size_t n = 248; n < take.frames.size(); ++n)
        take.frames[n].witness.disk_drops = 1, take.frames[n].witness.host_drops = 2;
    EXPECT_EQ(causes(play(take, stage.sequence)),
              (nlohmann::json{
                  {"disk_was_late", 1}, {"host_was_late", 2}, {"link_lost_it", 2}, {"camera_missed_trigger", 2}}));
    // A later gap is not put down to drops that an earlier one explained.
    drop(300, 1);
    EXPECT_EQ(causes(play(take, stage.sequence))["link_lost_it"], 3);
    // Behind the last frame nobody's count tells, but that we dropped some.
    drop(take.frames.size() - 4, 4);
    for (size_t n = 310; n < take.frames.size(); ++n) take.frames[n].witness.host_drops = 3;
    const Outcome ended = play(take, stage.sequence, 13, 0, {}, false, 3);
    EXPECT_EQ(causes(ended)["no_frame"], 3);
    EXPECT_EQ(causes(ended)["host_was_late"], 3);
}

TEST(Identify, lamps_that_give_no_light_are_the_cause_and_not_the_camera) {
    SyntheticStage stage("single", 3);
    const Take clean = record(stage);
    const FrameSummary dark = clean.frames[find_slot(stage.sequence, SlotKind::dark, 0, 0)].witness.summary;
    Take take = clean;
    for (Delivery& frame : take.frames) frame.witness.summary = dark;
    const Outcome never = play(take, stage.sequence);
    EXPECT_EQ(never.missing.size(), take.triggers);
    EXPECT_EQ(never.discarded.of(Cause::no_light), take.frames.size());
    // From the second cycle on: each group's tracking frame tells.
    take = clean;
    for (size_t n = 180; n < take.frames.size(); ++n) take.frames[n].witness.summary = dark;
    const Outcome failed = play(take, stage.sequence);
    EXPECT_EQ(failed.notes.at(180).why.cause, Cause::no_light);
    EXPECT_EQ(failed.mislabelled, 0);
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

// SPDX-License-Identifier: MIT
// Which frames a target is made of, against a search through all frames of the take.
// links: ols_develop
#include "develop/lazy_basis.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <set>
#include <tuple>

using namespace ols;

namespace {

// Of three cycles. Made once: spreading the light of 300 rows evenly takes a second.
const Sequence& sequence_of(const std::string& basis) {
    static std::map<std::string, Sequence> known;
    if (!known.contains(basis)) {
        SequenceConfig config;
        config.basis = basis;
        config.cycles = 3;
        known[basis] = *compile_sequence(config, default_stage());
    }
    return known[basis];
}

bool everything(uint64_t) {
    return true;
}

// The frames of a slot that lie less than a cycle from the target, within the take or not, the nearest first and of two the
// earlier.
std::vector<int64_t> by_distance(const Sequence& sequence, uint64_t target, size_t slot) {
    const auto length = int64_t(sequence.slots.size());
    std::vector<int64_t> found;
    for (int64_t n = int64_t(target) - length + 1; n < int64_t(target) + length; ++n)
        if (((n % length) + length) % length == int64_t(slot)) found.push_back(n);
    std::ranges::sort(found, {}, [&](int64_t n) { return std::pair(std::abs(n - int64_t(target)), n); });
    return found;
}

bool is_in_take(const Sequence& sequence, int64_t number) {
    return number >= 0 && number < int64_t(sequence.trigger_count());
}

void expect_as_searched(const Sequence& sequence, uint64_t target, const std::set<uint64_t>& lost) {
    const auto is_recorded = [&](uint64_t number) {
        EXPECT_TRUE(is_in_take(sequence, int64_t(number)));
        return !lost.contains(number);
    };
    const LazyBasis basis = gather_basis(sequence, target, is_recorded);
    EXPECT_EQ(basis.target, target);
    size_t choice = 0, missing = 0;
    for (size_t s = 0; s < sequence.slots.size(); ++s) {
        if (sequence.slots[s].kind != SlotKind::basis) continue;
        std::vector<int64_t> there = by_distance(sequence, target, s);
        const int64_t nearest = there.front();
        std::erase_if(there, [&](int64_t n) { return !is_in_take(sequence, n) || lost.contains(uint64_t(n)); });
        if (there.empty()) {
            ASSERT_LT(missing, basis.lost.size());
            EXPECT_EQ(basis.lost[missing++], int(s));
            continue;
        }
        ASSERT_LT(choice, basis.choices.size());
        EXPECT_EQ(basis.choices[choice].slot, int(s));
        EXPECT_EQ(int64_t(basis.choices[choice].number), there.front()) << "slot " << s << " of target " << target;
        EXPECT_EQ(basis.choices[choice].is_stand_in, there.front() != nearest);
        const int64_t other = by_distance(sequence, target, s)[1];
        const bool has_both = there.front() == nearest && std::ranges::find(there, other) != there.end();
        ASSERT_EQ(basis.choices[choice].across.has_value(), has_both);
        if (has_both) {
            EXPECT_EQ(int64_t(*basis.choices[choice].across), other);
        }
        ++choice;
    }
    EXPECT_EQ(choice, basis.choices.size());
    EXPECT_EQ(missing, basis.lost.size());
}

std::vector<uint64_t> tracking_numbers(const Sequence& sequence) {
    std::vector<uint64_t> numbers;
    for (uint64_t n = 0; n < sequence.trigger_count(); ++n)
        if (sequence.slots[n % sequence.slots.size()].kind == SlotKind::tracking) numbers.push_back(n);
    return numbers;
}

}  // namespace

// Cycles of 180, 198 and 342 slots.
class LazyBases : public testing::TestWithParam<std::pair<const char*, size_t>> {
  protected:
    const Sequence& sequence = sequence_of(GetParam().first);
};

TEST_P(LazyBases, has_the_cycle_that_the_paper_or_the_basis_asks_for) {
    EXPECT_EQ(sequence.slots.size(), GetParam().second);
}

TEST_P(LazyBases, takes_of_each_slot_the_nearest_frame) {
    for (const uint64_t target : target_numbers(sequence, 3)) expect_as_searched(sequence, target, {});
}

TEST_P(LazyBases, reaches_half_a_cycle_away_at_most) {
    for (const uint64_t target : target_numbers(sequence, 1))
        for (const auto& choice : gather_basis(sequence, target, everything).choices) {
            EXPECT_LE(std::abs(int64_t(choice.number) - int64_t(target)), int64_t(sequence.slots.size() / 2));
            EXPECT_FALSE(choice.is_stand_in);
        }
}

TEST_P(LazyBases, takes_a_lost_slot_from_the_other_side) {
    for (const uint64_t target : target_numbers(sequence, 5)) {
        std::set<uint64_t> lost;
        for (uint64_t n = 0; n < sequence.trigger_count(); n += 7) lost.insert(n);
        expect_as_searched(sequence, target, lost);
    }
}

TEST_P(LazyBases, names_what_neither_cycle_has) {
    const uint64_t target = target_numbers(sequence, 1).front(), length = sequence.slots.size();
    std::set<uint64_t> lost;
    for (const uint64_t slot : {2, 3, 25})
        for (uint64_t cycle = 0; cycle < 3; ++cycle) lost.insert(cycle * length + slot);
    expect_as_searched(sequence, target, lost);
    EXPECT_FALSE(gather_basis(sequence, target, [&](uint64_t n) { return !lost.contains(n); }).lost.empty());
}

TEST_P(LazyBases, has_a_target_wherever_the_nearest_frames_were_all_taken) {
    std::vector<uint64_t> whole;
    for (const uint64_t number : tracking_numbers(sequence)) {
        bool is_whole = true;
        for (size_t s = 0; s < sequence.slots.size(); ++s)
            if (sequence.slots[s].kind == SlotKind::basis)
                is_whole = is_whole && is_in_take(sequence, by_distance(sequence, number, s).front());
        if (is_whole) whole.push_back(number);
    }
    ASSERT_FALSE(whole.empty());
    EXPECT_EQ(target_numbers(sequence, 1), whole);
    for (const int every : {2, 4, 5}) {
        std::vector<uint64_t> some;
        for (size_t i = 0; i < whole.size(); i += size_t(every)) some.push_back(whole[i]);
        EXPECT_EQ(target_numbers(sequence, every), some) << every;
    }
}

TEST_P(LazyBases, at_the_takes_ends_take_what_there_is) {
    for (const uint64_t target : {tracking_numbers(sequence).front(), tracking_numbers(sequence).back()})
        expect_as_searched(sequence, target, {});
}

TEST_P(LazyBases, ask_for_no_frame_outside_their_range) {
    for (const uint64_t target : tracking_numbers(sequence)) {
        const FrameRange range = frames_around(sequence, target);
        EXPECT_LT(range.last, sequence.trigger_count());
        gather_basis(sequence, target, [&](uint64_t number) {
            EXPECT_GE(number, range.first);
            EXPECT_LE(number, range.last);
            return number % 2 == 0;
        });
    }
}

INSTANTIATE_TEST_SUITE_P(Cycles, LazyBases,
                         testing::Values(std::pair("single", 180), std::pair("s159", 180), std::pair("paley163", 198),
                                         std::pair("triangle300", 342)),
                         [](const auto& info) { return std::string(info.param.first); });

TEST(LazyBasis, takes_the_earlier_of_two_frames_that_are_as_near) {
    // Half of 180 slots from a tracking slot lies a tracking slot, ten groups being even: a tie needs another distance of
    // kinds, so the cycle is turned by a slot there.
    Sequence turned = sequence_of("single");
    std::swap(turned.slots[90], turned.slots[92]);
    ASSERT_EQ(turned.slots[90].kind, SlotKind::basis);
    const LazyBasis basis = gather_basis(turned, 180, everything);
    const auto tie = std::ranges::find(basis.choices, 90, &LazyBasis::Choice::slot);
    ASSERT_NE(tie, basis.choices.end());
    EXPECT_EQ(tie->number, 90u);
}

TEST(LazyBasis, one_cycle_alone_has_targets_only_in_its_middle) {
    Sequence sequence = sequence_of("single");
    sequence.config.cycles = 1;
    for (const uint64_t target : target_numbers(sequence, 1))
        for (const auto& choice : gather_basis(sequence, target, everything).choices) EXPECT_LT(choice.number, 180u);
    EXPECT_LE(target_numbers(sequence, 1).size(), 1u);
}

TEST(LazyBasis, has_targets_at_whole_parts_of_the_tracking_rate) {
    const Sequence& sequence = sequence_of("single");
    EXPECT_NEAR(tracking_rate_hz(sequence), 120, 0.01);
    for (const auto& [fps, every] : {std::pair(60.0, 2), std::pair(30.0, 4), std::pair(24.0, 5), std::pair(120.0, 1)})
        EXPECT_EQ(*tracking_frames_a_target(sequence, fps), every);
    const auto refused = tracking_frames_a_target(sequence, 25);
    ASSERT_FALSE(refused.ok());
    EXPECT_NE(refused.error().message.find("24"), std::string::npos) << "it says which rates there are";
    // Groups of 18 slots: 4 or 5 tracking frames to a target of 25 a second.
    EXPECT_NE(refused.error().message.find("frame_rate_hz = 1800, or 2250"), std::string::npos)
        << refused.error().message;
    Sequence without = sequence;
    std::erase_if(without.slots, [](const Slot& slot) { return slot.kind == SlotKind::tracking; });
    EXPECT_FALSE(tracking_frames_a_target(without, 24).ok());
    EXPECT_TRUE(target_numbers(without, 1).empty());
}

TEST(LazyBasis, has_the_targets_asked_for_at_each_frame_rate_that_a_refusal_names) {
    for (const double frame_rate_hz : {1800.0, 2250.0}) {
        SequenceConfig config;
        config.frame_rate_hz = frame_rate_hz;
        const auto sequence = compile_sequence(config, default_stage());
        ASSERT_TRUE(sequence.ok());
        const auto every = tracking_frames_a_target(*sequence, 25);
        ASSERT_TRUE(every.ok()) << every.error().message;
        EXPECT_NEAR(target_rate_hz(*sequence, *every), 25, 1e-3);
    }
}

TEST(LazyBasis, tells_24_targets_a_second_from_24_that_are_23_976) {
    SequenceConfig config;
    config.frame_rate_hz = 2157.84;  // 5 * 18 * 23.976
    const auto sequence = compile_sequence(config, default_stage());
    ASSERT_TRUE(sequence.ok());
    const auto every = tracking_frames_a_target(*sequence, 24);
    ASSERT_TRUE(every.ok()) << every.error().message;
    // 90 periods of round(125e6 / 2157.84) = 57928 ticks.
    EXPECT_NEAR(target_rate_hz(*sequence, *every), 125e6 / (90 * 57928.0), 1e-9);
}

TEST(LazyBasis, splits_the_time_between_targets_as_evenly_as_whole_frames_allow) {
    const Sequence& sequence = sequence_of("single");
    using Frames = std::vector<int>;
    EXPECT_EQ(evenly_apart(sequence, 5, 0), (Frames{0, 1, 2, 3, 4}));
    EXPECT_EQ(evenly_apart(sequence, 5, 1 / 60.0), (Frames{0, 3})) << "25 ms and 17 ms: three parts would be too short";
    EXPECT_EQ(evenly_apart(sequence, 4, 1 / 60.0), (Frames{0, 2}));
    EXPECT_EQ(evenly_apart(sequence, 5, 1 / 80.0), (Frames{0, 2, 3}));
    EXPECT_EQ(evenly_apart(sequence, 2, 1 / 60.0), (Frames{0}));
    EXPECT_EQ(evenly_apart(sequence, 1, 1 / 60.0), (Frames{0})) << "targets are as near as they are";
}

TEST(LazyBasis, counts_the_tracking_frames_before_one) {
    const Sequence& sequence = sequence_of("single");
    uint64_t count = 0;
    for (uint64_t number = 0; number < 400; ++number) {
        EXPECT_EQ(tracking_frames_before(sequence, number), count) << number;
        count += sequence.slots[number % 180].kind == SlotKind::tracking;
    }
}

// SPDX-License-Identifier: MIT
// What a missing slot is put down to, where only all the facts together tell.
// links: ols_record
#include <gtest/gtest.h>

#include "record/cause.hpp"
#include "synthetic_take.hpp"

using namespace ols;
using namespace ols::test;

TEST(Causes, have_names_of_their_own_and_count_most_first) {
    std::set<std::string> names;
    for (size_t i = 0; i < cause_count; ++i) names.insert(cause_name(Cause(i)));
    EXPECT_EQ(names.size(), cause_count);
    CauseCounts counts;
    counts.add(Cause::stale, 2);
    counts.add(Cause::link_lost_it, 9);
    EXPECT_EQ(counts.to_words(), "9 link lost it, 2 stale");
    EXPECT_EQ(counts.to_json(), (nlohmann::json{{"link_lost_it", 9}, {"stale", 2}}));
    EXPECT_EQ(counts.total(), 11u);
}

// Causes that only all of a gap's facts tell: how many triggers, how many ids, and how many of them we dropped.
TEST(Causes, a_gap_is_split_into_what_the_camera_missed_what_the_link_lost_and_what_we_dropped) {
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

TEST(Causes, lamps_that_give_no_light_are_the_cause_and_not_the_camera) {
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
    // For a while: the landmark after it proves the place of all that came, and not that there was light.
    take = clean;
    for (size_t n = 319; n < 359; ++n) take.frames[n].witness.summary = dark;
    const Outcome back = play(take, stage.sequence);
    uint64_t seen_again = 359;
    while (is_dark(take.frames[seen_again].witness.summary)) ++seen_again;
    EXPECT_LT(seen_again, 364) << "lamps in a row behind the subject";
    for (uint64_t n = 319; n < seen_again; ++n) EXPECT_TRUE(back.missing.contains(n)) << n;
    EXPECT_FALSE(back.missing.contains(seen_again));
    EXPECT_EQ(back.notes.at(358).why.cause, Cause::no_light);
    EXPECT_EQ(back.mislabelled, 0);
}

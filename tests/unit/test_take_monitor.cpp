// SPDX-License-Identifier: MIT
// What others see of a take while it runs, and when it is over.
// links: ols_take
#include "take/take_monitor.hpp"

#include <gtest/gtest.h>

#include <set>

#include "played_take.hpp"
#include "steady_clock.hpp"
#include "take_fixture.hpp"

using namespace ols;
using namespace ols::test;

TEST(TakeMonitor, developing_is_behind_by_what_waits_and_not_by_what_is_done) {
    TakeMonitor monitor;
    OutputMonitor& output = monitor.add_output(2, 57'870);
    output.plan(4), output.plan(4);
    output.hand_on(0, 180), output.hand_on(0, 360), output.hand_on(1, 180);
    OutputProgress now = monitor.progress().outputs[0];
    EXPECT_EQ(now.targets_planned, 8u);
    EXPECT_EQ(now.targets_waiting, 3u);
    EXPECT_EQ(now.ticks_behind, 360u * 57'870) << "of the camera that is further behind";
    EXPECT_NEAR(now.seconds_behind(), 1.0 / 6, 1e-4);
    output.develop(0, 180, true), output.develop(1, 180, false);
    now = output.progress();
    EXPECT_EQ(now.targets_waiting, 1u);
    EXPECT_EQ(now.targets_developed, 1u);
    EXPECT_EQ(now.ticks_behind, 180u * 57'870);
    output.develop(0, 360, true);
    EXPECT_EQ(output.progress().ticks_behind, 0u);
}

TEST(TakeMonitor, a_stage_that_waits_is_told_from_one_that_works_and_does_not_go_on) {
    StageBeats beats;
    StageBeat& reader = beats.add("camera 0 reader");
    beats.add("output 0 writer");
    reader.beat();
    const auto first = beats.progress();
    EXPECT_EQ(first[0].name, "camera 0 reader");
    EXPECT_EQ(first[0].activity, StageActivity::works);
    EXPECT_EQ(first[1].activity, StageActivity::waits_for_input);
    EXPECT_EQ(beats.progress()[0].beats, first[0].beats) << "it hangs";
    reader.beat(StageActivity::waits_for_room);
    EXPECT_EQ(beats.progress()[0].beats, first[0].beats + 1);
    EXPECT_EQ(beats.progress()[0].activity, StageActivity::waits_for_room);
}

class MonitoredTake : public TakeDirectory {
  protected:
    Result<TakeReport> run(PlayedTake& take) {
        auto archive = ArchiveWriter::create(path, take_info(156));
        return take.run(*archive, &monitor);
    }
    TakeMonitor monitor;
};

TEST_F(MonitoredTake, a_take_that_is_over_is_told_to_the_last_slot_and_target) {
    PlayedTake take("single", 2);
    const auto report = run(take);
    ASSERT_TRUE(report.ok()) << report.error().message;
    EXPECT_EQ(report->record.missing().total(), 0u) << report->record.missing().to_words();
    const TakeProgress end = monitor.progress();
    const uint64_t triggers = take.description.sequence.trigger_count();
    EXPECT_EQ(end.record.board.triggers_planned, triggers);
    EXPECT_EQ(end.record.board.triggers_fired, triggers);
    EXPECT_TRUE(end.record.board.has_ended);
    EXPECT_TRUE(end.record.board.end.empty());
    EXPECT_EQ(end.record.board.stop_told_ns, 0u);
    EXPECT_GT(end.record.board.dark_confirmed_ns, 0u);
    ASSERT_EQ(end.record.cameras.size(), 1u);
    EXPECT_EQ(end.record.cameras[0].frames_received, triggers);
    EXPECT_EQ(end.record.cameras[0].slots_decided, triggers);
    EXPECT_EQ(end.record.cameras[0].missing.total(), 0u);
    EXPECT_EQ(end.record.cameras[0].room.frames_in_memory, 0u);
    EXPECT_EQ(end.record.cameras[0].room.bytes_in_memory, 0u);
    EXPECT_TRUE(end.record.cameras[0].has_ended);
    EXPECT_EQ(end.outputs[0].targets_planned, 2u);
    EXPECT_EQ(end.outputs[0].targets_developed, 2u);
    EXPECT_EQ(end.outputs[0].targets_written, 2u);
    EXPECT_EQ(end.outputs[0].targets_waiting, 0u);
    EXPECT_EQ(end.outputs[0].ticks_behind, 0u);
    ASSERT_EQ(end.record.stages.size(), 5u);  // log, reader, identification, developer, writer
    for (const StageProgress& stage : end.record.stages) {
        EXPECT_GT(stage.beats, 0u) << stage.name;
        EXPECT_EQ(stage.activity, StageActivity::ended) << stage.name;
    }
}

// A calibration records one camera of the stage's.
TEST(RecordMonitor, the_threads_of_a_camera_are_named_by_its_index_in_the_stage) {
    PlayedTake take("single", 2);
    StageConfig& stage = take.description.stage;
    stage.cameras.push_back(stage.cameras[0]);
    const RecordSink sink{[](const auto&) {}, [](const MissingSlot&) {}, [](uint64_t, uint64_t) {}};
    RecordMonitor monitor;
    take.camera.play(take.model);
    const auto report = record_take(take.board, {{take.camera, 1, std::nullopt, sink}}, take.description.sequence,
                                    stage, take.stop, &monitor);
    take.camera.end();
    ASSERT_TRUE(report.ok()) << report.error().message;
    const RecordProgress end = monitor.progress();
    EXPECT_EQ(end.cameras[0].index, 1u);
    EXPECT_EQ(end.cameras[0].frames_received, take.description.sequence.trigger_count());
    EXPECT_EQ(end.cameras[0].slots_decided, take.description.sequence.trigger_count());
    std::set<std::string> names;
    for (const StageProgress& thread : end.stages) names.insert(thread.name);
    EXPECT_TRUE(names.contains("camera 1 reader"));
    EXPECT_TRUE(names.contains("camera 1 identification"));
}

TEST_F(MonitoredTake, a_stop_is_told_and_the_dark_confirmed_while_what_was_fired_is_still_identified) {
    PlayedCamera::Options options;
    StopRequest* stop = nullptr;
    options.before = [&](uint64_t trigger) {
        if (trigger == 300) stop->ask("enough");
    };
    PlayedTake take("single", 50, options);
    stop = &take.stop;
    const uint64_t before_ns = steady_ns();
    const auto report = run(take);
    ASSERT_TRUE(report.ok()) << report.error().message;
    const BoardProgress board = monitor.progress().record.board;
    EXPECT_GE(board.stop_told_ns, before_ns);
    EXPECT_GE(board.dark_confirmed_ns, board.stop_told_ns);
    EXPECT_EQ(board.end.text, "enough");
    const CameraProgress camera = monitor.progress().record.cameras[0];
    EXPECT_EQ(camera.slots_decided, take.description.sequence.trigger_count());
    EXPECT_EQ(camera.missing.of(Cause::stopped), report->record.missing().of(Cause::stopped));
    EXPECT_EQ(monitor.progress().outputs[0].targets_missing, 50 - monitor.progress().outputs[0].targets_written);
}

// SPDX-License-Identifier: MIT
// Camera developer: gathers the identified frames of one camera and develops the targets of one output, in a thread of its own.
#pragma once

#include <map>
#include <optional>
#include <thread>
#include <variant>

#include "develop/frame_store.hpp"
#include "record/event_queue.hpp"
#include "record/frame_room.hpp"
#include "record/missing_ranges.hpp"
#include "take/take.hpp"
#include "take/target_plan.hpp"
#include "take/target_writer.hpp"

namespace ols {

class CameraDeveloper {
  public:
    struct Report {
        // Shares of a target's pixels, in the worst target (OutputReport).
        double saturated_share = 0, estimated_share = 0, unsolved_share = 0, misaligned_share = 0;
        double seconds = 0;
        MotionDeveloper::Times seconds_motion;
        SuspicionReport suspicion;
    };

    // `camera`: its place among the stage's. References must outlive the developer.
    // `room`: where the frames are that are to be developed, and bound how many targets wait; null: they are in memory, and one target
    // waits.
    CameraDeveloper(const TakeDescription& take, const TakeTargets& targets, uint32_t camera, TargetWriter& writer,
                    OutputMonitor& monitor, std::shared_ptr<FrameRoom> room);
    ~CameraDeveloper() { (void)finish(); }

    size_t target_count() const { return plan_.size(); }

    void add_frame(std::shared_ptr<const Frame> frame);
    void add_missing(const MissingSlot& slot) { missing_.add(slot); }

    // Hands on the targets whose frames are all decided: those below `decided`.
    void hand_on(uint64_t decided);

    // Waits until everything handed on is with the writer, where the targets that were never decided go, too.
    Report finish();
    nlohmann::json missing_json() const { return missing_.to_json(); }

  private:
    // What one target is made of.
    struct Job {
        uint32_t index = 0;
        std::variant<CycleFrames, TargetFrames> frames;
        Reason lost_by;  // why the first of its slots that is missing is; empty when none is
    };

    Job gather(size_t index) const;
    void lose(size_t first, size_t last, const Reason& lost_by);
    void flush_lost();
    Status bring_back(Job& job);
    void develop();
    TargetOutcome develop(Job& job);
    Result<Target> develop(const CycleFrames& frames) { return developer_.develop(frames); }
    Result<Target> develop(const TargetFrames& frames) { return motion_developer_.develop(frames); }
    void describe(Target& target, nlohmann::json& detail);
    void note_suspicion(uint32_t target, const nlohmann::json& witnesses);

    const TakeDescription& take_;
    const uint32_t camera_;
    const bool is_performance_;
    TargetWriter& writer_;
    OutputMonitor& monitor_;
    Developer developer_;
    MotionDeveloper motion_developer_;
    const std::vector<PlannedTarget> plan_;
    FrameStore store_;
    MissingRanges missing_;
    size_t next_ = 0;                  // of the plan
    std::optional<LostTargets> lost_;  // the run that the next target may belong to
    Report report_;                    // the thread's until it has ended
    const std::shared_ptr<FrameRoom> room_;
    // Of the last target's frames, those that were on a disk, and their copies in memory: the next target may have the same.
    std::map<std::shared_ptr<const Frame>, std::shared_ptr<const Frame>> brought_back_;
    EventQueue<std::variant<Job, LostTargets>> work_;
    std::thread thread_;
};

}  // namespace ols

// SPDX-License-Identifier: MIT
// FramePlacer: finds each frame's place among the board's triggers from the camera's id and time and from what the frame
// looks like.
//
// Method. Frames in camera order whose times lie on one grid of trigger periods form a *stretch*: one camera clock, whose
// place among the triggers is one unknown number. The optical code gives it: the stretch is *locked* when exactly one
// number fits every tracking, matte and dark frame seen. Within a stretch, frames whose ids step as their times do form
// a *run*. Frames are accepted when the next landmark of their run proves its slot (record/optical_code.hpp), or the run
// ends after one that did. A landmark that does not look as it should takes down every frame since the last proof:
// something shifted in between.
#pragma once

#include <cstdint>
#include <deque>
#include <optional>
#include <string>
#include <vector>

#include "record/optical_code.hpp"
#include "record/reorder.hpp"
#include "record/trigger_grid.hpp"
#include "stage/sequence.hpp"

namespace ols {

struct IdentifyOptions {
    size_t reorder_frames = 16;  // places by which a frame may be late and lose nothing; a group of a paper cycle
    // Frames that may wait for a proof; above, the oldest are given up. Two cycles of 180 and what the window holds.
    size_t pending_max = 400;
    // The camera's time before the board was started, or anything below it. No trigger can have fired earlier, so the time of
    // a frame limits how many can have gone before it, even where the board has long played on. Of the first stretch
    // only: later ones may have another clock.
    uint64_t camera_ns_at_start = 0;
};

// What became of a frame, or of a trigger without one.
struct Placement {
    std::optional<uint64_t> arrival;  // of the frame
    std::optional<uint64_t> counter;  // of the trigger, as far as camera time tells
    bool accepted = false;
    Reason why;  // not accepted
    Sight optical = Sight::silent;
};

class FramePlacer {
  public:
    // All slots of the sequence have one period.
    FramePlacer(const Sequence& sequence, const IdentifyOptions& options);

    void add(FrameWitness frame);

    // The board had fired `fired` triggers by a time at which the frames with an arrival below `arrivals` were here: an
    // upper bound for their counters.
    void bound(uint64_t arrivals, uint64_t fired);

    // No more frames: whatever waits is settled.
    void end();

    std::vector<Placement> take_placements();

    // After end(): of the frames that were dropped by us, those that no gap between frames was found for.
    std::vector<Reason> drops_left(uint64_t disk_drops, uint64_t host_drops);

    // Every frame still to be accepted has a counter of at least this.
    uint64_t lowest_open() const;

    bool locked() const { return locked_; }

    // When a trigger is due on the camera's clock: exact when locked, otherwise the latest that is possible, as if no
    // trigger before the stretch had been missed. Nothing before the first frame.
    std::optional<uint64_t> latest_time_of_ns(uint64_t counter) const;
    std::optional<double> drift_ppm() const;  // of the camera's clock against the board's, when locked
    uint64_t duplicates() const { return duplicates_; }
    uint64_t camera_restarts() const { return camera_restarts_; }

  private:
    struct Pending {
        FrameWitness frame;
        uint64_t position = 0;    // on the stretch's grid
        bool begins_run = false;  // ids do not step here as times do
        std::vector<Reason>
            gap;  // why triggers between the frame before and this one have no frame; the last is of all further
        Sight optical = Sight::silent;
    };

    void process(FrameWitness frame);
    std::optional<uint64_t> steps_on_grid(const FrameWitness& frame) const;
    bool can_have_passed(uint64_t steps, uint64_t frame_id) const;
    void append(FrameWitness& frame, uint64_t steps);
    void begin_stretch(FrameWitness frame, Reason gap);
    bool fit_each_other(const std::vector<FrameWitness>& frames) const;
    void refuse_strays();
    void end_stretch();
    void end_run();
    void place(Pending pending);
    uint64_t triggers_until(uint64_t timestamp_ns) const;
    void try_lock();
    std::vector<Reason> losses(const FrameWitness& frame, uint64_t steps, uint64_t id_steps);
    void name_strays(std::vector<Reason>& reasons, uint64_t without) const;
    std::vector<Reason> take_drops(uint64_t count, uint64_t disk_drops, uint64_t host_drops);
    void give_up_oldest(size_t count, const Reason& why);
    Reason nothing_fits() const;
    void examine(Pending pending);
    void accept_waiting();
    void refuse_waiting(const Reason& why);
    void refuse(const FrameWitness& frame, const Reason& why);
    // The counter of position 0, or the least that it can be.
    uint64_t lowest_first_counter() const { return locked_ ? first_counter_ : next_counter_; }
    uint64_t counter_of(const Pending& pending) const { return first_counter_ + pending.position; }

    const uint64_t trigger_count_;
    const size_t group_slots_;
    const double period_ns_;
    const IdentifyOptions options_;
    ReorderWindow window_;
    OpticalCode code_;
    uint64_t next_counter_ = 0;                      // above every counter that a frame was placed at
    uint64_t bound_arrivals_ = 0, bound_fired_ = 0;  // the last bound, for frames that are still on their way here
    std::vector<Placement> placements_;
    uint64_t duplicates_ = 0, camera_restarts_ = 0;
    bool has_seen_light_ = false;               // in any frame, or in one that cannot be looked at
    uint64_t disk_drops_ = 0, host_drops_ = 0;  // of those that frames told of, how many a gap was found for

    // The stretch.
    std::optional<TriggerGrid> grid_;
    std::vector<FrameWitness> strays_;  // off the grid: bad stamps, or the first of a new stretch
    std::vector<uint64_t> stray_ids_;   // of those that were refused since the last frame on the grid
    CameraStamp last_stamp_;
    uint32_t last_epoch_ = 0;
    uint64_t last_position_ = 0;
    bool is_first_stretch_ = true;
    bool locked_ = false;
    uint64_t first_counter_ = 0;    // of position 0, when locked
    std::deque<Pending> unlocked_;  // its frames, until then
    size_t next_attempt_ = 0;       // frames at which locking is tried again

    // The run.
    bool proved_ = false;  // its last landmark looked as it should
    std::vector<Pending> waiting_;

    bool in_the_dark_ = false;  // a tracking slot was, and no frame since has had light
};

}  // namespace ols

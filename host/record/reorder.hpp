// SPDX-License-Identifier: MIT
// ReorderWindow: puts frames that were delivered late or swapped back into the camera's order, and drops duplicates.
#pragma once

#include <cstdint>
#include <deque>
#include <map>
#include <optional>

#include "record/cause.hpp"
#include "record/frame_summary.hpp"

namespace ols {

// What identification is told of a frame; its pixels stay with the caller.
struct FrameWitness {
    uint64_t arrival = 0;  // frames that arrived before it; the caller's name for it
    CameraStamp stamp;
    Reason unfit;  // why its picture cannot be used, whatever its stamp says; empty: it can
    FrameSummary summary;
    uint64_t fired_before = UINT64_MAX;  // its trigger's counter is below this: what the board had fired by then
    // Frames that had been dropped by us when this one was read, since the take began: because the disk was late, or all else.
    uint64_t disk_drops = 0, host_drops = 0;

    uint32_t epoch = 0;  // how often the camera's count had started again; set by the window
};

class ReorderWindow {
  public:
    enum class Arrival { in_time, duplicate, too_late };

    // Frames may be delivered up to `frames` places late. `period_ns` is between triggers on the camera's clock.
    ReorderWindow(size_t frames, double period_ns) : frames_(frames), period_ns_(period_ns) {}

    // Takes a frame. A count that falls back starts an epoch of its own, unless the frame's id and time both lie within
    // the window before the newest frame's, or its id has not come and its time fits there: then it is late, or a duplicate.
    Arrival add(FrameWitness frame);

    // The next frame in camera order, once `frames` later ones have come, or whatever is left when `flush`.
    std::optional<FrameWitness> take(bool flush);

    // The frames that wait, for a bound that only now is known.
    template <typename F>
    void for_each(F f) {
        for (auto& [key, frame] : waiting_) f(frame);
    }

  private:
    using Key = std::pair<uint32_t, uint64_t>;  // epoch, id
    // Ids that were passed over, from behind one frame to before another.
    struct Gap {
        uint32_t epoch;
        CameraStamp before, after;
    };
    static constexpr size_t gaps_max = 256;

    bool is_late(const CameraStamp& stamp) const;
    bool fills_gap(const CameraStamp& stamp) const;
    void note_gap(const CameraStamp& stamp);

    size_t frames_;
    double period_ns_;
    bool any_ = false;
    uint32_t epoch_ = 0;
    CameraStamp newest_;  // of this epoch
    std::map<Key, FrameWitness> waiting_;
    std::optional<Key> last_taken_;
    std::deque<Gap> gaps_;
    std::deque<std::pair<Key, uint64_t>> recent_;  // key and time of the last arrivals, to know duplicates by
};

}  // namespace ols

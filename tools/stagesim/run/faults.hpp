// SPDX-License-Identifier: MIT
// Faults on purpose: what can go wrong between a trigger and the delivered frame, at chosen triggers.
#pragma once

#include <cstdint>
#include <deque>
#include <functional>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "image/frame.hpp"
#include "result.hpp"

namespace ols {

enum class FaultKind {
    drop_frame,      // the camera exposed, the frame was lost on its way: its id is missing
    drop_trigger,    // the camera missed the trigger: no frame, and its ids go on without a gap
    duplicate,       // the frame is delivered twice
    late,            // the frame comes after the next `by` frames
    swap,            // the frame changes places with the next one
    wrong_size,      // two rows are missing
    freeze,          // the frame shows the picture of the one before
    swap_pictures,   // the frame and the one `by` later have each other's samples, under their own stamps
    old_light,       // the lamps show the pattern that they showed `by` triggers before
    dim_lamp,        // a lamp, or all, gives `factor` of its light, of so many triggers (`count`)
    restart_camera,  // before this trigger the camera starts anew: ids from 1, its clock kept or from 0
};

struct Fault {
    FaultKind kind;
    uint32_t camera = 0;
    uint64_t trigger = 0;          // how many triggers this camera had before, from 0
    uint64_t by = 1;               // late: frames; swap_pictures, old_light: triggers
    bool keep_clock = true;        // restart_camera
    std::optional<size_t> lamp{};  // dim_lamp: all if it names none
    double factor = 0;
    uint64_t count = uint64_t(1) << 40;
};

// Reads `[[fault]]` tables with the keys kind, trigger, camera, by, keep_clock, lamp, factor, count.
Result<std::vector<Fault>> read_faults(const std::string& path);

// Delivery with faults: frames go in in the order of their triggers and come out as the host gets them.
class FaultyDelivery {
  public:
    FaultyDelivery(std::vector<Fault> faults, uint32_t camera);

    // The faults that strike the camera at a trigger.
    bool strikes(FaultKind kind, uint64_t trigger) const { return find(kind, trigger) != nullptr; }
    const Fault* find(FaultKind kind, uint64_t trigger) const;

    // What the lamps shine of each exposure, in the order of triggers: lamps that are dim, and patterns that are old.
    void dim(std::vector<double>& lit_us, uint64_t trigger);

    void send(Frame frame, uint64_t trigger, const std::function<void(Frame)>& deliver);
    // Delivers what is still held back; no frames follow.
    void finish(const std::function<void(Frame)>& deliver);

  private:
    struct Held {
        Frame frame;
        uint64_t frames_left;  // that have to pass first
    };
    void pass(Frame frame, const std::function<void(Frame)>& deliver);

    std::vector<Fault> faults_;
    std::deque<Held> held_;
    std::deque<std::vector<double>> lit_before_;  // of the last triggers, the latest in front
    std::map<uint64_t, Frame> waiting_;           // for the picture of another trigger
    SampleBuffer last_samples_;
};

}  // namespace ols

// SPDX-License-Identifier: MIT
// Identifier: which slot is this frame? Three witnesses must agree, the board's trigger log, the camera's id and time,
// and the optical code; where they do not, the slot is missing. docs/identity.md tells what each fault does.
#pragma once

#include <cstdint>
#include <deque>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "record/place.hpp"
#include "wire.h"

namespace ols {

// What is known of a trigger that has no frame.
struct MissingSlot {
    uint64_t counter = 0;
    Reason why;
    bool board = false;             // the trigger log has it
    bool camera = false;            // a frame came whose time is this trigger's
    Sight optical = Sight::silent;  // what that frame looked like
};

struct Verdict {
    enum Kind { identified, discarded, missing } kind;
    uint64_t arrival = 0;           // of the frame; not for a missing slot
    ols_trigger_log_entry entry{};  // its trigger, when identified
    MissingSlot slot;               // when missing
    Reason why;                     // when discarded
};

class Identifier {
  public:
    explicit Identifier(const Sequence& sequence, const IdentifyOptions& options = {});

    // Takes a frame; `arrival` counts them from 0.
    void add_frame(FrameWitness frame);

    // Takes log entries in order of their counters and `next_counter`, what the board said with them. The frames with an
    // arrival below `arrivals` were here before the board was asked.
    void add_log(const std::vector<ols_trigger_log_entry>& entries, uint64_t next_counter, uint64_t arrivals);

    // No more entries: the board has finished ({}) or cannot be heard any more, and why.
    void end_log(const Reason& why = {});

    // No more frames: the camera has delivered everything ({}) or gives no more, and why. `disk_drops` and `host_drops`: how many
    // we had dropped in all (FrameWitness).
    void end_frames(const Reason& why = {}, uint64_t disk_drops = 0, uint64_t host_drops = 0);

    // What was decided since the last call. Frames get one verdict each, and so do triggers: all of them, once both ends
    // are told.
    std::vector<Verdict> take_verdicts();

    // Every trigger below this has its verdict.
    uint64_t decided() const { return decided_; }

    const FramePlacer& placer() const { return placer_; }

  private:
    struct Accepted {
        uint64_t arrival, counter;
    };

    void settle();
    void take_placements();
    void match_log();
    void decide();
    Reason take_last_loss();
    MissingSlot& note(uint64_t counter);
    bool fits_program(const ols_trigger_log_entry& entry) const;

    const uint64_t trigger_count_, cycle_slots_;
    const uint32_t period_ticks_;
    FramePlacer placer_;

    std::map<uint64_t, ols_trigger_log_entry> log_;  // of triggers that are not decided
    std::optional<ols_trigger_log_entry> first_entry_;
    uint64_t log_end_ = 0;  // entries below this came or never will
    std::optional<Reason> log_ended_;

    std::deque<Accepted> accepted_;          // frames that wait for their log entry, by counter
    std::map<uint64_t, MissingSlot> notes_;  // what is known of undecided triggers without a frame
    std::map<uint64_t, bool> identified_;    // undecided triggers that have one
    uint64_t decided_ = 0;
    uint64_t frames_until_ = 0;  // above the last trigger that a frame was found for
    std::optional<Reason> frames_ended_;
    std::vector<Reason> last_drops_;  // by us, that no frame came after
    std::vector<Verdict> verdicts_;
};

}  // namespace ols

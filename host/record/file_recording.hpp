// SPDX-License-Identifier: MIT
// File recording: which slot is each frame of a recording that lies in files, without the board's log.
//
// Method. FramePlacer (place.hpp) places frames on the grid of triggers as in a live take; the optical code alone says where in the
// cycle the first one is, so the count of cycles begins with the first that is whole. Two witnesses are left, number and time of the
// frame, which is one where the files have no times, and the optical code. What they disagree on is given up as in a live take.
// A frame that is missing has no third witness to say that it is this one: all frames of its group are missing with it
// (docs/identity.md). Where a landmark does not look as it should, something was lost that no number tells of: from there on the
// place in the cycle is sought anew.
#pragma once

#include "record/recorded_frames.hpp"
#include "record/recorder.hpp"

namespace ols {

// Where a recording lies in the cycles of its sequence.
struct RecordingPlace {
    uint64_t first_slot = 0;     // of the recording's first frame
    uint64_t first_trigger = 0;  // of cycle 0, counted from slot 0 of the first frame's cycle
    uint32_t cycles = 0;         // whole ones
};

// Each frame's stamp: its number, counted from the first one's, and its time, or number times period.
std::vector<CameraStamp> stamps_of(const RecordingFacts& facts, const Sequence& sequence);

// Reads from the recording's begin until the optical code fixes the cycle. The sequence's own number of cycles is not used. The error
// says what was tried and what the recording looks like: no whole cycle, no light, another frame rate, another sequence.
Result<RecordingPlace> find_place(const RecordedFrames& frames, const Sequence& sequence, const CameraConfig& camera,
                                  std::optional<double> black_counts, const std::atomic<bool>& stop);

// Reads all frames, some ahead in threads of its own, and hands them on in their order, as record_take does. `sequence` has as many cycles as
// `place`. Ticks are made up: the trigger's number in the recording times the sequence's period. `stop` ends it early; what was
// identified until then stands. A frame that cannot be read is missing, with its group, and the report tells of the first.
Result<RecordReport> record_files(const RecordedFrames& frames, const RecordingPlace& place, const Sequence& sequence,
                                  const CameraConfig& camera, std::optional<double> black_counts,
                                  const RecordSink& sink, const std::atomic<bool>& stop);

}  // namespace ols

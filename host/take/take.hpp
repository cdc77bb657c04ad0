// SPDX-License-Identifier: MIT
// Take: records a sequence and writes its archive, target by target, while it plays.
#pragma once

#include <atomic>
#include <functional>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "archive/archive.hpp"
#include "develop/develop.hpp"
#include "develop/motion_developer.hpp"
#include "record/file_recording.hpp"
#include "record/recorder.hpp"
#include "record/take_memory.hpp"
#include "stage/calibration.hpp"
#include "take/take_monitor.hpp"
#include "take/target_sink.hpp"

namespace ols {

// What becomes of slots that were lost and samples that saturated.
struct TakeMasks {
    // Lost slots of the basis take the frames of the same slot in the cycle before and the one after, their mean where both
    // are there: for subjects that hold still. Costs a cycle of delay and the memory of two more.
    bool fill_from_neighbours = false;
    Estimate estimate = Estimate::none;
};

// Which targets a take has: one a cycle, of the cycle's frames, for subjects that hold still; or a performance.
struct TakeTargets {
    // A target at every so manieth tracking frame, of the frames nearest to it (lazy_basis.hpp). 0: one a cycle.
    int every = 0;
    MotionQuality quality = {};  // of a performance
};

// What is to be recorded.
struct TakeDescription {
    Sequence sequence;
    StageConfig stage;
    Calibration calibration;  // of the stage's cameras, in their order
    TakeMasks masks;
    std::vector<std::string> witnesses = {"board log", "camera id and time", "optical code"};  // that every frame has
    int witness_step = 5;  // DevelopOptions::witness_step
    TakeMemory memory = {};
};

// What it is recorded with.
struct TakeDevices {
    Board& board;
    std::vector<Camera*> cameras;  // the stage's, in their order
    bool is_armed = false;         // the board has the sequence (arm_board())
};

// One archive that is made of the recording.
struct TakeOutput {
    // Its info gives slate, lights and units; what the take adds (identification, calibration, program) goes to the manifest.
    // It takes its place with the first frame that has its slot, so that a start that fails touches no earlier archive. It must
    // outlive the take.
    TakeOutput(ArchiveWriter& archive, TakeTargets which)
        : sink(std::make_shared<ArchiveSink>(archive)), targets(which) {}
    TakeOutput(std::shared_ptr<TargetSink> any, TakeTargets which) : sink(std::move(any)), targets(which) {}

    std::shared_ptr<TargetSink> sink;
    TakeTargets targets;
};

// Where it goes.
struct TakeSinks {
    std::vector<TakeOutput> outputs;  // one recording may be developed in several ways
    // Every frame that has its slot, one at a time. Its samples may be on a disk.
    std::function<void(const Frame&)> identified;
    std::function<void(uint64_t decided, uint64_t total)> progress;  // of triggers
    // Of what else watched the stage, for the manifest: asked once it is recorded.
    std::function<nlohmann::json()> account = {};
    TakeMonitor* monitor = nullptr;  // of this take, for others to look at while it runs; may be null
};

// What the targets' own samples said against slots and lamps (develop/target_witnesses.hpp).
struct SuspicionReport {
    int suspect_targets = 0;  // of which a slot is suspect
    int slots_left_out = 0;   // of all targets: surely named, and taken as missing
    // Of the first of these: "camera", "target", "suspect", "says"; where slots were "taken_as_missing", which, and the "cause".
    nlohmann::json targets;
    // By lamp, as in the last target that named it, with "camera", "first_target" and "last_target".
    nlohmann::json lamps;
    static constexpr size_t targets_max = 100;  // that are listed

    // Of another camera; of a lamp that both name the first one's stays.
    void add(const SuspicionReport& other);
};

// Of one archive.
struct OutputReport {
    int targets_written = 0, targets_missing = 0;
    // Shares of a target's pixels, in the worst target: with a saturated sample, estimated, not solved, and where motion
    // compensation failed.
    double saturated_share = 0, estimated_share = 0, unsolved_share = 0, misaligned_share = 0;
    double seconds_develop = 0, seconds_write = 0;  // busy in each thread
    MotionDeveloper::Times seconds_motion;          // parts of seconds_develop, of a performance
    std::string write_error;                        // what could not be written first, and why; empty when all was
    SuspicionReport suspicion;
};

// What became of the room for frames.
struct MemoryReport {
    uint64_t frames_spilled = 0;
    bool is_locked =
        false;  // frames that waited in memory could not be swapped out (mlock(2): LimitMEMLOCK, `ulimit -l`)
    std::string
        problem;  // why the disk took no more, or gave other samples back, and what to do; empty while all was well
};

struct TakeReport {
    RecordReport record;
    std::vector<OutputReport> outputs;  // in their order
    MemoryReport memory;
    double seconds_total = 0;
};

// Threads: the board's; for each camera one that reads, one that identifies, and for each output one that develops; and for each
// output one that writes. Developing runs on all processors, and follows as fast as it can, while identification goes on: frames that
// wait are in take.memory, and a camera that finds no more room there drops them, which is counted. Besides, memory holds two targets
// an output and camera.
// Every target that was to come is in the archive's journal at the end, finished or missing with its reason.
// Errors: the stage's cameras were not all given; the memory is not to be had; a camera or the board cannot be started; not one frame came. Then there
// is no archive. Anything later is in the report and in the archive.
Result<TakeReport> run_take(const TakeDescription& take, const TakeDevices& devices, const TakeSinks& sinks,
                            const StopRequest& stop);

// Develops a recording that lies in files in the same way; `take` has as many cycles as `place` (record/file_recording.hpp), and one
// camera. Errors: not one frame has its slot. Then there is no archive.
Result<TakeReport> ingest_take(const TakeDescription& take, const RecordedFrames& frames, const RecordingPlace& place,
                               const TakeSinks& sinks, const std::atomic<bool>& stop);

// What such a take's manifest says of its recording, {"recording": ...}.
nlohmann::json origin_of(const RecordedFrames& frames, const RecordingPlace& place, const Sequence& sequence);

// The mean black level of a camera's calibration, for the optical code; nothing for a nominal one.
std::optional<double> measured_black(const Calibration& calibration, size_t camera);

}  // namespace ols

// SPDX-License-Identifier: MIT
// Motion developer: targets of a performance, each from the frames around it, brought to its time.
#pragma once

#include <map>
#include <memory>
#include <optional>
#include <vector>

#include "develop/develop.hpp"
#include "develop/lazy_basis.hpp"
#include "develop/matte_frames.hpp"
#include "develop/motion_quality.hpp"

namespace ols {

// What one target is made of.
struct TargetFrames {
    uint32_t index = 0;  // of the target
    LazyBasis basis;
    std::vector<std::shared_ptr<const Frame>> frames;  // by basis.choices
    std::vector<std::shared_ptr<const Frame>> across;  // the same, of the target's other side; null where there is none
    // The tracking frames that were recorded in frames_around(), in order. A target's may be among them or lost.
    struct Tracking {
        uint64_t number = 0;
        std::shared_ptr<const Frame> frame;
    };
    std::vector<Tracking> tracking;
    std::vector<uint64_t> lost_tracking;  // numbers
    std::vector<MatteFrame> matte;        // nearest_matte_frames()
};

// Takes targets in their order. The flow between two tracking frames is found once, every basis frame made ready
// to be warped once; what no later target needs is dropped, so that memory holds some two cycles of frames.
class MotionDeveloper {
  public:
    // References must outlive the developer. Targets stand at every `every`th tracking frame: which of them flow is found between
    // is counted from there (MotionQuality::flow_apart_s).
    MotionDeveloper(const Sequence& sequence, const CameraCalibration& calibration, const NoiseModel& noise,
                    DevelopOptions options, MotionQuality quality, int every = 1);
    ~MotionDeveloper();

    // Errors: those of Developer::develop, and frames too small for flow. Where no tracking frame is near, nothing moves
    // and every pixel is masked (mask_misaligned).
    // `path`, if given, takes the place of the flow that would be found: a true one, to measure what flow errs.
    Result<Target> develop(const TargetFrames& frames, const MotionPath* path = nullptr);

    // The flow that is found. Targets in their order, here too, and each but once.
    Result<MotionPath> find_path(const TargetFrames& frames);

    // Where the time went, of all targets so far, in seconds of the calling thread.
    struct Times {
        double flow = 0;    // tracking images, flow, confidence
        double planes = 0;  // from frames to planes above black
        double invert = 0;  // warp, inversion, variance
        double matte = 0;   // its frames' planes, warp, mean
    };
    const Times& times() const { return times_; }

    // What is held for later targets.
    struct Kept {
        size_t basis_frames = 0;     // as planes
        size_t tracking_frames = 0;  // with their flows
    };
    Kept kept() const { return {ready_shorts_.planes.size() + ready_floats_.planes.size(), flows_.frames()}; }

    // The middle of the target's tracking exposure, in ticks; where that frame was lost, by its neighbours' word.
    static double instant_of(const TargetFrames& frames, const Sequence& sequence);

    // The middles of the first and the last exposure that are brought to the target: of basis and matte frames, with those across
    // the target that are blended or without.
    static TrackingFlows::Reach reach_of(const TargetFrames& frames, bool with_across);

  private:
    // The frames of the last target, ready to be warped.
    template <typename Sample>
    struct Ready {
        std::optional<SignalPlanes<Sample>> black;
        std::map<uint64_t, std::shared_ptr<const SignalPlanes<Sample>>> planes;  // by number
    };

    std::vector<const TargetFrames::Tracking*> fresh_tracking(const TargetFrames& frames) const;
    template <typename Sample>
    void prepare_planes(const TargetFrames& frames, Ready<Sample>& ready) const;
    template <typename Sample, typename Sum>
    AlignedRows<Sample, Sum> align(const TargetFrames& frames, const MotionPath& path,
                                   std::shared_ptr<const Alignment> alignment, Ready<Sample>& ready);
    template <typename Sample, typename Sum>
    void follow_brightness(const TargetFrames& frames, const MotionPath& path, const SignalPlanes<Sample>& black,
                           AlignedRows<Sample, Sum>& aligned) const;
    Result<AlignedFrames> align(const TargetFrames& frames, const MotionPath& path);
    // Empty where the target has no matte frames; unwarped without an alignment.
    TargetMatte matte_of(const TargetFrames& frames, std::shared_ptr<const Alignment> alignment);

    const Sequence& sequence_;
    const CameraCalibration& calibration_;
    const NoiseModel noise_;
    const DevelopOptions options_;
    const MotionQuality quality_;
    const int every_;
    const std::vector<int> flow_frames_;  // of `every_`, from a target's own on
    Developer developer_;
    TrackingFlows flows_;
    std::optional<uint64_t> last_tracking_;  // whose image `flows_` has
    Ready<int16_t> ready_shorts_;
    Ready<float> ready_floats_;
    Times times_;
};

}  // namespace ols

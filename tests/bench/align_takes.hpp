// SPDX-License-Identifier: MIT
// The takes of the alignment's benchmark: scenes of known motion, each recorded moving and frozen, with their truth, and the flow
// that each quality finds in them.
#pragma once

#include <map>
#include <memory>
#include <string>
#include <vector>

#include "align_score.hpp"

namespace ols {

// Motion of the subject's pixels at 320 x 240 over a cycle, by the true flow. What is stated stands in tables whose lines must be
// known before anything is measured; Takes checks it.
struct MovingScene {
    std::string name;
    double mean_px, most_px;

    std::string title() const;  // "turn60 (1.9 px, most 4.9)"
};

// Settings of the flow were chosen on the first four; all are reported.
const std::vector<MovingScene>& moving_scenes();

struct Take {
    RecordingPlan plan;
    Recording recording;
    std::unique_ptr<TrueTarget> truth;  // of the first target
    MotionPath true_path;               // of the first target
    std::unique_ptr<Recording> frozen;  // only with a single target
};

class Takes {
  public:
    // Kept in `folder`. With an empty one, to see a program working, all takes are those of one small scene that needs no assets.
    explicit Takes(std::string folder) : folder_(std::move(folder)) {}

    // Errors: record()'s; the scene moves by more than a tenth other than stated.
    Result<const Take*> get(const MovingScene& scene, const std::string& basis, int width = 320, int height = 240,
                            int targets = 1);

    // The path of the first target as MotionDeveloper finds it. Found once for all bases whose tracking frames are the same bits.
    Result<const MotionPath*> found(const Take& take, const std::string& quality);

    // Drops what is in memory.
    void forget() { takes_.clear(), paths_.clear(); }

  private:
    struct Found {
        std::vector<TargetFrames::Tracking> tracking;
        MotionPath path;
    };

    Result<std::unique_ptr<Take>> load(const RecordingPlan& plan) const;

    const std::string folder_;
    std::map<std::string, std::unique_ptr<Take>> takes_;
    std::map<std::string, std::vector<std::unique_ptr<Found>>> paths_;  // by quality
};

}  // namespace ols

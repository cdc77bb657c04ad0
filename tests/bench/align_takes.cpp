// SPDX-License-Identifier: MIT
// Loading takes, and finding each flow once.
#include "align_takes.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

namespace ols {

namespace {

// The motion of the lids is at its height in the second cycle.
RecordingPlan plan_of(const std::string& scene, const std::string& basis, int width, int height, int targets) {
    return {
        "tools/stagesim/scenes/motion_" + scene + ".toml", basis, width, height, scene == "blink" ? 1u : 2u, targets};
}

bool same_frames(const std::vector<TargetFrames::Tracking>& a, const std::vector<TargetFrames::Tracking>& b) {
    return std::ranges::equal(a, b, [](const TargetFrames::Tracking& x, const TargetFrames::Tracking& y) {
        return x.frame->tick == y.frame->tick && x.frame->exposure_ticks == y.frame->exposure_ticks &&
               x.frame->samples == y.frame->samples;
    });
}

Status check_motion(const MovingScene& scene, const Take& take) {
    const CycleMotion motion =
        cycle_motion(take.true_path, double(take.recording.sequence.cycle_ticks()), take.truth->subject());
    const double scale = take.plan.width / 320.0;
    const auto agrees = [&](double stated, double measured) {
        return std::abs(stated - measured / scale) <= 0.1 * stated;
    };
    if (agrees(scene.mean_px, motion.mean_px) && agrees(scene.most_px, motion.most_px)) return Done{};
    return fail(
        fmt::format("{} moves by {:.3g} pixels a cycle, at most {:.3g}, at 320 x 240: state that in align_takes.cpp",
                    scene.name, motion.mean_px / scale, motion.most_px / scale));
}

}  // namespace

std::string MovingScene::title() const {
    if (most_px == 0) return name;
    return fmt::format("{} ({:.2g} px, most {:.2g})", name, mean_px, most_px);
}

const std::vector<MovingScene>& moving_scenes() {
    static const std::vector<MovingScene> all = {{"spin", 6.1, 11.2},    {"blink", 0.007, 4.4}, {"hair", 5.9, 8.9},
                                                 {"turn180", 5.6, 14.5}, {"turn60", 1.9, 4.9},  {"talk", 0.22, 4.1},
                                                 {"hand", 18.8, 43.2},   {"still", 0, 0}};
    return all;
}

Result<const Take*> Takes::get(const MovingScene& scene, const std::string& basis, int width, int height, int targets) {
    RecordingPlan plan = plan_of(scene.name, basis, width, height, targets);
    if (folder_.empty()) plan = plan_of("hair", basis, 48, 32, targets);
    auto& take = takes_[fmt::format("{} {} {} {}", plan.scene, basis, width, targets)];
    if (!take) {
        auto loaded = load(plan);
        if (!loaded) return loaded.error();
        if (!folder_.empty())
            if (const Status checked = check_motion(scene, **loaded); !checked) return checked.error();
        take = std::move(*loaded);
    }
    return take.get();
}

Result<std::unique_ptr<Take>> Takes::load(const RecordingPlan& plan) const {
    auto recording = record(plan, folder_);
    if (!recording) return recording.error();
    auto take = std::make_unique<Take>(Take{plan, std::move(*recording), {}, {}, {}});
    auto lamps = true_lamps(take->recording, plan, folder_);
    if (!lamps) return lamps.error();
    take->truth = std::make_unique<TrueTarget>(take->recording, *lamps);
    take->true_path = true_path(take->recording, 0);
    if (plan.targets > 1) return take;
    RecordingPlan frozen_plan = plan;
    frozen_plan.is_frozen = true;
    auto frozen = record(frozen_plan, folder_);
    if (!frozen) return frozen.error();
    take->frozen = std::make_unique<Recording>(std::move(*frozen));
    return take;
}

Result<const MotionPath*> Takes::found(const Take& take, const std::string& quality) {
    const auto& tracking = take.recording.targets[0].tracking;
    for (const auto& found : paths_[quality])
        if (same_frames(found->tracking, tracking)) return &found->path;
    auto path = found_path(take.recording, 0, *motion_quality(quality));
    if (!path) return path.error();
    paths_[quality].push_back(std::make_unique<Found>(Found{tracking, std::move(*path)}));
    return &paths_[quality].back()->path;
}

}  // namespace ols

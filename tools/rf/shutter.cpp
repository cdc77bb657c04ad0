// SPDX-License-Identifier: MIT
#include "shutter.hpp"

#include <fmt/format.h>

namespace ols {

void ShutterOptions::add_to(CLI::App& verb) {
    verb.add_option(
            "--shutter", angle_deg,
            "shutter angle: blurs along the target's motion for this part of a frame; 180 is usual in film, 360 the "
            "whole frame, 0 (default) no blur")
        ->type_name("DEG")
        ->check(CLI::Range(0.0, 720.0));
    verb.add_option("--shutter-phase", phase_deg,
                    "from the target's instant to the middle of the exposure; 0 (default) is centred, as film is")
        ->type_name("DEG")
        ->check(CLI::Range(-360.0, 360.0));
    verb.add_option("--blur-step", step_px, "pixels between sub-frames; smaller is slower and smoother (default 1)")
        ->type_name("PX")
        ->check(CLI::Range(0.01, 16.0));
}

std::map<std::string, std::string> ShutterOptions::header_attributes() const {
    return {{"relit.shutterDegrees", fmt::format("{}", angle_deg)},
            {"relit.shutterPhaseDegrees", fmt::format("{}", phase_deg)}};
}

Status check_motion_known(const ArchiveReader& archive, const std::string& path,
                          const std::vector<TargetEntry>& targets) {
    for (const auto& entry : targets) {
        const auto head = archive.read_head(entry.camera, entry.index);
        if (!head) return head.error();
        if (head->motion.times_s.empty())
            return fail(fmt::format(
                "'{}': target {} has no motion to blur along: record with `stagectl run --fps 24` or another "
                "rate, which keeps it, or leave out --shutter",
                path, entry.index));
    }
    return Done{};
}

Result<BlurredImage> through_shutter(const TargetReader& target, const std::string& file, double frame_rate_hz,
                                     const Image& sharp, const ShutterOptions& options, int threads) {
    const auto motion = target.read_motion();
    if (!motion) return motion.error();
    auto blurred = motion_blurred(sharp, *motion, frame_rate_hz,
                                  {.shutter_deg = options.angle_deg,
                                   .phase_deg = options.phase_deg,
                                   .step_px = options.step_px,
                                   .threads = threads});
    if (!blurred) return fail(fmt::format("'{}': {}", file, blurred.error().message));
    return blurred;
}

std::vector<std::string> shutter_warnings(const BlurredImage& blurred) {
    std::vector<std::string> warnings;
    if (blurred.extrapolated_s > 0)
        warnings.push_back(
            fmt::format("the shutter is open for up to {:.2f} ms beyond the instants whose motion the archive has; "
                        "there motion goes on at the same speed",
                        blurred.extrapolated_s * 1e3));
    if (blurred.unseen_pixels > 0)
        warnings.push_back(
            fmt::format("{} pixels see nothing of the picture while the shutter is open and are left sharp",
                        blurred.unseen_pixels));
    return warnings;
}

nlohmann::json shutter_report(const ShutterOptions& options, const BlurredImage& blurred) {
    return {{"degrees", options.angle_deg},
            {"phase_degrees", options.phase_deg},
            {"step_px", options.step_px},
            {"extrapolated_ms", blurred.extrapolated_s * 1e3},
            {"unseen_pixels", blurred.unseen_pixels}};
}

}  // namespace ols

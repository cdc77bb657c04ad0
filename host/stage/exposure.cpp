// SPDX-License-Identifier: MIT
// Exposure from the brightest row.
#include "stage/exposure.hpp"

#include <algorithm>
#include <cmath>

#include "stage/basis_noise.hpp"
#include "stage/playback.hpp"

namespace ols {

namespace {

// The mu at which mu + 5 (read + shot sqrt(mu)) is `full`: a quadratic in sqrt(mu).
double brightest_safe_counts(const NoiseModel& noise, double full) {
    constexpr double deviations = 5;
    const double rest = std::max(0.0, full - deviations * noise.read_counts), half = deviations * noise.shot / 2;
    const double root = std::sqrt(half * half + rest) - half;
    return root * root;
}

}  // namespace

std::vector<double> white_card_counts_per_us(const std::vector<LightPosition>& lamps, const CameraConfig& camera) {
    const auto& [x, y, z] = camera.position_m;
    const Vec3 normal = normalized({x, y, z});
    std::vector<double> counts;
    for (const auto& lamp : lamps) counts.push_back(camera.counts_per_us * std::max(0.0, dot(normal, lamp.direction)));
    return counts;
}

double longest_exposure_us(double frame_rate_hz) {
    constexpr double read_out_us = 1e6 / 2160 - 412;
    const double period_us = 1e6 / frame_rate_hz;
    return std::max(period_us - read_out_us, period_us / 2);
}

double derived_exposure_us(const Basis& basis, const StageConfig& stage, double frame_rate_hz) {
    double exposure_us = longest_exposure_us(frame_rate_hz);
    for (const auto& camera : stage.cameras) {
        const double brightest = brightest_row_counts(basis, white_card_counts_per_us(stage.lamps, camera));
        const double safe = brightest_safe_counts(camera.noise, camera.white - camera.black);
        if (brightest * exposure_us > safe) exposure_us = safe / brightest;
    }
    const double step_us = basis.level_max == 1 ? 1 : basis.level_max / double(ticks_per_us);
    return step_us * std::max(1.0, std::floor(exposure_us / step_us + 1e-9));
}

}  // namespace ols

// SPDX-License-Identifier: MIT
// Lists what changed in each interval, once for all of its slots.
#include "capture/followed_brightness.hpp"

#include <algorithm>
#include <cmath>
#include <type_traits>

#include "reflectance/masked_sample.hpp"

namespace ols {

namespace {

constexpr double standard_deviations = 6;
constexpr float largest_factor = 4;

template <typename Sum>
Sum scaled(Sum sample, float factor) {
    const float value = float(sample) * factor;
    if constexpr (std::is_floating_point_v<Sum>) {
        return value;
    } else {
        // What fits_shorts() promises of shorts, and SampleFiller asks of others.
        constexpr float most = sizeof(Sum) == 2 ? 16383.0f : 8388607.0f;
        return Sum(std::lround(std::clamp(value, -most, most)));
    }
}

}  // namespace

template <typename Sum>
FollowedBrightness::FollowedBrightness(const Knots<Sum>& knots, size_t instant, const NoiseModel& noise) {
    const auto& target = knots[instant];
    changes_.resize(knots.size() - 1);
    for (size_t p = 0; p < target.size(); ++p) {
        if (is_masked(target[p])) continue;
        const auto now = float(target[p]);
        const double sigma = noise.read_counts + noise.shot * std::sqrt(std::max(0.0, double(now)));
        const auto least = float(standard_deviations * std::sqrt(2.0) * sigma);
        for (size_t i = 0; i < changes_.size(); ++i) {
            if (is_masked(knots[i][p]) || is_masked(knots[i + 1][p])) continue;
            const auto first = float(knots[i][p]), last = float(knots[i + 1][p]);
            if (std::max(std::abs(first - now), std::abs(last - now)) > least)
                changes_[i].push_back({uint32_t(p), first, last, now, least});
        }
    }
}

template <typename Sum>
void FollowedBrightness::apply(const Alignment::Place& place, std::span<Sum> samples) const {
    const float fraction = std::clamp(place.fraction, 0.0f, 1.0f);
    for (const Change& change : changes_[place.interval]) {
        Sum& sample = samples[change.sample];
        const float then = change.first + fraction * (change.last - change.first);
        if (is_masked(sample) || std::abs(change.now - then) <= change.least) continue;
        const float now = std::max(change.now, 0.0f);
        const bool is_bounded = then > 0 && now < largest_factor * then && now * largest_factor > then;
        const float factor = is_bounded ? now / then : (now > then ? largest_factor : 1 / largest_factor);
        sample = scaled(sample, factor);
    }
}

template FollowedBrightness::FollowedBrightness(const Knots<int16_t>&, size_t, const NoiseModel&);
template FollowedBrightness::FollowedBrightness(const Knots<int32_t>&, size_t, const NoiseModel&);
template FollowedBrightness::FollowedBrightness(const Knots<float>&, size_t, const NoiseModel&);
template void FollowedBrightness::apply(const Alignment::Place&, std::span<int16_t>) const;
template void FollowedBrightness::apply(const Alignment::Place&, std::span<int32_t>) const;
template void FollowedBrightness::apply(const Alignment::Place&, std::span<float>) const;

}  // namespace ols

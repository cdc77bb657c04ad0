// SPDX-License-Identifier: MIT
// Noise by a counter-based generator: key = (seed, camera), counter = (sample, exposure).
#include "render/effects/sensor_noise.hpp"

#include <fmt/format.h>
#include <tbb/parallel_for.h>

#include <algorithm>

#include "render/philox.hpp"

namespace ols {

std::string SensorNoise::caller(const Setup& setup) const {
    const NoiseModel& noise = setup.camera.noise;
    if (!setup.camera_model || (noise.read_counts == 0 && noise.shot == 0)) return "";
    return fmt::format("camera: sigma = {:g} + {:g} sqrt(counts)", noise.read_counts, noise.shot);
}

void SensorNoise::apply(Exposure& exposure) {
    std::vector<float>& counts = exposure.counts.data;
    const float read = float(model_.read_counts), shot = float(model_.shot);
    // The camera and the high half of the seed share a key word.
    const std::array<uint32_t, 2> key = {uint32_t(seed_), uint32_t(seed_ >> 32) ^ exposure.camera << 24};
    constexpr size_t block = 4096;
    tbb::parallel_for(size_t(0), (counts.size() + block - 1) / block, [&](size_t b) {
        const size_t end = std::min(counts.size(), (b + 1) * block);
        for (size_t i = b * block; i < end; i += 4) {
            const auto normals = standard_normals(
                philox4x32({uint32_t(i / 4), 0, uint32_t(exposure.number), uint32_t(exposure.number >> 32)}, key));
            for (size_t k = 0; k < std::min<size_t>(4, end - i); ++k) {
                float& mu = counts[i + k];
                mu += (read + shot * std::sqrt(std::max(0.0f, mu))) * normals[k];
            }
        }
    });
    count(counts.size());
}

}  // namespace ols

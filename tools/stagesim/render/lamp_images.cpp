// SPDX-License-Identifier: MIT
// Shades every visible point under every lamp, a chunk of pixels at a time so that its points stay in the cache.
#include "render/lamp_images.hpp"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <limits>

namespace ols {

namespace {

// Direct light of a lamp at infinity. The matte board's lamps light the board only; the sphere's light everything but
// the board, unless stray light is called for.
void start(LightPacket& packet, bool sphere_lights_board) {
    const VisiblePoints& points = packet.points;
    const Float3 l = packet.lamp.direction;
    for (int i = 0; i < packet_size; ++i) {
        const uint32_t p = packet.first + i;
        const bool receives =
            packet.lamp.matte ? points.on_board[p] != 0 : points.on_board[p] == 0 || sphere_lights_board;
        packet.receives[i] = receives ? 1.0f : 0.0f;
        packet.to_lamp[0][i] = l.x, packet.to_lamp[1][i] = l.y, packet.to_lamp[2][i] = l.z;
        packet.distance_m[i] = std::numeric_limits<float>::infinity();
        const float cosine = l.x * points.normal[0][p] + l.y * points.normal[1][p] + l.z * points.normal[2][p];
        packet.irradiance[i] = packet.receives[i] * std::max(0.0f, cosine);
    }
}

bool is_dark(const LightPacket& packet) {
    return std::all_of(&packet.reflected[0][0], &packet.reflected[0][0] + 3 * packet_size,
                       [](float r) { return r == 0; });
}

}  // namespace

LampImages::LampImages(VisiblePoints points, size_t lamps, int channels)
    : points_(std::move(points)), channels_(channels), images_(lamps) {}

void LampImages::render(const std::vector<uint32_t>& wanted, const std::vector<PlacedLamp>& lamps,
                        const Geometry& geometry, const EffectSet& effects) {
    std::vector<uint32_t> todo;
    for (const uint32_t lamp : wanted)
        if (images_[lamp].empty()) todo.push_back(lamp);
    // One more element, so that the image of an empty view still counts as rendered.
    for (const uint32_t lamp : todo) images_[lamp].assign(points_.pixels.size() * channels_ + 1, 0);
    if (todo.empty()) return;
    tbb::parallel_for(size_t(0), points_.chunks.size(),
                      [&](size_t c) { render_chunk(points_.chunks[c], todo, lamps, geometry, effects); });
}

void LampImages::render_chunk(const VisiblePoints::Chunk& chunk, const std::vector<uint32_t>& todo,
                              const std::vector<PlacedLamp>& lamps, const Geometry& geometry,
                              const EffectSet& effects) {
    const bool sphere_lights_board = effects.active("stray");
    std::vector<uint64_t> arriving(effects.arriving().size(), 0), reflecting(effects.reflecting().size(), 0);
    std::vector<float> colors(size_t(chunk.pixels) * 3);
    std::vector<LightPacket> packets;
    packets.reserve(chunk.points / packet_size);
    for (const uint32_t lamp : todo) {
        packets.clear();
        for (uint32_t p = chunk.first_point; p < chunk.first_point + chunk.points; p += packet_size) {
            packets.push_back({points_, p, lamps[lamp], lamp, geometry, {}, {}, {}, {}, {}});
            start(packets.back(), sphere_lights_board);
        }
        for (size_t e = 0; e < arriving.size(); ++e) arriving[e] += effects.arriving()[e]->apply(packets);
        for (LightPacket& packet : packets)
            for (int c = 0; c < 3; ++c)
                for (int i = 0; i < packet_size; ++i)
                    packet.reflected[c][i] = points_.albedo[c][packet.first + i] * packet.irradiance[i];
        for (size_t e = 0; e < reflecting.size(); ++e) reflecting[e] += effects.reflecting()[e]->apply(packets);
        std::fill(colors.begin(), colors.end(), 0.0f);
        for (const LightPacket& packet : packets) {
            if (is_dark(packet)) continue;
            for (int i = 0; i < packet_size; ++i)
                for (int c = 0; c < 3; ++c)
                    colors[(points_.pixel[packet.first + i] - chunk.first_pixel) * 3 + c] +=
                        points_.weight[packet.first + i] * packet.reflected[c][i];
        }
        float* image = images_[lamp].data() + size_t(chunk.first_pixel) * channels_;
        if (channels_ == 3) {
            std::copy(colors.begin(), colors.end(), image);
            continue;
        }
        for (uint32_t i = 0; i < chunk.pixels; ++i) {
            const uint32_t pixel = points_.pixels[chunk.first_pixel + i];
            const float rgb[3] = {colors[3 * i], colors[3 * i + 1], colors[3 * i + 2]};
            image[i] = effects.mosaic()->keep(rgb, int(pixel % points_.width), int(pixel / points_.width));
        }
        effects.mosaic()->count(chunk.pixels);
    }
    for (size_t e = 0; e < arriving.size(); ++e) effects.arriving()[e]->count(arriving[e]);
    for (size_t e = 0; e < reflecting.size(); ++e) effects.reflecting()[e]->count(reflecting[e]);
}

void LampImages::add_weighted(const std::vector<Float3>& weights, Image& sum) const {
    constexpr size_t block = 4096;  // pixels; their sums stay in the first-level cache
    std::vector<uint32_t> lit;
    for (uint32_t i = 0; i < weights.size(); ++i)
        if (!(weights[i] == Float3{})) lit.push_back(i);
    const size_t count = points_.pixels.size();
    tbb::parallel_for(size_t(0), (count + block - 1) / block, [&](size_t b) {
        const size_t first = b * block, pixels = std::min(block, count - first);
        std::vector<float> total(pixels * channels_, 0);
        for (const uint32_t lamp : lit) {
            const float* image = images_[lamp].data() + first * channels_;
            const Float3 w = weights[lamp];
            if (channels_ == 1 || (w.x == w.y && w.y == w.z)) {
                for (size_t i = 0; i < total.size(); ++i) total[i] += w.x * image[i];
            } else {
                for (size_t i = 0; i < pixels; ++i) {
                    total[3 * i] += w.x * image[3 * i];
                    total[3 * i + 1] += w.y * image[3 * i + 1];
                    total[3 * i + 2] += w.z * image[3 * i + 2];
                }
            }
        }
        for (size_t i = 0; i < pixels; ++i) {
            float* out = sum.data.data() + size_t(points_.pixels[first + i]) * channels_;
            for (int c = 0; c < channels_; ++c) out[c] += total[i * channels_ + c];
        }
    });
}

}  // namespace ols

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
    const Lanes3 normal = lanes_of(packet.points.normal, packet.first);
    const uint8_t* on_board = packet.points.on_board.data() + packet.first;
    const Float3 l = packet.lamp.direction;
    const bool matte = packet.lamp.matte;
    Lanes receives, irradiance;
    for (int i = 0; i < packet_size; ++i)
        receives[i] = (matte ? on_board[i] != 0 : on_board[i] == 0 || sphere_lights_board) ? 1.0f : 0.0f;
    for (int i = 0; i < packet_size; ++i) {
        const float cosine = l.x * normal[0][i] + l.y * normal[1][i] + l.z * normal[2][i];
        irradiance[i] = receives[i] * std::max(0.0f, cosine);
    }
    packet.receives = receives, packet.irradiance = irradiance;
    std::fill_n(packet.to_lamp[0].at, packet_size, l.x);
    std::fill_n(packet.to_lamp[1].at, packet_size, l.y);
    std::fill_n(packet.to_lamp[2].at, packet_size, l.z);
    std::fill_n(packet.distance_m.at, packet_size, std::numeric_limits<float>::infinity());
}

void reflect_diffusely(LightPacket& packet) {
    if (!packet.is_lit()) {
        packet.reflected = {};
        return;
    }
    const Lanes3 albedo = lanes_of(packet.points.albedo, packet.first);
    const Lanes irradiance = packet.irradiance;
    Lanes3 reflected;
    for (int c = 0; c < 3; ++c)
        for (int i = 0; i < packet_size; ++i) reflected[c][i] = albedo[c][i] * irradiance[i];
    packet.reflected = reflected;
}

bool is_dark(const LightPacket& packet) {
    bool dark = true;
    for (const Lanes& color : packet.reflected)
        for (const float r : color.at) dark &= r == 0;
    return dark;
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
    const Mosaic* mosaic = effects.mosaic();
    const std::vector<uint8_t> kept =
        mosaic && mosaic->keeps_one_color() ? kept_colors(chunk, *mosaic) : std::vector<uint8_t>();
    std::vector<float> colors(mosaic && kept.empty() ? size_t(chunk.pixels) * 3 : 0);  // of which the mean is kept
    std::vector<LightPacket> packets;
    packets.reserve(chunk.points / packet_size);
    for (const uint32_t lamp : todo) {
        packets.clear();
        for (uint32_t p = chunk.first_point; p < chunk.first_point + chunk.points; p += packet_size) {
            packets.push_back({points_, p, lamps[lamp], lamp, geometry, {}, {}, {}, {}, {}});
            start(packets.back(), sphere_lights_board);
        }
        for (size_t e = 0; e < arriving.size(); ++e) arriving[e] += effects.arriving()[e]->apply(packets);
        for (LightPacket& packet : packets) reflect_diffusely(packet);
        for (size_t e = 0; e < reflecting.size(); ++e) reflecting[e] += effects.reflecting()[e]->apply(packets);
        std::fill(colors.begin(), colors.end(), 0.0f);
        float* image = images_[lamp].data() + size_t(chunk.first_pixel) * size_t(channels_);
        for (const LightPacket& packet : packets)
            if (!is_dark(packet)) add_light(packet, chunk, kept, colors.empty() ? image : colors.data());
        for (size_t i = 0; i < colors.size(); i += 3) image[i / 3] = (colors[i] + colors[i + 1] + colors[i + 2]) / 3;
    }
    if (effects.mosaic()) effects.mosaic()->count(uint64_t(chunk.pixels) * todo.size());
    for (size_t e = 0; e < arriving.size(); ++e) effects.arriving()[e]->count(arriving[e]);
    for (size_t e = 0; e < reflecting.size(); ++e) effects.reflecting()[e]->count(reflecting[e]);
}

// Of each point of a chunk, the colour that its pixel sees.
std::vector<uint8_t> LampImages::kept_colors(const VisiblePoints::Chunk& chunk, const Mosaic& mosaic) const {
    std::vector<uint8_t> kept(chunk.points);
    for (uint32_t i = 0; i < chunk.points; ++i) {
        const int pixel = int(points_.pixels[points_.pixel[chunk.first_point + i]]);
        kept[i] = uint8_t(mosaic.color_at(pixel % points_.width, pixel / points_.width));
    }
    return kept;
}

// Adds a packet to its chunk's pixels: one colour each, or, where `kept` names none, all three.
void LampImages::add_light(const LightPacket& packet, const VisiblePoints::Chunk& chunk,
                           const std::vector<uint8_t>& kept, float* sums) const {
    for (uint32_t i = 0; i < packet_size; ++i) {
        const uint32_t p = packet.first + i, pixel = points_.pixel[p] - chunk.first_pixel;
        const float weight = points_.weight[p];
        if (!kept.empty())
            sums[pixel] += weight * packet.reflected[kept[p - chunk.first_point]][int(i)];
        else
            for (uint32_t c = 0; c < 3; ++c) sums[3 * pixel + c] += weight * packet.reflected[c][int(i)];
    }
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

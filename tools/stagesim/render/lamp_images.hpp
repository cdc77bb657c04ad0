// SPDX-License-Identifier: MIT
// The scene under each lamp alone, kept as linear images. Light adds: any picture of the still scene is a weighted sum.
#pragma once

#include <vector>

#include "render/effects/effect_set.hpp"

namespace ols {

class LampImages {
  public:
    // Of a scene seen as `points`; channels are 3, or 1 when a mosaic keeps one.
    LampImages(VisiblePoints points, size_t lamps, int channels);

    // Renders the lamps of `wanted` that are not there yet. The same bits for any number of threads.
    void render(const std::vector<uint32_t>& wanted, const std::vector<PlacedLamp>& lamps, const Geometry& geometry,
                const EffectSet& effects);

    // Adds sum over lamps of weights[lamp][channel] * image; lamps of weight 0 are skipped, others must be rendered.
    // Lamps are summed in ascending order.
    void add_weighted(const std::vector<Float3>& weights, Image& sum) const;

    // Lets go of all lamps' images.
    void forget() { images_.assign(images_.size(), {}); }

    bool has(uint32_t lamp) const { return !images_[lamp].empty(); }
    const VisiblePoints& points() const { return points_; }
    int channels() const { return channels_; }

  private:
    void render_chunk(const VisiblePoints::Chunk& chunk, const std::vector<uint32_t>& todo,
                      const std::vector<PlacedLamp>& lamps, const Geometry& geometry, const EffectSet& effects);
    std::vector<uint8_t> kept_colors(const VisiblePoints::Chunk& chunk, const Mosaic& mosaic) const;
    void add_light(const LightPacket& packet, const VisiblePoints::Chunk& chunk, const std::vector<uint8_t>& kept,
                   float* sums) const;

    VisiblePoints points_;
    int channels_;
    std::vector<std::vector<float>> images_;  // [lamp][pixel of points_.pixels * channels + channel]
};

}  // namespace ols

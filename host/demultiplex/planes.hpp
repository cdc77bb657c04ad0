// SPDX-License-Identifier: MIT
// Planes: where the samples of many images lie, image by image or in tiles.
#pragma once

#include <cstddef>
#include <span>

namespace ols {

// Samples that are inverted together. A cache line of 16-bit samples: all of a plan's places fit the nearest cache.
constexpr size_t tile_samples = 32;

// One pointer an image. Every tile_samples samples of an image are contiguous, and tile_step samples lie from the begin of
// one such tile to the next: tile_samples for plain images, more where the tiles of several images alternate.
template <typename Sample>
struct Planes {
    std::span<Sample* const> first = {};
    size_t tile_step = tile_samples;

    bool empty() const { return first.empty(); }
    size_t size() const { return first.size(); }
    size_t offset(size_t sample) const { return sample / tile_samples * tile_step + sample % tile_samples; }
};

}  // namespace ols

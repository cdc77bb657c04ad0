// SPDX-License-Identifier: MIT
// What the camera sees: one surface point a primary sample, with all that shading needs of it.
#pragma once

#include <cstdint>
#include <vector>

#include "render/baked_looks.hpp"
#include "render/pinhole.hpp"
#include "scene/geometry.hpp"

namespace ols {

// Points in arrays, grouped into chunks of neighbouring pixels. Every chunk is filled up to whole packets with points of
// weight 0, so that shading runs on packets only. A chunk's pixels belong to no other chunk.
struct VisiblePoints {
    // A chunk is a square tile of the image; its points (1024 of 64 bytes at 4 samples) stay in the second-level cache.
    static constexpr int tile_pixels = 16;

    struct Chunk {
        uint32_t first_point, points;  // points are a multiple of packet_size
        uint32_t first_pixel, pixels;  // in `pixels`
    };

    std::vector<float> position[3], normal[3], view[3];  // view: unit, to the camera
    std::vector<float> albedo[3], roughness, f0;
    std::vector<float> weight;    // 1 / samples a pixel, or 0
    std::vector<uint32_t> pixel;  // index into `pixels`
    std::vector<uint8_t> on_board;
    std::vector<uint32_t> pixels;  // y * width + x of every pixel that sees anything
    std::vector<Chunk> chunks;
    int width = 0, height = 0, samples = 0;

    size_t size() const { return weight.size(); }
};

// Casts the scene's samples (a square number, at the middles of a fixed grid) through every pixel. With
// scene.merges_samples, those of a pixel that meet one smooth surface become one point, their mean. With `baked` (else null), looks
// come from there. The same for any number of threads.
VisiblePoints find_visible_points(const Scene& scene, const Geometry& geometry, const Pinhole& camera, int width,
                                  int height, BakedLooks* baked);

}  // namespace ols

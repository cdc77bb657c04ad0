// SPDX-License-Identifier: MIT
// Lattice noise; the lattice is hashed with integer arithmetic, so textures are the same everywhere.
#include "noise3.hpp"

#include <algorithm>
#include <cstdint>

namespace ols {

namespace {

// A bijective mix (the finaliser of MurmurHash3) of the cell's coordinates.
uint32_t hash_cell(int x, int y, int z, uint32_t seed) {
    uint32_t h = uint32_t(x) * 0x8da6b343u ^ uint32_t(y) * 0xd8163841u ^ uint32_t(z) * 0xcb1ab31fu ^ seed * 0x9e3779b9u;
    h ^= h >> 16;
    h *= 0x85ebca6bu;
    h ^= h >> 13;
    h *= 0xc2b2ae35u;
    return h ^ h >> 16;
}

float unit(uint32_t hash) {
    return float(hash >> 8) * 0x1p-24f;
}

// Dot product with one of Perlin's twelve cube-edge gradients.
float gradient(uint32_t hash, float x, float y, float z) {
    const uint32_t h = hash & 15;
    const float u = h < 8 ? x : y, v = h < 4 ? y : (h == 12 || h == 14 ? x : z);
    return ((h & 1) ? -u : u) + ((h & 2) ? -v : v);
}

float fade(float t) {
    return t * t * t * (t * (t * 6 - 15) + 10);
}

}  // namespace

float noise3(Float3 p, uint32_t seed) {
    const float fx = std::floor(p.x), fy = std::floor(p.y), fz = std::floor(p.z);
    const int ix = int(fx), iy = int(fy), iz = int(fz);
    const float x = p.x - fx, y = p.y - fy, z = p.z - fz;
    const float u = fade(x), v = fade(y), w = fade(z);
    float corner[8];
    for (int i = 0; i < 8; ++i) {
        const int dx = i & 1, dy = i >> 1 & 1, dz = i >> 2;
        corner[i] = gradient(hash_cell(ix + dx, iy + dy, iz + dz, seed), x - dx, y - dy, z - dz);
    }
    for (int i = 0; i < 4; ++i) corner[i] = corner[2 * i] + u * (corner[2 * i + 1] - corner[2 * i]);
    for (int i = 0; i < 2; ++i) corner[i] = corner[2 * i] + v * (corner[2 * i + 1] - corner[2 * i]);
    return corner[0] + w * (corner[1] - corner[0]);
}

float fractal_noise3(Float3 p, int octaves, float gain, uint32_t seed) {
    float sum = 0, height = 1, total = 0;
    for (int i = 0; i < octaves; ++i) {
        sum += height * noise3(p, seed + uint32_t(i));
        total += height;
        height *= gain;
        p = p * 2.03f;  // not 2, or the octaves' lattice points, where noise is zero, would coincide
    }
    return sum / total;
}

Speckle speckle3(Float3 p, uint32_t seed) {
    const int ix = int(std::floor(p.x)), iy = int(std::floor(p.y)), iz = int(std::floor(p.z));
    Speckle nearest{10, 0};
    for (int dz = -1; dz <= 1; ++dz)
        for (int dy = -1; dy <= 1; ++dy)
            for (int dx = -1; dx <= 1; ++dx) {
                const int x = ix + dx, y = iy + dy, z = iz + dz;
                const Float3 point{x + unit(hash_cell(x, y, z, seed)), y + unit(hash_cell(x, y, z, seed + 101)),
                                   z + unit(hash_cell(x, y, z, seed + 202))};
                const float distance = length(p - point);
                if (distance < nearest.distance) nearest = {distance, unit(hash_cell(x, y, z, seed + 303))};
            }
    return nearest;
}

}  // namespace ols

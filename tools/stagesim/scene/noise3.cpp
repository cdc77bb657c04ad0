// SPDX-License-Identifier: MIT
// Lattice noise; the lattice is hashed with integer arithmetic, so textures are the same everywhere.
#include "scene/noise3.hpp"

#include <algorithm>
#include <cstdint>

namespace ols {

namespace {

// What a coordinate of a cell brings to its hash.
uint32_t hash_x(int x) {
    return uint32_t(x) * 0x8da6b343u;
}
uint32_t hash_y(int y) {
    return uint32_t(y) * 0xd8163841u;
}
uint32_t hash_z(int z) {
    return uint32_t(z) * 0xcb1ab31fu;
}

// A bijective mix (the finaliser of MurmurHash3) of the cell's coordinates.
uint32_t mix_hash(uint32_t coordinates, uint32_t seed) {
    uint32_t h = coordinates ^ seed * 0x9e3779b9u;
    h ^= h >> 16;
    h *= 0x85ebca6bu;
    h ^= h >> 13;
    h *= 0xc2b2ae35u;
    return h ^ h >> 16;
}

float unit(uint32_t hash) {
    return float(hash >> 8) * 0x1p-24f;
}

// Perlin's twelve cube-edge gradients, four of them twice.
constexpr float gradients[16][3] = {{1, 1, 0},  {-1, 1, 0},  {1, -1, 0}, {-1, -1, 0}, {1, 0, 1},  {-1, 0, 1},
                                    {1, 0, -1}, {-1, 0, -1}, {0, 1, 1},  {0, -1, 1},  {0, 1, -1}, {0, -1, -1},
                                    {1, 1, 0},  {0, -1, 1},  {-1, 1, 0}, {0, -1, -1}};

float fade(float t) {
    return t * t * t * (t * (t * 6 - 15) + 10);
}

}  // namespace

float noise3(Float3 p, uint32_t seed) {
    const float fx = std::floor(p.x), fy = std::floor(p.y), fz = std::floor(p.z);
    const int ix = int(fx), iy = int(fy), iz = int(fz);
    const float x = p.x - fx, y = p.y - fy, z = p.z - fz;
    const float u = fade(x), v = fade(y), w = fade(z);
    const uint32_t hx[2] = {hash_x(ix), hash_x(ix + 1)}, hy[2] = {hash_y(iy), hash_y(iy + 1)},
                   hz[2] = {hash_z(iz), hash_z(iz + 1)};
    float corner[8];
    for (int i = 0; i < 8; ++i) {
        const int dx = i & 1, dy = i >> 1 & 1, dz = i >> 2;
        const float* g = gradients[mix_hash(hx[dx] ^ hy[dy] ^ hz[dz], seed) & 15];
        corner[i] = g[0] * (x - dx) + g[1] * (y - dy) + g[2] * (z - dz);
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

Speckle speckle3(Float3 p, uint32_t seed, float within) {
    const float fx = std::floor(p.x), fy = std::floor(p.y), fz = std::floor(p.z);
    const int ix = int(fx), iy = int(fy), iz = int(fz);
    const float x = p.x - fx, y = p.y - fy, z = p.z - fz;
    // p's own cell and its neighbours along an axis, with how far away they begin.
    constexpr int step[3] = {0, -1, 1};
    const float gap[3][3] = {{0, x, 1 - x}, {0, y, 1 - y}, {0, z, 1 - z}};
    Speckle nearest{10, 0};
    for (int k = 0; k < 3; ++k)
        for (int j = 0; j < 3; ++j)
            for (int i = 0; i < 3; ++i) {
                // A little farther than the nearest so far, for rounding.
                const float reach = std::min(within, nearest.distance) + 1e-4f;
                if (gap[0][i] * gap[0][i] + gap[1][j] * gap[1][j] + gap[2][k] * gap[2][k] > reach * reach) continue;
                const int cx = ix + step[i], cy = iy + step[j], cz = iz + step[k];
                const uint32_t cell = hash_x(cx) ^ hash_y(cy) ^ hash_z(cz);
                const Float3 point{cx + unit(mix_hash(cell, seed)), cy + unit(mix_hash(cell, seed + 101)),
                                   cz + unit(mix_hash(cell, seed + 202))};
                const float distance = length(p - point);
                if (distance < nearest.distance) nearest = {distance, unit(mix_hash(cell, seed + 303))};
            }
    return nearest;
}

}  // namespace ols

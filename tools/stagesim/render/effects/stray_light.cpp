// SPDX-License-Identifier: MIT
// One bounce off the board, divided into patches (radiosity: Goral et al. 1984, eq. 2 with point receivers).
#include "render/effects/stray_light.hpp"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <numbers>

#include "render/effects/shadows.hpp"

namespace ols {

namespace {

// A subject some patch widths away sees the board as smooth; nearer ones would see the patches.
constexpr int patches_across = 6, patches_down = 4;
constexpr Float3 board_normal{0, 0, 1};

bool sees(const Geometry& geometry, Float3 from, Float3 to) {
    RayPacket ray{};
    const Float3 way = to - from;
    const float origin[3] = {from.x, from.y, from.z}, direction[3] = {way.x, way.y, way.z};
    for (int axis = 0; axis < 3; ++axis) ray.origin[axis][0] = origin[axis], ray.direction[axis][0] = direction[axis];
    ray.active[0] = -1;
    ray.length[0] = 0.999f;
    std::array<bool, packet_size> clear;
    clear.fill(true);
    geometry.occlude(ray, clear);
    return clear[0];
}

}  // namespace

StrayLight::StrayLight(const Setup& setup, bool cast_shadows) : scene_(setup.scene), cast_shadows_(cast_shadows) {}

std::string StrayLight::caller(const Setup& setup) const {
    return setup.scene.board ? "scene: the matte board catches the sphere's light and lights the subject's rim" : "";
}

void StrayLight::divide_board(const Board& board) {
    const float width = float(board.width_m) / patches_across, height = float(board.height_m) / patches_down;
    const Float3 corner = to_float3(board.center_m) - Float3{float(board.width_m) / 2, float(board.height_m) / 2, 0};
    patches_.clear();
    for (int y = 0; y < patches_down; ++y)
        for (int x = 0; x < patches_across; ++x)
            patches_.push_back({corner + Float3{(x + 0.5f) * width, (y + 0.5f) * height, 0}, width * height});
}

void StrayLight::light_patches(const std::vector<PlacedLamp>& lamps, const Geometry& geometry) {
    radiosity_.assign(lamps.size() * patches_.size(), 0);
    tbb::parallel_for(size_t(0), lamps.size(), [&](size_t l) {
        for (size_t p = 0; p < patches_.size(); ++p) {
            const Float3 point = patches_[p].center + board_normal * shadow_offset_m;
            const Float3 way = lamps[l].position_m - point;
            const float distance = length(way), cosine = dot(way, board_normal) / distance;
            if (cosine <= 0 || (cast_shadows_ && !sees(geometry, point, lamps[l].position_m))) continue;
            const float gain = lamps[l].reach_m / distance;
            radiosity_[l * patches_.size() + p] = scene_.board->albedo * cosine * gain * gain;
        }
    });
}

void StrayLight::find_shares(const VisiblePoints& points, const Geometry& geometry) {
    std::vector<std::vector<Share>> of_chunk(points.chunks.size());
    first_share_.assign(points.size() + 1, 0);
    tbb::parallel_for(size_t(0), points.chunks.size(), [&](size_t c) {
        const auto& chunk = points.chunks[c];
        for (uint32_t i = chunk.first_point; i < chunk.first_point + chunk.points; ++i) {
            const Float3 n{points.normal[0][i], points.normal[1][i], points.normal[2][i]};
            const Float3 x =
                Float3{points.position[0][i], points.position[1][i], points.position[2][i]} + n * shadow_offset_m;
            uint32_t count = 0;
            for (uint32_t p = 0; p < patches_.size() && !points.on_board[i]; ++p) {
                const Float3 way = patches_[p].center - x;
                const float squared = dot(way, way);
                const float here = dot(way, n), there = -dot(way, board_normal);
                if (here <= 0 || there <= 0 || (cast_shadows_ && !sees(geometry, x, patches_[p].center))) continue;
                const float factor =
                    here * there * patches_[p].area_m2 / (std::numbers::pi_v<float> * squared * squared);
                of_chunk[c].push_back({p, factor});
                ++count;
            }
            first_share_[i + 1] = count;
        }
    });
    shares_.clear();
    for (const auto& shares : of_chunk) shares_.insert(shares_.end(), shares.begin(), shares.end());
    for (size_t i = 0; i < points.size(); ++i) first_share_[i + 1] += first_share_[i];
}

void StrayLight::prepare(const VisiblePoints& points, const std::vector<PlacedLamp>& lamps, const Geometry& geometry) {
    divide_board(*scene_.board);
    light_patches(lamps, geometry);
    find_shares(points, geometry);
}

uint32_t StrayLight::apply_packet(LightPacket& packet) const {
    const float* radiosity = radiosity_.data() + packet.lamp_index * patches_.size();
    uint32_t evaluations = 0;
    for (int i = 0; i < packet_size; ++i) {
        const uint32_t p = packet.first + i;
        float irradiance = 0;
        for (uint32_t s = first_share_[p]; s < first_share_[p + 1]; ++s)
            irradiance += shares_[s].factor * radiosity[shares_[s].patch];
        evaluations += first_share_[p + 1] - first_share_[p];
        if (irradiance > 0)
            for (int c = 0; c < 3; ++c) packet.reflected[c][i] += packet.points.albedo[c][p] * irradiance;
    }
    return evaluations;
}

}  // namespace ols

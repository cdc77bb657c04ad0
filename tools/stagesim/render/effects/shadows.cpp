// SPDX-License-Identifier: MIT
// Occlusion rays, gathered into full packets.
#include "render/effects/shadows.hpp"

#include <tbb/parallel_for.h>

#include <algorithm>

namespace ols {

namespace {

// Gathers rays until a packet is full, casts it, and darkens the points whose ray was blocked.
class RayGatherer {
  public:
    explicit RayGatherer(std::span<LightPacket> packets) : packets_(packets) {}

    // Casts for the point unless the lamp does not reach it anyway; `point` counts from the packets' first.
    void add(uint32_t point) {
        LightPacket& packet = packets_[point / packet_size];
        const int lane = int(point % packet_size);
        const uint32_t p = packet.first + uint32_t(lane);
        if (packet.irradiance[lane] <= 0 || packet.points.weight[p] <= 0) return;
        for (int axis = 0; axis < 3; ++axis) {
            rays_.origin[axis][count_] =
                packet.points.position[axis][p] + shadow_offset_m * packet.points.normal[axis][p];
            rays_.direction[axis][count_] = packet.to_lamp[axis][lane];
        }
        rays_.length[count_] = packet.distance_m[lane];
        targets_[count_] = &packet.irradiance[lane];
        if (++count_ == packet_size) flush();
    }

    void flush() {
        if (count_ == 0) return;
        for (int i = 0; i < packet_size; ++i) rays_.active[i] = i < count_ ? -1 : 0;
        std::array<bool, packet_size> clear;
        clear.fill(true);
        packets_[0].geometry.occlude(rays_, clear);
        for (int i = 0; i < count_; ++i)
            if (!clear[i]) *targets_[i] = 0;
        cast_ += uint64_t(count_);
        count_ = 0;
    }

    uint64_t cast() const { return cast_; }

  private:
    std::span<LightPacket> packets_;
    RayPacket rays_{};
    std::array<float*, packet_size> targets_{};
    int count_ = 0;
    uint64_t cast_ = 0;
};

}  // namespace

Shadows::Shadows(const Setup& setup)
    : step_px_(setup.scene.shadow_step_px),
      camera_m_(Pinhole(setup.camera).position()),
      pixel_angle_(Pinhole(setup.camera).pixel_angle()) {}

std::string Shadows::caller(const Setup& setup) const {
    const auto& objects = setup.scene.objects;
    for (const Object& object : objects)
        if (!object.is_convex) return "scene: '" + object.name + "' can hide parts of itself";
    if (objects.size() > 1) return "scene: '" + objects[0].name + "' and '" + objects[1].name + "' can hide each other";
    return "";
}

void Shadows::prepare(const VisiblePoints& points, const std::vector<PlacedLamp>&, const Geometry&) {
    if (step_px_ == 1) return;
    lattices_.resize(points.chunks.size());
    tbb::parallel_for(size_t(0), lattices_.size(),
                      [&](size_t c) { lattices_[c] = lay_lattice(points, points.chunks[c]); });
}

// Cells share the lattice's pixels: the cell with index (i, j) spans pixels step i to step (i + 1), both inclusive.
Shadows::Lattice Shadows::lay_lattice(const VisiblePoints& points, const VisiblePoints::Chunk& chunk) const {
    const int across = (VisiblePoints::tile_pixels - 1) / step_px_;
    Lattice lattice;
    lattice.cells.resize(size_t(across) * size_t(across));
    std::vector<int> pixels(lattice.cells.size(), 0);
    uint32_t last_pixel = ~0u;
    for (uint32_t i = 0; i < chunk.points; ++i) {
        const uint32_t p = chunk.first_point + i, pixel = points.pixels[points.pixel[p]];
        const int x = int(pixel % uint32_t(points.width)) % VisiblePoints::tile_pixels,
                  y = int(pixel / uint32_t(points.width)) % VisiblePoints::tile_pixels;
        if (points.weight[p] == 0) continue;  // fills up the last packet
        const bool on_lattice = x % step_px_ == 0 && y % step_px_ == 0;
        if (on_lattice) lattice.points.push_back(uint16_t(i));
        for (int cy = (y - 1) / step_px_; cy <= std::min(y / step_px_, across - 1); ++cy)
            for (int cx = (x - 1) / step_px_; cx <= std::min(x / step_px_, across - 1); ++cx) {
                const size_t c = size_t(cy * across + cx);
                Cell& cell = lattice.cells[c];
                pixels[c] += pixel != last_pixel;
                if (on_lattice) cell.corners.push_back(uint16_t(i));
                // A point on the border of two cells is the later one's to cast for, and at the tile's end the earlier's.
                else if (cx == std::min(x / step_px_, across - 1) && cy == std::min(y / step_px_, across - 1))
                    cell.others.push_back(uint16_t(i));
            }
        last_pixel = pixel;
    }
    for (size_t c = 0; c < lattice.cells.size(); ++c) {
        const bool whole = pixels[c] == (step_px_ + 1) * (step_px_ + 1);
        lattice.cells[c].smooth = whole && is_smooth(points, chunk, lattice.cells[c]);
    }
    return lattice;
}

// Its points are as near to each other as on a plane tilted by up to some 60 degrees.
bool Shadows::is_smooth(const VisiblePoints& points, const VisiblePoints::Chunk& chunk, const Cell& cell) const {
    const auto position = [&](uint32_t i) {
        const uint32_t p = chunk.first_point + i;
        return Float3{points.position[0][p], points.position[1][p], points.position[2][p]};
    };
    const Float3 first = position(cell.corners[0]);
    const float limit = 3 * float(step_px_) * pixel_angle_ * length(first - camera_m_);
    const auto near = [&](uint32_t i) { return length(position(i) - first) < limit; };
    return std::all_of(cell.corners.begin(), cell.corners.end(), near) &&
           std::all_of(cell.others.begin(), cell.others.end(), near);
}

uint64_t Shadows::apply(std::span<LightPacket> packets) const {
    const VisiblePoints& points = packets[0].points;
    if (step_px_ > 1) {
        const auto chunk = std::lower_bound(points.chunks.begin(), points.chunks.end(), packets[0].first,
                                            [](const auto& c, uint32_t first) { return c.first_point < first; });
        return apply_on_lattice(packets, lattices_[size_t(chunk - points.chunks.begin())]);
    }
    RayGatherer rays(packets);
    for (uint32_t i = 0; i < packets.size() * packet_size; ++i) rays.add(i);
    rays.flush();
    return rays.cast();
}

uint64_t Shadows::apply_on_lattice(std::span<LightPacket> packets, const Lattice& lattice) const {
    const auto irradiance = [&](uint32_t i) -> float& { return packets[i / packet_size].irradiance[i % packet_size]; };
    std::vector<bool> facing(packets.size() * packet_size);
    for (const uint16_t i : lattice.points) facing[i] = irradiance(i) > 0;
    RayGatherer rays(packets);
    for (const uint16_t i : lattice.points) rays.add(i);
    rays.flush();
    for (const Cell& cell : lattice.cells) {
        const auto clear = [&](uint16_t i) { return irradiance(i) > 0; };
        const auto blocked = [&](uint16_t i) { return facing[i] && irradiance(i) == 0; };
        if (cell.smooth && std::all_of(cell.corners.begin(), cell.corners.end(), clear)) continue;
        if (cell.smooth && std::all_of(cell.corners.begin(), cell.corners.end(), blocked))
            for (const uint16_t i : cell.others) irradiance(i) = 0;
        else
            for (const uint16_t i : cell.others) rays.add(i);
    }
    rays.flush();
    return rays.cast();
}

}  // namespace ols

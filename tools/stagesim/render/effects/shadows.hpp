// SPDX-License-Identifier: MIT
// Points that something hides from the lamp get no light. Lamps are points, so shadows are hard.
#pragma once

#include "render/effects/effect.hpp"

namespace ols {

// A ray from every point that the lamp could light; or, with a scene's shadow_step_px above 1, an approximation: rays
// from the pixels of a lattice of that step, and from the pixels of a lattice cell only where its four corners do not
// all see the lamp or all not see it, or where the surface is not smooth and whole over the cell. It misses what is
// smaller than a cell: the shadow of a thing thinner than the step that falls between lattice points.
class Shadows : public LightEffect {
  public:
    explicit Shadows(const Setup& setup);
    const char* name() const override { return "shadows"; }
    const char* evaluation() const override { return "ray"; }
    std::string caller(const Setup& setup) const override;
    Stage stage() const override { return Stage::arrive; }
    void prepare(const VisiblePoints& points, const std::vector<PlacedLamp>& lamps, const Geometry& geometry) override;
    uint64_t apply(std::span<LightPacket> packets) const override;

  private:
    // Points of a chunk, counted from its first one.
    struct Cell {
        std::vector<uint16_t> corners, others;
        bool smooth = false;  // one whole surface
    };
    struct Lattice {
        std::vector<uint16_t> points;
        std::vector<Cell> cells;
    };
    Lattice lay_lattice(const VisiblePoints& points, const VisiblePoints::Chunk& chunk) const;
    bool is_smooth(const VisiblePoints& points, const VisiblePoints::Chunk& chunk, const Cell& cell) const;
    uint64_t apply_on_lattice(std::span<LightPacket> packets, const Lattice& lattice) const;

    int step_px_;
    Float3 camera_m_;
    float pixel_angle_;              // radians
    std::vector<Lattice> lattices_;  // of each chunk, by its place in points.chunks; with step_px_ above 1
};

// Rays start this far off the surface along its shading normal, so as not to meet it again; more than the sagitta of
// the finest facets (0.03 mm), less than any gap that should cast a shadow.
constexpr float shadow_offset_m = 1e-4f;

}  // namespace ols

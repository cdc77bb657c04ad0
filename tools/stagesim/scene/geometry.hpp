// SPDX-License-Identifier: MIT
// Ray casting against a scene at one moment, on Embree 3.
#pragma once

#include <array>
#include <memory>
#include <optional>

#include "scene/scene.hpp"

namespace ols {

constexpr int packet_size = 8;

// Rays from eight points, as arrays; only those marked in `active` (-1, else 0) are cast.
struct RayPacket {
    alignas(32) int active[packet_size];
    alignas(32) float origin[3][packet_size];
    alignas(32) float direction[3][packet_size];  // need not be of unit length
    alignas(32) float length[packet_size];        // in units of direction
};

struct SurfaceHit {
    Float3 position;       // metres, at this moment
    Float3 normal;         // unit, interpolated, at this moment
    Float3 rest_position;  // of the object before it moved, its face neutral
    Float3 rest_normal;    // of the object before it moved, its face as it is
    Float3 mask;
    uint32_t object, material;
    uint32_t triangle = 0;  // of a mesh, with the place in it: weights of its second and third corner
    float u = 0, v = 0;
    Pose pose;
};

class Geometry {
  public:
    // Builds the hierarchy and places every object; the scene must outlive this.
    Geometry(const Scene& scene, double time_us);
    ~Geometry();
    Geometry(Geometry&&) noexcept;
    Geometry& operator=(Geometry&&) noexcept;

    // Moves what moved since; false when nothing did. The geometry is then the same, to the bit, as one that was
    // constructed at this time.
    bool place(double time_us);

    // The nearest surface that a ray from `origin` along `direction` meets.
    std::optional<SurfaceHit> intersect(Float3 origin, Float3 direction) const;

    // A box around everything, now: its least and greatest corner.
    std::array<Float3, 2> bounds() const;

    // Where the surface point that a hit met, perhaps at another time, is now.
    Float3 position_of(const SurfaceHit& hit) const;

    // Clears `clear[i]` for every active ray that something blocks.
    void occlude(const RayPacket& rays, std::array<bool, packet_size>& clear) const;

  private:
    struct State;
    std::unique_ptr<State> state_;
};

}  // namespace ols

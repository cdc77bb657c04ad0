// SPDX-License-Identifier: MIT
// An effect is one part of the physics that is computed only when something calls for it (a shadow needs something that
// casts it). One nobody calls for is not even made: it costs nothing and the picture has the same bits as with it
// disabled. To add one: derive, and list it in effect_set.cpp.
#pragma once

#include <algorithm>
#include <array>
#include <atomic>
#include <cstdint>
#include <span>
#include <string>

#include "image/frame.hpp"
#include "render/placed_lamp.hpp"
#include "render/visible_points.hpp"
#include "scene/geometry.hpp"
#include "stage/stage.hpp"

namespace ols {

// What an effect looks at to see whether it is called for.
struct Setup {
    const Scene& scene;
    const StageConfig& stage;
    const CameraConfig& camera;
    bool camera_model = true;  // off: linear light without noise, mosaic, quantisation and saturation
};

class Effect {
  public:
    virtual ~Effect() = default;
    virtual const char* name() const = 0;
    // Who calls for it, for `plan`; empty when nobody does.
    virtual std::string caller(const Setup& setup) const = 0;
    // What one evaluation is: "ray", "sample", ...
    virtual const char* evaluation() const = 0;

    uint64_t evaluations() const { return evaluations_.load(); }
    void count(uint64_t evaluations) { evaluations_ += evaluations; }

  private:
    std::atomic<uint64_t> evaluations_ = 0;
};

// One value for each point of a packet. Loops over packets work on these rather than on the arrays they come from: the compiler
// then knows that what it writes is not what it reads, and makes vector instructions of them.
struct Lanes {
    alignas(32) float at[packet_size];

    static Lanes of(const std::vector<float>& values, uint32_t first) {
        Lanes lanes;
        std::copy_n(values.data() + first, packet_size, lanes.at);
        return lanes;
    }
    float operator[](int i) const { return at[i]; }
    float& operator[](int i) { return at[i]; }
};

// Of three coordinates or colours.
using Lanes3 = std::array<Lanes, 3>;
inline Lanes3 lanes_of(const std::vector<float> (&values)[3], uint32_t first) {
    return {Lanes::of(values[0], first), Lanes::of(values[1], first), Lanes::of(values[2], first)};
}

// One lamp's light on one packet of points on its way to the camera.
struct LightPacket {
    const VisiblePoints& points;
    uint32_t first;  // of the packet, in points
    const PlacedLamp& lamp;
    uint32_t lamp_index;
    const Geometry& geometry;

    // 1 where the lamp is meant to light the point at all, 0 elsewhere (board lamps and subject).
    Lanes receives;
    // Set up for a lamp at infinity: direction and cosine only.
    Lanes3 to_lamp;  // unit
    Lanes distance_m;
    Lanes irradiance;  // on the surface, in units of the lamp's at its aim, facing it
    // pi L / E: what the camera sees, in units of a white matte surface facing the lamp at its aim.
    Lanes3 reflected;

    // Whether the lamp's own light arrives at any of the points: about half of all packets face away.
    bool is_lit() const {
        bool lit = false;
        for (const float e : irradiance.at) lit |= !(e <= 0);
        return lit;
    }
};

// Light from lamp to camera. `prepare` is called once for a scene at one moment; `apply` then from many threads.
class LightEffect : public Effect {
  public:
    // arrive: changes how light arrives (direction, irradiance); reflect: adds to what leaves towards the camera.
    enum class Stage { arrive, reflect };
    virtual Stage stage() const = 0;
    virtual void prepare(const VisiblePoints&, const std::vector<PlacedLamp>&, const Geometry&) {}
    // All packets of a chunk of points under one lamp. Returns how many evaluations it made.
    virtual uint64_t apply(std::span<LightPacket> packets) const = 0;
};

// An effect that looks at one packet at a time.
class PacketEffect : public LightEffect {
  public:
    uint64_t apply(std::span<LightPacket> packets) const override {
        uint64_t evaluations = 0;
        for (LightPacket& packet : packets) evaluations += apply_packet(packet);
        return evaluations;
    }
    virtual uint32_t apply_packet(LightPacket& packet) const = 0;
};

// An exposure on the sensor: counts above black, channels as the camera delivers them (1 mosaic, 3 RGB).
struct Exposure {
    Image counts;
    uint32_t camera = 0;
    uint64_t number = 0;  // counts the camera's exposures: the key of the noise
};

class SensorEffect : public Effect {
  public:
    virtual void apply(Exposure& exposure) = 0;
};

}  // namespace ols

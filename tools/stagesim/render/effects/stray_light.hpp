// SPDX-License-Identifier: MIT
// Light that the matte board lets in: sphere lamps light the board the camera sees, and the lit board lights the
// subject's rim. Without it the board sees its own lamps only and the subject only the sphere's.
#pragma once

#include "render/effects/effect.hpp"

namespace ols {

class StrayLight : public PacketEffect {
  public:
    const char* name() const override { return "stray"; }
    const char* evaluation() const override { return "point and board patch"; }
    std::string caller(const Setup& setup) const override;
    Stage stage() const override { return Stage::reflect; }

    StrayLight(const Setup& setup, bool cast_shadows);
    void prepare(const VisiblePoints& points, const std::vector<PlacedLamp>& lamps, const Geometry& geometry) override;
    uint32_t apply_packet(LightPacket& packet) const override;

  private:
    struct Patch {
        Float3 center;
        float area_m2;
    };
    struct Share {
        uint32_t patch;
        float factor;  // share of the patch's radiosity that arrives as irradiance
    };
    void divide_board(const Board& board);
    void find_shares(const VisiblePoints& points, const Geometry& geometry);
    void light_patches(const std::vector<PlacedLamp>& lamps, const Geometry& geometry);

    const Scene& scene_;
    bool cast_shadows_;
    std::vector<Patch> patches_;
    std::vector<float> radiosity_;       // [lamp * patches + patch], in units of the lamp's irradiance at its aim
    std::vector<Share> shares_;          // of all points, one after the other
    std::vector<uint32_t> first_share_;  // a point's first, and one past the last point's
};

}  // namespace ols

// SPDX-License-Identifier: MIT
// Places lamps from the stage's geometry.
#include "render/placed_lamp.hpp"

namespace ols {

std::vector<PlacedLamp> place_lamps(const StageConfig& stage, const Scene& scene) {
    std::vector<PlacedLamp> lamps;
    const auto place = [&](Float3 aim, Float3 position, bool matte) {
        const float reach = length(position - aim);
        lamps.push_back({position, normalized(position - aim), aim, reach, float(stage.lamp_beam_exponent), matte});
    };
    for (const LightPosition& lamp : stage.lamps) place({}, to_float3(lamp.direction * stage.radius_m), false);
    const Vec3 board = scene.board ? scene.board->center_m : Board{}.center_m;
    for (const Vec3 position : stage.matte_lamps_m) place(to_float3(board), to_float3(position), true);
    return lamps;
}

}  // namespace ols

// SPDX-License-Identifier: MIT
// Motion, of objects and of faces: the scene is placed anew at the middle of every exposure. Within an exposure (some 0.4 ms) it stands.
#pragma once

#include "render/effects/effect.hpp"

namespace ols {

class Movement : public Effect {
  public:
    const char* name() const override { return "motion"; }
    const char* evaluation() const override { return "placing of the scene"; }
    std::string caller(const Setup& setup) const override {
        for (const Object& object : setup.scene.objects)
            if (moves(object)) return "scene: '" + object.name + "' moves";
        return "";
    }
};

}  // namespace ols

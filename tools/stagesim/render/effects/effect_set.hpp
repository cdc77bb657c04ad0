// SPDX-License-Identifier: MIT
// The effects that a scene, stage and camera call for, in the order in which light meets them.
#pragma once

#include <memory>
#include <set>

#include "render/effects/effect.hpp"
#include "render/effects/mosaic.hpp"
#include "render/effects/movement.hpp"

namespace ols {

class EffectSet {
  public:
    // Every effect known, called for or not.
    struct Row {
        std::string name, caller, evaluation;
        bool disabled = false;
        bool active() const { return !caller.empty() && !disabled; }
        uint64_t evaluations = 0;
    };

    EffectSet(const Setup& setup, const std::set<std::string>& disabled);

    const std::vector<LightEffect*>& arriving() const { return arriving_; }
    const std::vector<LightEffect*>& reflecting() const { return reflecting_; }
    const std::vector<SensorEffect*>& sensor() const { return sensor_; }
    bool active(const std::string& name) const;
    // Null when not active.
    Mosaic* mosaic() const { return mosaic_; }
    Movement* movement() const { return movement_; }

    // With the evaluations made so far.
    std::vector<Row> rows() const;

  private:
    std::vector<Row> rows_;
    std::vector<std::unique_ptr<Effect>> effects_;  // as rows_; null when not active
    std::vector<LightEffect*> arriving_, reflecting_;
    std::vector<SensorEffect*> sensor_;
    Mosaic* mosaic_ = nullptr;
    Movement* movement_ = nullptr;
};

// The names that `--disable-effect` understands.
std::vector<std::string> effect_names();

}  // namespace ols

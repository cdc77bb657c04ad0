// SPDX-License-Identifier: MIT
// The list of all effects.
#include "render/effects/effect_set.hpp"

#include "render/effects/beam.hpp"
#include "render/effects/falloff.hpp"
#include "render/effects/quantisation.hpp"
#include "render/effects/sensor_noise.hpp"
#include "render/effects/shadows.hpp"
#include "render/effects/specular.hpp"
#include "render/effects/stray_light.hpp"
#include "render/effects/vignetting.hpp"

namespace ols {

namespace {

// In the order in which light meets them: shadows need the falloff's directions, noise the vignetted light.
std::vector<std::unique_ptr<Effect>> all_effects(const Setup& setup, const std::set<std::string>& disabled) {
    std::vector<std::unique_ptr<Effect>> all;
    all.push_back(std::make_unique<Movement>());
    all.push_back(std::make_unique<Falloff>());
    all.push_back(std::make_unique<Beam>());
    all.push_back(std::make_unique<Shadows>(setup));
    const bool shadows = !disabled.contains("shadows") && !all.back()->caller(setup).empty();
    all.push_back(std::make_unique<Specular>());
    all.push_back(std::make_unique<StrayLight>(setup, shadows));
    all.push_back(std::make_unique<Mosaic>(setup.camera));
    all.push_back(std::make_unique<Vignetting>(setup.camera));
    all.push_back(std::make_unique<SensorNoise>(setup.camera, setup.scene.seed));
    all.push_back(std::make_unique<Quantisation>(setup.camera));
    return all;
}

}  // namespace

EffectSet::EffectSet(const Setup& setup, const std::set<std::string>& disabled) {
    effects_ = all_effects(setup, disabled);
    for (auto& effect : effects_) {
        rows_.push_back(
            {effect->name(), effect->caller(setup), effect->evaluation(), disabled.contains(effect->name())});
        if (!rows_.back().active()) effect.reset();
        if (auto* light = dynamic_cast<LightEffect*>(effect.get()))
            (light->stage() == LightEffect::Stage::arrive ? arriving_ : reflecting_).push_back(light);
        if (auto* sensor = dynamic_cast<SensorEffect*>(effect.get())) sensor_.push_back(sensor);
        if (auto* mosaic = dynamic_cast<Mosaic*>(effect.get())) mosaic_ = mosaic;
        if (auto* movement = dynamic_cast<Movement*>(effect.get())) movement_ = movement;
    }
}

bool EffectSet::active(const std::string& name) const {
    for (const Row& row : rows_)
        if (row.name == name) return row.active();
    return false;
}

std::vector<EffectSet::Row> EffectSet::rows() const {
    std::vector<Row> rows = rows_;
    for (size_t i = 0; i < rows.size(); ++i)
        if (effects_[i]) rows[i].evaluations = effects_[i]->evaluations();
    return rows;
}

std::vector<std::string> effect_names() {
    return {"motion", "falloff", "beam",       "shadows", "specular",
            "stray",  "mosaic",  "vignetting", "noise",   "quantisation"};
}

}  // namespace ols

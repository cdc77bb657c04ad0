// SPDX-License-Identifier: MIT
// What a scene will cost: who calls for which effect, and how much work that is, foretold and, after a run, as it was.
#pragma once

#include <nlohmann/json.hpp>
#include <set>

#include "render/renderer.hpp"

namespace ols {

// Foretells the cost of one placing of the scene under all lamps and of one exposure with half of the lamps lit, by
// rendering a picture of a sixth of the width and height. Its rays lie farther apart and are less alike, so the foretold
// seconds err on the high side, by up to a factor of two.
//   effects: [{name, caller, active, disabled, evaluation, evaluations}]
//   primary_rays, lamp_points; seconds: {build, visibility, lamps, exposure}; moving: lamps are shaded anew for each exposure
nlohmann::json foretell(const Setup& setup, const std::set<std::string>& disabled);

// The same of what was done, with the number of exposures.
nlohmann::json account(const Renderer& renderer);

// The plan as text for people; `actual` beside it unless null.
std::string plan_text(const nlohmann::json& foretold, const nlohmann::json& actual);

}  // namespace ols

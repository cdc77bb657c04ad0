// SPDX-License-Identifier: MIT
// The frames of a cycle without board, clock and ring: what a bench or a test of later stages records quickly. The whole
// chain is `stagesim run`.
#pragma once

#include <memory>
#include <optional>
#include <vector>

#include "render/renderer.hpp"
#include "stage/sequence.hpp"

namespace ols {

// Scene time of the middle of a slot's exposure: time 0 is the first trigger that this camera gets. Frozen at this
// moment, `Renderer::light` gives the truth of what is made of that slot.
double slot_time_us(const Sequence& sequence, const CameraConfig& camera, uint32_t cycle, size_t slot);

// The frame that the camera delivers of a slot: one of render_slots(), rendered alone. Null where the camera is not triggered.
// With `frozen_us` the scene stands as it does at that time.
Result<std::shared_ptr<const Frame>> render_slot(Renderer& renderer, const Setup& setup, const Sequence& sequence,
                                                 uint32_t cycle, size_t slot, std::optional<double> frozen_us = {});

// The frames that the camera delivers of a cycle, by slot, each identified and with the noise of its place in the take;
// null where the camera is not triggered. Frames are the same, to the bit, as those of VirtualCamera, and do not depend
// on which cycles were rendered before. `renderer` must be made of `setup`.
// Error: a slot of grey levels, whose planes only the board lays out in time.
Result<std::vector<std::shared_ptr<const Frame>>> render_slots(Renderer& renderer, const Setup& setup,
                                                               const Sequence& sequence, uint32_t cycle);

// The scene frozen at `time_us` under each lamp of the stage alone, lit for `exposure_us`: what a camera without noise counts
// above black, with its gain, vignetting and colour filter (one channel; three without a mosaic), unrounded and without
// saturation. What a slot of these lamps should count, were the subject still, is their sum.
std::vector<Image> render_lamps(const Setup& setup, double exposure_us, double time_us);

}  // namespace ols

// SPDX-License-Identifier: MIT
// Frames, sequence and identification as JSON.
#include "take/provenance.hpp"

#include <fmt/format.h>

#include <algorithm>

#include "record/record_json.hpp"

namespace ols {

namespace {

// Noise variance of a recovered image over that of one row image, mean over lamps, for noise that does not depend on light.
double noise_gain(const Basis& basis) {
    double sum = 0;
    for (int image = 0; image < basis.images(); ++image) sum += noise_variance(basis, image);
    return sum / basis.images();
}

nlohmann::json describe_sequence(const Sequence& sequence) {
    auto kinds = std::string();
    for (const Slot& slot : sequence.slots) kinds += slot_kind_name(slot.kind)[0];
    return {{"basis", sequence.basis.name},
            {"cycles", sequence.config.cycles},
            {"slots", sequence.slots.size()},
            {"kinds", kinds},  // one letter a slot: basis, tracking, matte, dark
            {"frame_rate_hz", sequence.config.frame_rate_hz},
            {"tick_hz", tick_hz},
            {"period_ticks", sequence.slots.front().period_ticks},
            {"exposure_us",
             {{"basis", sequence.config.basis_exposure_us},
              {"tracking", sequence.config.tracking_exposure_us},
              {"matte", sequence.config.matte_exposure_us}}},
            {"noise_gain", noise_gain(sequence.basis)}};
}

nlohmann::json describe_motion(const Sequence& sequence, const TakeTargets& targets) {
    const double half_cycle_s = 0.5 * double(sequence.cycle_ticks()) / double(tick_hz);
    return {{"quality", targets.quality.name},
            {"tracking_frames_a_target", targets.every},
            {"tracking_rate_hz", tracking_rate_hz(sequence)},
            // Of the basis, before and after a target.
            {"reach_ms", 1e3 * half_cycle_s * (targets.quality.interpolates ? 2 : 1)}};
}

}  // namespace

nlohmann::json provenance_of(const CycleFrames& frames, const TakeDescription& take) {
    const Sequence& sequence = take.sequence;
    nlohmann::json json = {{"cycle", frames.cycle}, {"witnesses", take.witnesses}};
    int used = 0;
    for (const auto& frame : frames.slots) {
        if (!frame) continue;
        if (used++ == 0) {
            json["first_tick"] = frame->tick;
            json["exposure_ticks"] = frame->exposure_ticks;
        }
        json["last_tick"] = frame->tick;
    }
    json["basis_slots"] = sequence.basis.rows;
    json["frames"] = used;
    json["missing_slots"] = missing_basis_slots(frames, sequence);
    for (size_t s = 0; s < frames.neighbours.size(); ++s)
        if (!frames.neighbours[s].empty()) json["slots_from_neighbours"].push_back(s);
    return json;
}

nlohmann::json provenance_of(const TargetFrames& frames, const TakeDescription& take) {
    const Sequence& sequence = take.sequence;
    const uint64_t length = sequence.slots.size();
    nlohmann::json json = {{"cycle", frames.basis.target / length},
                           {"slot", frames.basis.target % length},
                           {"witnesses", take.witnesses},
                           {"basis_slots", sequence.basis.rows},
                           {"frames", frames.frames.size() + frames.tracking.size()},
                           {"matte_frames", frames.matte.size()},
                           {"missing_slots", frames.basis.lost}};
    for (const auto& one : frames.tracking)
        if (one.number == frames.basis.target) json["tick"] = one.frame->tick;
    const auto by_tick = [](const auto& frame) { return frame->tick; };
    if (!frames.frames.empty()) {
        json["first_tick"] = std::ranges::min(frames.frames, {}, by_tick)->tick;
        json["last_tick"] = std::ranges::max(frames.frames, {}, by_tick)->tick;
        json["exposure_ticks"] = frames.frames.front()->exposure_ticks;
    }
    for (const auto& choice : frames.basis.choices)
        if (choice.is_stand_in) json["slots_from_neighbours"].push_back(choice.slot);
    for (const uint64_t number : frames.lost_tracking)
        json["tracking_missing"].push_back({{"cycle", number / length}, {"slot", number % length}});
    return json;
}

nlohmann::json origin_of(const Board& board) {
    return {{"board", {{"id", board.id()}, {"firmware", board.info().firmware_version}}}};
}

nlohmann::json origin_of(const RecordedFrames& frames, const RecordingPlace& place, const Sequence& sequence) {
    const RecordingFacts& facts = frames.facts();
    return {{"recording",
             {{"frames", facts.frames()},
              {"first_number", facts.numbers.front()},
              {"last_number", facts.numbers.back()},
              {"times", facts.has_times ? "the camera's" : "number times period"},
              {"first_slot", place.first_slot},
              {"cycles",
               "counted from the first whole one of the recording; which one of the play that was cannot be known"},
              {"ticks", fmt::format("made up: the trigger's number from cycle 0 on times {} ticks",
                                    sequence.slots.front().period_ticks)},
              {"said", facts.said},
              {"file", facts.detail}}}};
}

nlohmann::json describe_take(const TakeDescription& take, const TakeTargets& targets, const nlohmann::json& origin,
                             const RecordReport& record, const std::vector<nlohmann::json>& missing,
                             const SuspicionReport& suspicion) {
    nlohmann::json identification = record_json(record);
    for (size_t n = 0; n < missing.size(); ++n) identification["cameras"][n]["missing"] = missing[n];
    nlohmann::json json = {{"sequence", describe_sequence(take.sequence)},
                           {"calibration", take.calibration.source},
                           {"identification", std::move(identification)}};
    json.update(origin);
    if (!suspicion.targets.is_null()) json["suspect_targets"] = suspicion.targets;
    if (!suspicion.lamps.is_null()) json["suspect_lamps"] = suspicion.lamps;
    if (targets.every > 0) json["motion"] = describe_motion(take.sequence, targets);
    return json;
}

}  // namespace ols

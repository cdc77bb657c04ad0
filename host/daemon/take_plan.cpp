// SPDX-License-Identifier: MIT
// From configuration and request to a plan.
#include "daemon/take_plan.hpp"

#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cmath>
#include <cstring>
#include <filesystem>

namespace ols {

namespace fs = std::filesystem;

namespace {

constexpr double cycles_max = 1'000'000;

Status check_word(const DaemonSetup& setup, const char* key, const std::string& word,
                  const std::vector<std::string>& known) {
    if (word.empty() || std::ranges::find(known, word) != known.end()) return Done{};
    std::string all;
    for (const std::string& one : known) all += (all.empty() ? "" : ", ") + one;
    return fail(fmt::format("{} is '{}', which is none of: {}", setup.places.at(key), word, all));
}

Status check_folder(const DaemonSetup& setup, const char* key, const fs::path& folder, bool makes_it) {
    std::error_code error;
    fs::path there = fs::absolute(folder, error);
    if (makes_it)
        fs::create_directories(there, error);
    else  // it would be made in the last folder of its path that is there
        while (there.has_relative_path() && !fs::exists(there, error)) there = there.parent_path();
    if (fs::is_directory(there, error) && ::access(there.c_str(), W_OK | X_OK) == 0) return Done{};
    const int why = error ? error.value() : errno;
    return fail(fmt::format("{} is '{}', which is no folder that this user may write to ({}): {}", setup.places.at(key),
                            folder.string(), std::strerror(why),
                            why == EROFS
                                ? "if its disk is not read-only, the unit keeps it from the daemon: `systemctl edit "
                                  "stagectl`, [Service], ReadWritePaths="
                                : "make it, and give it to the daemon's user"));
}

TakeChoices choices_of(const TakeRequest& request, const DaemonSetup& setup) {
    TakeChoices choices;
    choices.nominal = setup.nominal;
    choices.fps = request.fps.value_or(setup.fps);
    choices.quality = choices.fps == 0 ? "" : request.quality.empty() ? setup.quality : request.quality;
    choices.fill = setup.fill;
    choices.estimate = setup.estimate;
    choices.witness_step = setup.witness_step;
    choices.single_float = setup.single_float;
    choices.slate.production = setup.production;
    choices.slate.scene = request.slate;
    choices.slate.notes = request.notes;
    return choices;
}

}  // namespace

TakeRequest TakeRequest::completed_by(const TakeRequest& other) const {
    TakeRequest whole = *this;
    if (!seconds) whole.seconds = other.seconds;
    if (!fps) whole.fps = other.fps;
    if (quality.empty()) whole.quality = other.quality;
    if (also.empty()) whole.also = other.also;
    whole.memory_only |= other.memory_only;
    return whole;
}

bool TakeRequest::is_armed_like(const TakeRequest& other) const {
    return seconds == other.seconds && fps == other.fps && quality == other.quality && also == other.also &&
           memory_only == other.memory_only;
}

Result<SequenceConfig> find_sequence(const std::string& name, const DaemonSetup& setup) {
    if (const Status fits = check_slate(name); !fits)
        return fail(fmt::format("'{}' names no sequence: give the name of a file in '{}', without .toml, or a basis",
                                name, setup.sequences));
    const fs::path file = fs::path(setup.sequences) / (name + ".toml");
    std::error_code error;
    if (fs::exists(file, error)) return read_sequence(file.string());
    if (const Status known = check_basis_name(name); !known.ok())
        return fail(fmt::format("there is no '{}', and {}", file.string(), known.error().message));
    SequenceConfig config;
    config.basis = name;
    return config;
}

Status check_daemon(const StageConfig& stage, bool makes_folders) {
    const DaemonSetup& setup = stage.daemon;
    if (const Status s = check_word(setup, "quality", setup.quality, motion_quality_names()); !s) return s;
    if (const Status s = check_word(setup, "estimate", setup.estimate, estimate_names()); !s) return s;
    if (const Status s = check_word(setup, "fill", setup.fill, {"none", "neighbours"}); !s) return s;
    if (const Status s = check_slate(setup.slate); !s) return fail(setup.places.at("slate") + ": " + s.error().message);
    const auto sequence = find_sequence(setup.sequence, setup);
    if (!sequence) return fail(setup.places.at("sequence") + ": " + sequence.error().message);
    if (const auto compiled = compile_sequence(*sequence, stage); !compiled)
        return fail(setup.places.at("sequence") + ": " + compiled.error().message);
    if (const Status s = check_folder(setup, "takes", setup.takes, makes_folders); !s) return s;
    return setup.spill.empty() ? Done{} : check_folder(setup, "spill", setup.spill, makes_folders);
}

Result<TakePlan> plan_take(const TakeRequest& request, const std::string& sequence_name, const StageConfig& stage) {
    const DaemonSetup& setup = stage.daemon;
    auto config = find_sequence(sequence_name, setup);
    if (!config) return config.error();
    config->cycles = 1;
    const auto one_cycle = compile_sequence(*config, stage);
    if (!one_cycle) return one_cycle.error();
    if (!one_cycle->is_capture() || one_cycle->config.playback.start == StartSource::photo)
        return fail("sequence '" + sequence_name +
                    "' is no capture basis at an even pace, of which takes are made: play it with `stagectl play`");
    TakePlan plan;
    plan.request = request;
    plan.sequence_name = sequence_name;
    plan.choices = choices_of(request, setup);
    const double seconds = request.seconds.value_or(setup.seconds);
    // Slots are whole ticks, so that twelve cycles may last a bit less than a second: that asks for no thirteenth. Targets of a
    // performance need half a cycle before and after them.
    const double played = seconds * double(tick_hz) / double(one_cycle->cycle_ticks());
    const double cycles = std::ceil(played - 0.01) + (plan.choices.fps > 0 ? 1 : 0);
    if (!(cycles >= 1 && cycles <= cycles_max))
        return fail(fmt::format("a take lasts from one cycle to {:.0f} s, and not {} s",
                                cycles_max * double(one_cycle->cycle_ticks()) / double(tick_hz), seconds));
    config->cycles = int(cycles);
    auto sequence = compile_sequence(*config, stage);
    if (!sequence) return sequence.error();
    plan.sequence = std::move(*sequence);
    auto calibration = open_calibration(plan.choices, stage);
    if (!calibration)
        return fail(calibration.error().message +
                    "; with the daemon: `stagectl calibrate`, or [daemon] nominal = true");
    plan.calibration = std::move(*calibration);
    auto targets = targets_of(plan.choices, plan.sequence);
    if (!targets) return targets.error();
    plan.targets = std::move(*targets);
    const auto forecast = forecast_disk(setup.takes, plan.sequence, stage, plan.targets, plan.choices.single_float,
                                        uint64_t(setup.reserve_mb) * 1'000'000);
    if (!forecast) return forecast.error();
    plan.forecast = *forecast;
    if (!request.also.empty() && plan.targets.every == 0)
        return fail("another quality is of a performance: give its targets a second, too, as --fps 24");
    plan.forecast.bytes_needed *= 1 + request.also.size();
    plan.forecast.seconds_that_fit /= double(1 + request.also.size());
    return plan;
}

nlohmann::json TakePlan::to_json() const {
    return {{"sequence", sequence_name},
            {"basis", sequence.basis.name},
            {"slots", sequence.slots.size()},
            {"cycles", sequence.config.cycles},
            {"seconds", forecast.seconds},
            {"fps", choices.fps},
            {"quality", choices.quality},
            {"disk_bytes_needed", forecast.bytes_needed},
            {"disk_bytes_free", forecast.bytes_free},
            {"disk_bytes_reserve", forecast.bytes_reserve},
            {"disk_seconds_that_fit", forecast.seconds_that_fit}};
}

}  // namespace ols

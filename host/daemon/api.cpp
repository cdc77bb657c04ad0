// SPDX-License-Identifier: MIT
// Parameters in, calls of the conductor, results out.
#include "daemon/api.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <mutex>

#include "daemon/metrics.hpp"
#include "daemon/preview.hpp"
#include "daemon/progress_json.hpp"
#include "image/base64.hpp"
#include "image/disk_room.hpp"
#include "image/json_object.hpp"

namespace ols {

namespace {

using nlohmann::json;

constexpr size_t takes_max = 1000, events_max = 2000;
constexpr double seconds_max = 86'400;

RpcOutcome outcome_of(const Result<json>& result) {
    if (result) return {*result};
    return {nullptr, RpcError{RpcError::failed, result.error().message}};
}

RpcOutcome invalid(const std::string& why) {
    return {nullptr, RpcError{RpcError::invalid_params, why}};
}

std::vector<std::string> texts_of(JsonObject& params, const std::string& key) {
    const json list = params.any(key);
    std::vector<std::string> texts;
    if (!list.is_array() || !std::ranges::all_of(list, [](const json& one) { return one.is_string(); }))
        params.reject(key, "is to be a list of texts");
    else
        for (const json& one : list) texts.push_back(one);
    return texts;
}

TakeRequest take_request(JsonObject& params) {
    TakeRequest request;
    if (params.has("seconds")) request.seconds = params.number("seconds", 1e-3, seconds_max);
    if (params.has("slate")) request.slate = params.text("slate");
    if (params.has("number")) request.number = int(params.count("number", take_number_max));
    if (request.number == 0) params.reject("number", "is at least 1");
    if (params.has("notes")) request.notes = params.text("notes");
    if (params.has("fps")) request.fps = params.number("fps", 0, 100'000);
    if (params.has("quality")) request.quality = params.text("quality");
    if (params.has("also")) request.also = texts_of(params, "also");
    if (params.has("memory_only")) request.memory_only = params.boolean("memory_only");
    const auto names = motion_quality_names();
    const auto is_quality = [&](const std::string& name) { return std::ranges::find(names, name) != names.end(); };
    if (!request.quality.empty() && !is_quality(request.quality))
        params.reject("quality", "is none of none, preview, standard and final");
    for (size_t n = 0; n < request.also.size(); ++n)
        if (!is_quality(request.also[n]) || std::ranges::count(request.also, request.also[n]) > 1)
            params.reject("also", "is to name qualities, none, preview, standard and final, each once");
    if (!request.slate.empty())
        if (const Status fits = check_slate(request.slate); !fits)
            params.reject("slate", "is none: " + fits.error().message);
    return request;
}

CardOptions card_options(JsonObject& params) {
    CardOptions card;
    if (params.has("card")) card.reflectance = params.number("card", 0.01, 1);
    if (params.has("number")) card.camera = uint32_t(params.count("number", 1000));
    if (params.has("exposure_us")) card.exposure_us = params.number("exposure_us", 0.1, 400);
    if (params.has("cycles")) card.cycles = int(params.count("cycles", 10'000));
    if (card.cycles == 0) params.reject("cycles", "is at least 1");
    return card;
}

// One at a time: it takes a processor, which a take that runs needs itself.
Result<json> preview_of(const TakeFolder& takes, const std::string& take, double exposure_ev) {
    static std::mutex one_at_a_time;
    const std::unique_lock lock(one_at_a_time, std::try_to_lock);
    if (!lock) return fail("another preview is being made: try again when it is done");
    const auto target = takes.latest_target(take);
    if (!target) return target.error();
    const auto preview = preview_target(target->archive, target->camera, target->index, exposure_ev);
    if (!preview) return preview.error();
    return json{{"archive", target->archive},
                {"camera", target->camera},
                {"target", target->index},
                {"width", preview->width},
                {"height", preview->height},
                {"masked_pixels", preview->masked_pixels},
                {"png_base64", base64_of(preview->png)}};
}

}  // namespace

Api::Api(Conductor& conductor, EventLog& events, std::string program_version)
    : conductor_(conductor), events_(events), program_version_(std::move(program_version)) {}

json Api::present_state() const {
    const uint64_t number =
        events_.last_number();  // first: what comes later may be told twice, and nothing is left out
    const Snapshot now = conductor_.snapshot();
    const StageConfig stage = conductor_.stage();
    json allowed = json::array();
    for (const Method& method : methods())
        if (method.is_allowed(now.state)) allowed.push_back(method.name);
    const auto disk = room_of(stage.daemon.takes);
    return {{"event_number", number},
            {"state", state_name(now.state)},
            {"allowed", allowed},
            {"fault", now.fault},
            {"fault_is_latched", now.fault_is_latched},
            {"waits_for", now.waits_for},
            {"devices", now.devices},
            {"sequence", now.sequence},
            {"plan", now.plan},
            {"take", now.take ? progress_json(*now.take) : json()},
            {"last_take", now.last_take},
            {"takes_folder", stage.daemon.takes},
            {"disk_bytes_free", disk ? json(disk->free_bytes) : json()}};
}

json Api::version() const {
    json list = json::array();
    for (const Method& method : methods()) {
        json allowed = json::array();
        for (const DaemonState state : method.allowed) allowed.push_back(state_name(state));
        list.push_back(
            {{"name", method.name}, {"command", method.command}, {"purpose", method.purpose}, {"allowed", allowed}});
    }
    json kinds = json::array();
    for (const EventKindFacts& facts : event_kinds())
        kinds.push_back({{"code", int(facts.kind)},
                         {"event", facts.name},
                         {"level", level_name(facts.level)},
                         {"meaning", facts.meaning}});
    return {{"program", program_version_}, {"api", api_version}, {"methods", list}, {"events", kinds}};
}

std::string Api::metrics() const {
    return metrics_text(conductor_.snapshot(), conductor_.stage().daemon, events_, program_version_);
}

RpcOutcome Api::call(const std::string& name, const json& given, const std::string& caller) {
    const Method* const method = find_method(name);
    if (!method)
        return {nullptr,
                RpcError{RpcError::method_not_found, "there is no method '" + name + "': `version` lists them"}};
    const DaemonState state = conductor_.snapshot().state;
    if (!method->is_allowed(state))
        return {nullptr,
                RpcError{RpcError::wrong_state, fmt::format("{} is for the states {}, and the stage is in state {}",
                                                            name, state_words(method->allowed), state_name(state))}};
    JsonObject params(given, "the call of " + name, "is wrong");
    return call_now(name, params, caller);
}

RpcOutcome Api::call_now(const std::string& name, JsonObject& params, const std::string& caller) {
    // Parameters are read and all of them known before anything is done.
    const auto checked = [&](auto work) -> RpcOutcome {
        if (const Status known = params.finish(); !known) return invalid(known.error().message);
        return outcome_of(work());
    };
    if (name == "version") return checked([&]() -> Result<json> { return version(); });
    if (name == "status") return checked([&]() -> Result<json> { return present_state(); });
    if (name == "metrics") return checked([&]() -> Result<json> { return json{{"text", metrics()}}; });
    if (name == "stop") return checked([&] { return conductor_.stop(caller); });
    if (name == "clear_fault") return checked([&] { return conductor_.clear_fault(); });
    if (name == "reload") return checked([&] { return conductor_.reload(); });
    if (name == "arm") {
        const TakeRequest request = take_request(params);
        return checked([&] { return conductor_.arm(request); });
    }
    if (name == "record") {
        const TakeRequest request = take_request(params);
        return checked([&] { return conductor_.record(request); });
    }
    if (name == "swap") {
        const std::string sequence = params.text("sequence");
        return checked([&] { return conductor_.swap(sequence); });
    }
    if (name == "calibrate") {
        const CardOptions card = card_options(params);
        return checked([&] { return conductor_.calibrate(card); });
    }
    if (name == "log") {
        const uint64_t after = params.has("after") ? params.count("after", UINT64_MAX) : 0;
        const size_t limit = params.has("limit") ? params.count("limit", events_max) : 100;
        return checked([&]() -> Result<json> {
            json list = json::array();
            for (const Event& event : events_.since(after, limit)) list.push_back(event.to_json());
            return json{{"events", list}, {"event_number", events_.last_number()}};
        });
    }
    const TakeFolder takes(conductor_.stage().daemon.takes);
    if (name == "takes") {
        const size_t limit = params.has("limit") ? params.count("limit", takes_max) : 50;
        return checked([&]() -> Result<json> {
            const auto list = takes.list(limit);
            if (!list) return list.error();
            return json{{"folder", takes.path()}, {"takes", *list}};
        });
    }
    if (name == "preview") {
        const std::string take = params.has("take") ? params.text("take") : "";
        const double exposure_ev = params.has("exposure") ? params.number("exposure", -20, 20) : 0;
        return checked([&] { return preview_of(takes, take, exposure_ev); });
    }
    return {nullptr, RpcError{RpcError::method_not_found,
                              name + " needs a link that stays: a Unix socket, or GET /events over HTTP"}};
}

}  // namespace ols

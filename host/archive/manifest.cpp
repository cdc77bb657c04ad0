// SPDX-License-Identifier: MIT
// TakeInfo as JSON, and timecode arithmetic.
#include "archive/manifest.hpp"

#include <fmt/format.h>

#include <cmath>
#include <cstdio>
#include <initializer_list>
#include <limits>
#include <utility>

#include "image/json_object.hpp"

namespace ols {

using nlohmann::json;

nlohmann::json manifest_of(const TakeInfo& info) {
    json lights = json::array();
    for (size_t i = 0; i < info.lights.size(); ++i) {
        const auto& [name, d] = info.lights[i];
        lights.push_back(
            {{"layer", lamp_layer(int(i), int(info.lights.size()))}, {"name", name}, {"direction", {d.x, d.y, d.z}}});
    }
    return {
        {"format", archive_format},
        {"version", archive_version},
        {"slate", {{"production", info.production}, {"scene", info.scene}, {"take", info.take}, {"notes", info.notes}}},
        {"timecode_start", info.timecode_start},
        {"frame_rate_hz", info.frame_rate_hz},
        {"basis", info.basis},
        {"value_unit", info.value_unit},
        {"color_interop_id", info.color_interop_id},
        {"sample_type", info.sample_type == SampleType::half_float ? "half" : "float"},
        {"compression", info.compression == Compression::none ? "none" : "zips"},
        {"lights", lights},
        {"extra", info.extra}};
}

namespace {

constexpr double frame_rate_hz_max = 1e6;

std::vector<LightPosition> read_lights(JsonObject& json) {
    std::vector<JsonObject> entries = json.objects("lights");
    if (entries.empty()) json.reject("lights", "has no lamp");
    std::vector<LightPosition> lights;
    for (JsonObject& entry : entries) {
        if (const auto layer = lamp_layer(int(lights.size()), int(entries.size())); entry.text("layer") != layer)
            entry.reject("layer", "is not '" + layer + "'");
        const std::vector<double> d = entry.numbers("direction");
        // Written with all digits; read as other programs may have rounded them.
        if (d.size() != 3 || !(std::abs(std::hypot(d[0], d[1], d[2]) - 1) < 1e-3)) {
            entry.reject("direction", "is not three numbers of length 1");
            return lights;
        }
        lights.push_back({entry.text("name"), {d[0], d[1], d[2]}});
    }
    return lights;
}

template <typename T>
T read_choice(JsonObject& json, const char* key, std::initializer_list<std::pair<const char*, T>> choices) {
    const std::string word = json.text(key);
    std::string known;
    for (const auto& [name, choice] : choices) {
        if (word == name) return choice;
        known += (known.empty() ? "'" : ", '") + std::string(name) + "'";
    }
    json.reject(key, "is none of " + known);
    return {};
}

TakeInfo read_info(JsonObject& json) {
    TakeInfo info;
    JsonObject slate = json.object("slate");
    info.production = slate.text("production");
    info.scene = slate.text("scene");
    info.take = slate.text("take");
    info.notes = slate.text("notes");
    info.timecode_start = json.text("timecode_start");
    info.frame_rate_hz = json.number("frame_rate_hz", 0, frame_rate_hz_max);
    if (!(info.frame_rate_hz > 0)) json.reject("frame_rate_hz", "is not above 0");
    if (!info.timecode_start.empty())
        if (const auto frames = timecode_frames(info.timecode_start, info.frame_rate_hz); !frames)
            json.reject("timecode_start", "is no time: " + frames.error().message);
    info.basis = json.text("basis");
    info.value_unit =
        read_choice<std::string>(json, "value_unit", {{"reflectance", "reflectance"}, {"pixel", "pixel"}});
    info.color_interop_id = json.text("color_interop_id");
    info.sample_type = read_choice<SampleType>(json, "sample_type",
                                               {{"half", SampleType::half_float}, {"float", SampleType::single_float}});
    info.compression =
        read_choice<Compression>(json, "compression", {{"none", Compression::none}, {"zips", Compression::zips}});
    info.lights = read_lights(json);
    info.extra = json.any("extra");
    if (!info.extra.is_object()) json.reject("extra", "is not an object");
    return info;
}

// What finish() says of the targets: how many were written, and runs of those that are missing.
void read_targets(JsonObject targets, Manifest& manifest) {
    constexpr uint64_t number_max = std::numeric_limits<uint32_t>::max();
    manifest.written = targets.count("written", number_max);
    manifest.missing = 0;
    for (JsonObject& run : targets.objects("missing")) {
        (void)run.count("camera", number_max);
        (void)run.text("why");
        if (run.has("detail")) (void)run.any("detail");
        const uint64_t first = run.count("index", number_max);
        const uint64_t last = run.has("through") ? run.count("through", number_max) : first;
        if (last < first) run.reject("through", "comes before index");
        *manifest.missing += last - first + 1;
    }
}

}  // namespace

Result<Manifest> read_manifest(const std::string& text, const std::string& path) {
    auto parsed = parse_json(text, "'" + path + "'");
    if (!parsed) return parsed.error();
    if (!parsed->is_object() || parsed->value("format", json()) != archive_format)
        return fail("'" + path + "' is not the manifest of an archive: choose the take.rfa directory itself");
    Manifest manifest;
    manifest.json = std::move(*parsed);
    JsonObject json(manifest.json, "'" + path + "'");
    (void)json.text("format");
    manifest.version = int(json.count("version", std::numeric_limits<int>::max()));
    if (manifest.version > archive_version)
        return fail("'" + path + "' is of a later version: read it with the release that wrote it, or a newer one");
    if (manifest.version < oldest_archive_version) json.reject("version", "is none that there was");
    manifest.info = read_info(json);
    if (json.has("targets")) read_targets(json.object("targets"), manifest);
    if (const Status whole = json.finish(); !whole) return whole.error();
    return manifest;
}

std::string lamp_layer(int lamp, int count) {
    const int digits = std::max(3, int(std::to_string(std::max(0, count - 1)).size()));
    return fmt::format("lamp_{:0{}}", lamp, digits);
}

Result<int64_t> timecode_frames(const std::string& timecode, double frame_rate_hz) {
    int h = 0, m = 0, s = 0, f = 0, read = 0;
    const int nominal = int(std::lround(frame_rate_hz));
    const int fields = std::sscanf(timecode.c_str(), "%2d:%2d:%2d:%2d%n", &h, &m, &s, &f, &read);
    if (fields != 4 || size_t(read) != timecode.size() || h < 0 || h > 23 || m < 0 || m > 59 || s < 0 || s > 59 ||
        f < 0 || f >= nominal)
        return fail(fmt::format("timecode '{}' is not HH:MM:SS:FF at {} frames a second", timecode, nominal));
    return ((h * 60 + m) * int64_t(60) + s) * nominal + f;
}

std::string timecode_text(int64_t frames, double frame_rate_hz) {
    const int64_t nominal = std::max<int64_t>(1, std::lround(frame_rate_hz));
    const int64_t seconds = frames / nominal;
    return fmt::format("{:02}:{:02}:{:02}:{:02}", seconds / 3600 % 24, seconds / 60 % 60, seconds % 60,
                       frames % nominal);
}

}  // namespace ols

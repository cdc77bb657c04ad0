// SPDX-License-Identifier: MIT
// TakeInfo as JSON, and timecode arithmetic.
#include "archive/manifest.hpp"

#include <fmt/format.h>

#include <cmath>
#include <cstdio>

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

Result<TakeInfo> take_info_of(const nlohmann::json& manifest, const std::string& path) {
    if (!manifest.is_object() || manifest.value("format", json()) != archive_format)
        return fail("'" + path + "' is not the manifest of an archive: choose the take.rfa directory itself");
    try {
        if (manifest.at("version").get<int>() > archive_version)
            return fail("'" + path + "' is of a later version: read it with the release that wrote it, or a newer one");
        TakeInfo info;
        const json& slate = manifest.at("slate");
        info.production = slate.at("production");
        info.scene = slate.at("scene");
        info.take = slate.at("take");
        info.notes = slate.at("notes");
        info.timecode_start = manifest.at("timecode_start");
        info.frame_rate_hz = manifest.at("frame_rate_hz");
        info.basis = manifest.at("basis");
        info.value_unit = manifest.at("value_unit");
        info.color_interop_id = manifest.at("color_interop_id");
        info.sample_type = manifest.at("sample_type") == "half" ? SampleType::half_float : SampleType::single_float;
        info.compression = manifest.at("compression") == "none" ? Compression::none : Compression::zips;
        for (const json& light : manifest.at("lights")) {
            const auto d = light.at("direction").get<std::array<double, 3>>();
            info.lights.push_back({light.at("name"), {d[0], d[1], d[2]}});
        }
        info.extra = manifest.value("extra", json::object());
        return info;
    } catch (const json::exception& e) {
        return fail("'" + path + "' is damaged: " + e.what());
    }
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

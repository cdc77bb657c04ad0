// SPDX-License-Identifier: MIT
// The manifest of an archive (manifest.json): what a take is, to and from JSON.
#pragma once

#include <nlohmann/json.hpp>
#include <string>

#include "archive/archive.hpp"
#include "image/whole_file.hpp"

namespace ols {

inline constexpr const char* lights_name = "lights.lp";
inline constexpr const char* archive_format = "open-light-stage-archive";
inline constexpr int archive_version = 1;

nlohmann::json manifest_of(const TakeInfo& info);

// The error names `path` and the key that is missing or of the wrong kind.
Result<TakeInfo> take_info_of(const nlohmann::json& manifest, const std::string& path);

// A timecode's frame count and back, non-drop at the nominal (rounded) rate.
Result<int64_t> timecode_frames(const std::string& timecode, double frame_rate_hz);
std::string timecode_text(int64_t frames, double frame_rate_hz);

}  // namespace ols

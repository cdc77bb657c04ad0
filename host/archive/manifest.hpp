// SPDX-License-Identifier: MIT
// The manifest of an archive (manifest.json): what a take is, to and from JSON.
#pragma once

#include <cstdint>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>

#include "archive/archive.hpp"
#include "image/whole_file.hpp"

namespace ols {

inline constexpr const char* lights_name = "lights.lp";
inline constexpr const char* archive_format = "open-light-stage-archive";
// Of manifest and journal. Version 1 has no chain in its journal (archive/journal.hpp), and its targets do not say which they are.
inline constexpr int archive_version = 2;
inline constexpr int oldest_archive_version = 1;
// Far more than any take has to say.
inline constexpr uint64_t manifest_bytes_max = 64 << 20;

nlohmann::json manifest_of(const TakeInfo& info);

struct Manifest {
    int version = archive_version;
    TakeInfo info;
    std::optional<uint64_t> written, missing;  // targets, once the archive is finished
    nlohmann::json json;                       // all of it
};

// Every value is checked. Errors name `path` and the key that is missing, not known, of the wrong kind or out of range.
Result<Manifest> read_manifest(const std::string& text, const std::string& path);

// A timecode's frame count and back, non-drop at the nominal (rounded) rate.
Result<int64_t> timecode_frames(const std::string& timecode, double frame_rate_hz);
std::string timecode_text(int64_t frames, double frame_rate_hz);

}  // namespace ols

// SPDX-License-Identifier: MIT
// Files and folders that are there whole or not at all, and where they may be put. What must survive a crash of the machine, too:
// archive/disk.hpp. Which outputs of a command get in its own way: image/outputs.hpp.
#pragma once

#include <filesystem>
#include <functional>
#include <string>
#include <string_view>

#include "result.hpp"

namespace ols {

// A folder with both is an archive of reflectance functions (archive/archive.hpp): its own writer alone puts files there.
inline constexpr const char* manifest_name = "manifest.json";
inline constexpr const char* journal_name = "journal.jsonl";

// The file that writing to `path` makes or replaces: a link is followed to the file that it names. Errors say what to do: what
// stands there is no regular file (a folder, a device, a pipe), the link leads nowhere, the place is in an archive.
Result<std::filesystem::path> output_place(const std::string& path);

// The folder that make_whole_folder() makes. Folders are made, not replaced: a path where anything stands is an error.
Result<std::filesystem::path> new_folder_place(const std::string& path);

// Calls `write` with a temporary file beside the place, empty and ours alone, syncs what it wrote and renames it: a reader sees
// the old file or the new one, never a part. If anything fails, the temporary file is removed, an older file stays, and the
// error says why.
Status write_whole_file(const std::string& path, const std::function<Status(const std::string& temporary)>& write);

// The same for bytes that are at hand.
Status write_whole_file(const std::string& path, std::string_view bytes);

// The same for a folder: calls `fill` with an empty one of ours beside the place and renames it.
Status make_whole_folder(const std::string& path, const std::function<Status(const std::string& temporary)>& fill);

}  // namespace ols

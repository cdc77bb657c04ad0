// SPDX-License-Identifier: MIT
// Names, numbers and the list of takes.
#include "daemon/take_folder.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <filesystem>

#include "archive/archive.hpp"

namespace ols {

namespace fs = std::filesystem;

namespace {

constexpr const char* suffix = ".rfa";

bool is_slate_letter(char c) {
    return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '-' || c == '.' ||
           c == '_' || c == ' ';
}

bool is_plain_name(const std::string& name, size_t letters_max) {
    return !name.empty() && name.size() <= letters_max && name.front() != '.' && name.front() != ' ' &&
           name.back() != ' ' && std::ranges::all_of(name, is_slate_letter);
}

// The number of a take of this slate; nothing for other files.
std::optional<int> number_in(const std::string& name, const std::string& slate) {
    const std::string start = slate + "_";
    if (!name.starts_with(start)) return std::nullopt;
    int number = 0;
    const char* const end = name.data() + name.size();
    const auto [stop, error] = std::from_chars(name.data() + start.size(), end, number);
    const bool is_whole = stop == end || *stop == '-';  // the same take in another quality has that behind a dash
    return error == std::errc() && is_whole && number > 0 ? std::optional(number) : std::nullopt;
}

uint64_t bytes_in(const std::string& folder) {
    uint64_t bytes = 0;
    std::error_code error;
    for (fs::recursive_directory_iterator file(folder, error), end; !error && file != end; file.increment(error)) {
        std::error_code no_size;
        const uint64_t size = file->is_regular_file(no_size) ? file->file_size(no_size) : 0;
        if (!no_size) bytes += size;
    }
    return bytes;
}

nlohmann::json describe(const std::string& name, const std::string& archive) {
    const auto reader = ArchiveReader::open(archive);
    if (!reader) return {{"take", name}, {"archive", archive}, {"state", reader.error().message}};
    uint64_t written = 0, missing = 0;
    for (const TargetEntry& entry : reader->targets())
        if (entry.file.empty())
            missing += entry.last - entry.index + 1;
        else
            ++written;
    const TakeInfo& info = reader->info();
    return {{"take", name},
            {"archive", archive},
            {"state", reader->finished()        ? "finished"
                      : reader->being_written() ? "being recorded"
                                                : "unfinished"},
            {"targets_written", written},
            {"targets_missing", missing},
            {"bytes", bytes_in(archive)},
            {"basis", info.basis},
            {"production", info.production},
            {"scene", info.scene},
            {"notes", info.notes}};
}

}  // namespace

Status check_slate(const std::string& slate) {
    if (!is_plain_name(slate, 64))
        return fail(
            "a slate has 1 to 64 letters, digits, '-', '_', '.' and spaces, and begins with none of the last two: it "
            "is "
            "a part of the take's file name");
    return Done{};
}

std::string TakeName::text() const {
    return fmt::format("{}_{:03}", slate, number);
}

std::string TakeFolder::archive_of(const TakeName& name, const std::string& quality) const {
    return (fs::path(path_) / (name.text() + (quality.empty() ? "" : "-" + quality) + suffix)).string();
}

Result<std::vector<std::string>> TakeFolder::names() const {
    std::vector<std::pair<fs::file_time_type, std::string>> found;
    std::error_code error;
    for (fs::directory_iterator file(path_, error), end; !error && file != end; file.increment(error)) {
        const fs::path& path = file->path();
        std::error_code ignored;  // of one that goes meanwhile
        if (path.extension() != suffix || !file->is_directory(ignored)) continue;
        // The journal's time, which its last target set; the folder's own stays.
        auto time = fs::last_write_time(path / "journal.jsonl", ignored);
        if (ignored) time = fs::file_time_type::min();
        found.emplace_back(time, path.stem().string());
    }
    if (error)
        return fail(fmt::format("the folder of takes '{}' cannot be read: {}: check [daemon] takes in the stage", path_,
                                error.message()));
    std::ranges::sort(found, std::greater());
    std::vector<std::string> names;
    for (auto& [time, name] : found) names.push_back(std::move(name));
    return names;
}

Result<TakeName> TakeFolder::next(const std::string& slate, std::optional<int> number) const {
    if (const Status fits = check_slate(slate); !fits) return fits.error();
    const auto taken = names();
    if (!taken) return taken.error();
    int highest = 0;
    for (const std::string& name : *taken) highest = std::max(highest, number_in(name, slate).value_or(0));
    const TakeName name{slate, number.value_or(highest + 1)};
    if (name.number < 1 || name.number > take_number_max)
        return fail(fmt::format("takes are numbered from 1 to {}: give another slate", take_number_max));
    if (std::ranges::find(*taken, name.text()) != taken->end())
        return fail(fmt::format("take {} is there already: leave its number out, and the next one, {}, is taken",
                                name.text(), highest + 1));
    return name;
}

Result<std::string> TakeFolder::find(const std::string& name) const {
    // A take's name is made of a slate's letters, and of its number and quality.
    if (!is_plain_name(name, 96)) return fail("there is no take of that name: `stagectl takes` lists them");
    const fs::path archive = fs::path(path_) / (name + suffix);
    std::error_code error;
    if (!fs::is_directory(archive, error)) return fail("there is no take '" + name + "': `stagectl takes` lists them");
    return archive.string();
}

Result<nlohmann::json> TakeFolder::list(size_t limit) const {
    const auto found = names();
    if (!found) return found.error();
    auto takes = nlohmann::json::array();
    for (const std::string& name : *found) {
        if (takes.size() == limit) break;
        takes.push_back(describe(name, (fs::path(path_) / (name + suffix)).string()));
    }
    return takes;
}

Result<TakeFolder::Target> TakeFolder::latest_target(const std::string& take_name) const {
    std::vector<std::string> candidates = {take_name};
    if (take_name.empty()) {
        const auto found = names();
        if (!found) return found.error();
        candidates = *found;
    }
    for (const std::string& name : candidates) {
        const auto archive = find(name);
        if (!archive && !take_name.empty()) return archive.error();
        if (!archive) continue;
        const auto reader = ArchiveReader::open(*archive);
        if (!reader && !take_name.empty()) return reader.error();
        if (!reader) continue;
        const auto& targets = reader->targets();
        const auto last = std::find_if(targets.rbegin(), targets.rend(), [](const auto& t) { return !t.file.empty(); });
        if (last != targets.rend()) return Target{*archive, last->camera, last->index};
    }
    return fail(take_name.empty() ? "no take has a finished target yet: record one with `stagectl record`"
                                  : "take '" + take_name + "' has no finished target");
}

}  // namespace ols

// SPDX-License-Identifier: MIT
// ArchiveReader: trusts the journal, and the files as far as they agree with it.
#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <set>

#include "archive/archive.hpp"
#include "archive/archive_place.hpp"
#include "archive/disk.hpp"
#include "archive/journal.hpp"
#include "archive/manifest.hpp"
#include "archive/target_file.hpp"

namespace ols {

namespace fs = std::filesystem;

struct ArchiveReader::State {
    fs::path root;
    nlohmann::json manifest;
    TakeInfo info;
    Journal journal;
};

namespace {

Result<std::string> finished_file(const fs::path& root, const Journal& journal, uint32_t camera, uint32_t index) {
    for (const auto& entry : journal.targets) {
        if (entry.camera != camera || index < entry.index || entry.last < index) continue;
        if (entry.file.empty())
            return fail(fmt::format("'{}': target {} of camera {} is missing: {}", root.string(), index, camera,
                                    entry.why_missing));
        return (root / entry.file).string();
    }
    return fail(fmt::format("'{}' has no finished target {} of camera {}: rf info lists what there is", root.string(),
                            index, camera));
}

// One line about a file that is not as the journal says; nothing when it is.
std::string damage(const fs::path& root, const std::string& file, const Checksum& expected) {
    std::error_code error;
    if (!fs::exists(root / file, error)) return file + ": is gone";
    const auto sum = checksum_file((root / file).string());
    if (!sum) return file + ": " + sum.error().message;
    if (sum->bytes != expected.bytes)
        return fmt::format("{}: has {} bytes, the journal says {}", file, sum->bytes, expected.bytes);
    if (sum->crc32 != expected.crc32)
        return fmt::format("{}: has CRC-32 {:08x}, the journal says {:08x}: its bytes have changed", file, sum->crc32,
                           expected.crc32);
    return "";
}

// The room for the manifest of an archive that is being written, or was.
bool is_set_aside(const fs::path& file) {
    std::error_code error;
    return file.filename() == std::string(manifest_name) + unfinished_suffix && fs::file_size(file, error) == 0;
}

void find_leftovers(const fs::path& root, const Journal& journal, std::vector<std::string>& problems) {
    std::set<std::string> known = {manifest_name, lights_name, journal_name};
    for (const auto& entry : journal.targets) known.insert(entry.file);
    std::vector<std::string> found;
    std::error_code error;
    for (const auto& entry : fs::recursive_directory_iterator(root, error))
        if (!entry.is_directory(error)) found.push_back(entry.path().lexically_relative(root).generic_string());
    std::sort(found.begin(), found.end());
    for (const auto& file : found) {
        if (known.contains(file) || is_set_aside(root / file)) continue;
        if (file.ends_with(unfinished_suffix))
            problems.push_back(file + ": was not finished; it may be removed");
        else if (file.ends_with(".exr"))
            problems.push_back(file + ": is not in the journal: it was not finished");
        else
            problems.push_back(file + ": is no part of the archive");
    }
}

}  // namespace

std::string target_words(const TargetEntry& entry) {
    return entry.last == entry.index ? fmt::format("target {}", entry.index)
                                     : fmt::format("targets {} to {}", entry.index, entry.last);
}

ArchiveReader::ArchiveReader(std::unique_ptr<State> state) : state_(std::move(state)) {}
ArchiveReader::ArchiveReader(ArchiveReader&&) noexcept = default;
ArchiveReader::~ArchiveReader() = default;

Result<ArchiveReader> ArchiveReader::open(const std::string& path) {
    const fs::path root = path;
    std::error_code error;
    if (!fs::is_directory(root, error))
        return fail("'" + path + "' is no archive: an archive is a directory with a " + manifest_name);
    const std::string manifest_path = (root / manifest_name).string();
    std::ifstream file(manifest_path, std::ios::binary);
    if (!file) return fail("'" + path + "' is no archive: it has no " + manifest_name);
    auto manifest = nlohmann::json::parse(file, nullptr, false);
    if (manifest.is_discarded()) return fail("'" + manifest_path + "' is damaged: it is not JSON");
    auto info = take_info_of(manifest, manifest_path);
    if (!info) return info.error();
    auto journal = read_journal((root / journal_name).string());
    if (!journal) return journal.error();
    return ArchiveReader(
        std::make_unique<State>(State{root, std::move(manifest), std::move(*info), std::move(*journal)}));
}

const TakeInfo& ArchiveReader::info() const {
    return state_->info;
}
const nlohmann::json& ArchiveReader::manifest() const {
    return state_->manifest;
}
const std::vector<TargetEntry>& ArchiveReader::targets() const {
    return state_->journal.targets;
}
std::vector<TargetEntry> ArchiveReader::undecided() const {
    return undecided_targets(state_->journal);
}
bool ArchiveReader::finished() const {
    return state_->journal.ended;
}
bool ArchiveReader::being_written() const {
    return !finished() && is_being_written(state_->root);
}

Result<Target> ArchiveReader::read_head(uint32_t camera, uint32_t index) const {
    const auto file = finished_file(state_->root, state_->journal, camera, index);
    if (!file) return file.error();
    auto target = read_target_head(*file, state_->info);
    if (target) target->camera = camera, target->index = index;
    return target;
}

Result<Target> ArchiveReader::read_target(uint32_t camera, uint32_t index) const {
    return read_box(camera, index, Box{});
}

Result<Target> ArchiveReader::read_box(uint32_t camera, uint32_t index, const Box& box) const {
    const auto file = finished_file(state_->root, state_->journal, camera, index);
    if (!file) return file.error();
    auto target = read_target_box(*file, state_->info, box);
    if (target) target->camera = camera, target->index = index;
    return target;
}

Result<TargetMotion> ArchiveReader::read_motion(uint32_t camera, uint32_t index) const {
    const auto file = finished_file(state_->root, state_->journal, camera, index);
    if (!file) return file.error();
    return read_target_motion(*file, state_->info);
}

Verification ArchiveReader::verify() const {
    const fs::path& root = state_->root;
    const Journal& journal = state_->journal;
    Verification result;
    for (const auto& entry : journal.targets) {
        if (entry.file.empty()) continue;
        std::string problem = damage(root, entry.file, {entry.bytes, entry.crc32});
        if (problem.empty()) {
            const auto head = read_target_head((root / entry.file).string(), state_->info);
            if (!head) problem = entry.file + ": " + head.error().message;
        }
        if (problem.empty())
            result.intact.push_back(entry.file);
        else
            result.problems.push_back(problem);
    }
    const auto check = [&](const char* name, const std::optional<Checksum>& expected) {
        if (!expected) return;
        if (const auto problem = damage(root, name, *expected); !problem.empty()) result.problems.push_back(problem);
    };
    check(lights_name, journal.lights);
    check(manifest_name, journal.manifest);
    result.problems.insert(result.problems.end(), journal.problems.begin(), journal.problems.end());
    find_leftovers(root, journal, result.problems);
    const bool goes_on = being_written();
    for (const auto& run : undecided_targets(journal))
        result.problems.push_back(
            fmt::format("camera {}: {} {}", run.camera, target_words(run), goes_on ? "to come" : "never finished"));
    if (!journal.ended)
        result.problems.push_back(std::string(journal_name) + ": has no end: the recording " +
                                  (goes_on ? "goes on" : "was interrupted"));
    return result;
}

}  // namespace ols

// SPDX-License-Identifier: MIT
// ArchiveReader: trusts the journal, and the files as far as they agree with it.
#include <fmt/format.h>

#include <filesystem>

#include "archive/archive.hpp"
#include "archive/archive_file.hpp"
#include "archive/archive_place.hpp"
#include "archive/journal.hpp"
#include "archive/manifest.hpp"
#include "archive/target_state.hpp"
#include "archive/verification.hpp"
#include "exceptions.hpp"

namespace ols {

namespace fs = std::filesystem;

struct ArchiveReader::State {
    fs::path root;
    Manifest manifest;
    Journal journal;
};

namespace {

Result<TargetEntry> finished_entry(const fs::path& root, const Journal& journal, uint32_t camera, uint32_t index) {
    for (const auto& entry : journal.targets) {
        if (entry.camera != camera || index < entry.index || entry.last < index) continue;
        if (entry.file.empty())
            return fail(fmt::format("'{}': target {} of camera {} is missing: {}", root.string(), index, camera,
                                    entry.why_missing));
        return entry;
    }
    return fail(fmt::format("'{}' has no finished target {} of camera {}: rf info lists what there is", root.string(),
                            index, camera));
}

Error not_as_written(const ArchiveFile& file, const Checksum& found, const TargetEntry& entry) {
    return fail("'" + difference(file.path() + "'", found, {entry.bytes, entry.crc32}) +
                "; it is damaged or another's: rf verify names all such files");
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
    if (!fs::exists(fs::symlink_status(root / manifest_name, error)))
        return fail("'" + path + "' is no archive: it has no " + manifest_name);
    return guarded("cannot read '" + path + "'", [&]() -> Result<ArchiveReader> {
        const auto file = ArchiveFile::open(root, manifest_name);
        if (!file) return file.error();
        const auto text = file->text(manifest_bytes_max);
        if (!text) return text.error();
        auto manifest = read_manifest(*text, file->path());
        if (!manifest) return manifest.error();
        auto journal = read_journal(root, manifest->version);
        if (!journal) return journal.error();
        return ArchiveReader(std::make_unique<State>(State{root, std::move(*manifest), std::move(*journal)}));
    });
}

const TakeInfo& ArchiveReader::info() const {
    return state_->manifest.info;
}
const nlohmann::json& ArchiveReader::manifest() const {
    return state_->manifest.json;
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

const std::vector<std::string>& ArchiveReader::journal_problems() const {
    return state_->journal.problems;
}

Result<TargetReader> ArchiveReader::open_target(uint32_t camera, uint32_t index, TargetCheck check) const {
    const auto entry = finished_entry(state_->root, state_->journal, camera, index);
    if (!entry) return entry.error();
    auto file = ArchiveFile::open(state_->root, entry->file);
    if (!file) return file.error();
    if (file->size() != entry->bytes) return not_as_written(*file, {file->size(), 0}, *entry);
    if (check == TargetCheck::checksum) {
        const auto sum = file->checksum();
        if (!sum) return sum.error();
        if (*sum != Checksum{entry->bytes, entry->crc32}) return not_as_written(*file, *sum, *entry);
    }
    auto state = TargetReader::State::open(std::move(*file), state_->manifest.info, state_->manifest.version, *entry);
    if (!state) return state.error();
    return TargetReader(std::move(*state));
}

Result<Target> ArchiveReader::read_head(uint32_t camera, uint32_t index) const {
    const auto target = open_target(camera, index, TargetCheck::size);
    if (!target) return target.error();
    return target->head();
}

Result<Target> ArchiveReader::read_target(uint32_t camera, uint32_t index) const {
    const auto target = open_target(camera, index);
    if (!target) return target.error();
    return target->read();
}

Result<Target> ArchiveReader::read_box(uint32_t camera, uint32_t index, const Box& box) const {
    const auto target = open_target(camera, index);
    if (!target) return target.error();
    return target->read_box(box);
}

Result<TargetMotion> ArchiveReader::read_motion(uint32_t camera, uint32_t index) const {
    const auto target = open_target(camera, index);
    if (!target) return target.error();
    return target->read_motion();
}

Verification ArchiveReader::verify(bool deep) const {
    const auto open = [this](const TargetEntry& entry) {
        return open_target(entry.camera, entry.index, TargetCheck::size);
    };
    return verify_archive({state_->root, state_->manifest, state_->journal, being_written(), open}, deep);
}

}  // namespace ols

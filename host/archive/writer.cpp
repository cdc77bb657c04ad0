// SPDX-License-Identifier: MIT
// ArchiveWriter: every step leaves an archive that reads, whatever happens next.
#include <fmt/format.h>

#include <cstdio>
#include <cstring>
#include <filesystem>
#include <set>

#include "archive/archive.hpp"
#include "archive/disk.hpp"
#include "archive/journal.hpp"
#include "archive/manifest.hpp"
#include "archive/target_file.hpp"

namespace ols {

namespace fs = std::filesystem;

struct ArchiveWriter::State {
    fs::path root;
    TakeInfo info;
    JournalWriter journal;
    std::set<std::pair<uint32_t, uint32_t>> noted;  // camera and index of targets that the journal has
    nlohmann::json missing = nlohmann::json::array();
    bool finished = false;
};

namespace {

// Whether a file or folder is one that an archive consists of, finished or not, by its path relative to the archive.
bool belongs_to_archive(std::string relative) {
    if (relative.ends_with(unfinished_suffix)) relative.resize(relative.size() - std::strlen(unfinished_suffix));
    unsigned camera = 0, index = 0;
    const int numbers = std::sscanf(relative.c_str(), "cam%u/target_%u", &camera, &index);
    if (numbers == 2) return relative == target_file_name(camera, index);
    if (numbers == 1) return relative == fmt::format("cam{}", camera);
    return relative == manifest_name || relative == lights_name || relative == journal_name;
}

Status remove_archive(const fs::path& root) {
    std::error_code error;
    if (!fs::exists(root / journal_name, error))
        return fail("'" + root.string() + "' exists and is not an archive: remove it yourself or choose another name");
    for (const auto& entry : fs::recursive_directory_iterator(root, error)) {
        const std::string relative = entry.path().lexically_relative(root).generic_string();
        if (!belongs_to_archive(relative))
            return fail("'" + entry.path().string() + "' is not part of an archive: move it before overwriting '" +
                        root.string() + "'");
    }
    if (!error) fs::remove_all(root, error);
    if (error) return fail("cannot remove '" + root.string() + "': " + error.message());
    return Done{};
}

Status check_info(const TakeInfo& info) {
    if (info.lights.empty()) return fail("an archive needs at least one lamp");
    if (!(info.frame_rate_hz > 0)) return fail("an archive needs a frame rate above 0");
    if (!info.timecode_start.empty())
        if (const auto frames = timecode_frames(info.timecode_start, info.frame_rate_hz); !frames)
            return frames.error();
    return Done{};
}

// lights.lp names lamps by their layers: what stands in the file is what stands in the images.
std::vector<LightPosition> named_by_layer(std::vector<LightPosition> lights) {
    for (size_t i = 0; i < lights.size(); ++i) lights[i].name = lamp_layer(int(i), int(lights.size()));
    return lights;
}

std::string text_of(const nlohmann::json& manifest) {
    return manifest.dump(1, ' ', false, nlohmann::json::error_handler_t::replace) + "\n";
}

// Fills the fresh directory; the journal comes last, so that a directory with a journal is an archive.
Result<JournalWriter> begin_archive(const fs::path& root, const TakeInfo& info) {
    if (auto s = write_lp((root / lights_name).string(), named_by_layer(info.lights)); !s) return s.error();
    const auto lights = checksum_file((root / lights_name).string());
    if (!lights) return lights.error();
    if (auto s = write_file_durably((root / manifest_name).string(), text_of(manifest_of(info))); !s) return s.error();
    auto journal = JournalWriter::create((root / journal_name).string());
    if (!journal) return journal;
    const auto begun =
        journal->append({{"event", "begin"}, {"version", archive_version}, {"lights", to_json(*lights)}});
    if (!begun) return begun.error();
    if (auto s = sync_directory(root.parent_path().string()); !s) return s.error();
    return journal;
}

}  // namespace

ArchiveWriter::ArchiveWriter(std::unique_ptr<State> state) : state_(std::move(state)) {}
ArchiveWriter::ArchiveWriter(ArchiveWriter&&) noexcept = default;
ArchiveWriter::~ArchiveWriter() = default;

Result<ArchiveWriter> ArchiveWriter::create(const std::string& path, const TakeInfo& info, bool overwrite) {
    if (const auto checked = check_info(info); !checked) return checked.error();
    fs::path root = fs::path(path).lexically_normal();
    if (!root.has_filename()) root = root.parent_path();  // "take.rfa/"
    std::error_code error;
    if (fs::exists(root, error)) {
        if (!overwrite) return fail("'" + root.string() + "' exists: choose another name or overwrite it");
        if (const auto removed = remove_archive(root); !removed) return removed.error();
    }
    if (!fs::create_directory(root, error))
        return fail("cannot make '" + root.string() + "': " + (error ? error.message() : "it exists") +
                    "; the folder it lies in must exist");
    auto journal = begin_archive(root, info);
    if (!journal) {
        fs::remove_all(root, error);
        return journal.error();
    }
    return ArchiveWriter(std::make_unique<State>(State{root, info, std::move(*journal), {}, {}, false}));
}

Status ArchiveWriter::write_target(const Target& target) {
    assert(target.lamps.size() == state_->info.lights.size() * target.planes());
    Target head;
    head.camera = target.camera, head.index = target.index;
    head.width = target.width, head.height = target.height;
    head.cfa = target.cfa;
    head.mask = target.mask;
    head.variance = target.variance;
    head.noise_gain = target.noise_gain;
    head.confidence = target.confidence;
    head.matte = target.matte;
    head.missing_lamps = target.missing_lamps;
    head.provenance = target.provenance;
    head.motion = target.motion;
    return write_target(head, [&](int plane, const Box& box, float* out) -> Status {
        for (int y = 0; y < box.height; ++y)
            std::copy_n(target.lamps[plane].data() + size_t(box.y + y) * target.width + box.x, box.width,
                        out + size_t(y) * box.width);
        return Done{};
    });
}

Status ArchiveWriter::write_target(const Target& head, const PlaneSource& source) {
    State& state = *state_;
    assert(!state.finished && head.width > 0 && head.height > 0);
    const std::string relative = target_file_name(head.camera, head.index);
    if (state.noted.contains({head.camera, head.index})) return fail("target '" + relative + "' is already noted");

    const fs::path final_name = state.root / relative, temporary = final_name.string() + unfinished_suffix;
    std::error_code error;
    if (fs::create_directory(final_name.parent_path(), error))
        if (auto s = sync_directory(state.root.string()); !s) return s;
    if (error) return fail("cannot make '" + final_name.parent_path().string() + "': " + error.message());

    if (auto s = write_target_file(temporary.string(), state.info, head, source); !s) return s;
    const auto sum = checksum_file(temporary.string());
    Status renamed = sum.ok() ? rename_durably(temporary.string(), final_name.string()) : sum.error();
    if (!renamed) {
        fs::remove(temporary, error);
        return renamed;
    }
    nlohmann::json line = {{"event", "target"}, {"camera", head.camera}, {"index", head.index}, {"file", relative}};
    line.update(to_json(*sum));
    line["provenance"] = head.provenance;
    if (auto s = state.journal.append(line); !s) {
        fs::remove(final_name, error);
        return s;
    }
    state.noted.insert({head.camera, head.index});
    return Done{};
}

Status ArchiveWriter::note_missing_target(uint32_t camera, uint32_t index, const std::string& why,
                                          const nlohmann::json& detail) {
    State& state = *state_;
    assert(!state.finished && !why.empty());
    if (state.noted.contains({camera, index}))
        return fail("target '" + target_file_name(camera, index) + "' is already noted");
    const nlohmann::json line = {
        {"event", "missing"}, {"camera", camera}, {"index", index}, {"why", why}, {"detail", detail}};
    if (auto s = state.journal.append(line); !s) return s;
    state.noted.insert({camera, index});
    state.missing.push_back({{"camera", camera}, {"index", index}, {"why", why}, {"detail", detail}});
    return Done{};
}

void ArchiveWriter::add_to_manifest(const nlohmann::json& extra) {
    state_->info.extra.merge_patch(extra);
}

Status ArchiveWriter::finish() {
    State& state = *state_;
    assert(!state.finished);
    nlohmann::json manifest = manifest_of(state.info);
    const size_t written = state.noted.size() - state.missing.size();
    manifest["targets"] = {{"written", written}, {"missing", state.missing}};
    const std::string text = text_of(manifest);
    if (auto s = write_file_durably((state.root / manifest_name).string(), text); !s) return s;
    const nlohmann::json line = {{"event", "end"},
                                 {"written", written},
                                 {"missing", state.missing.size()},
                                 {"manifest", to_json(checksum_text(text))}};
    if (auto s = state.journal.append(line); !s) return s;
    state.finished = true;
    return Done{};
}

}  // namespace ols

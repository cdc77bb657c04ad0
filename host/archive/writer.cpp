// SPDX-License-Identifier: MIT
// ArchiveWriter: every step leaves an archive that reads, whatever happens next.
#include <fmt/format.h>
#include <sys/stat.h>

#include <algorithm>
#include <cerrno>
#include <deque>
#include <filesystem>
#include <set>

#include "archive/archive.hpp"
#include "archive/archive_place.hpp"
#include "archive/disk.hpp"
#include "archive/journal.hpp"
#include "archive/manifest.hpp"
#include "archive/target_file.hpp"

namespace ols {

namespace fs = std::filesystem;

namespace {

// Room that is set aside for the manifest at the end, which then also says what is missing and why.
constexpr int64_t manifest_room = 1 << 20;
// What a shortened line of the journal says of a reason.
constexpr size_t short_reason_bytes = 160;

// Targets that are missing for one reason.
struct MissingRun {
    uint32_t camera = 0, first = 0, last = 0;
    std::string why;
    nlohmann::json detail;

    nlohmann::json line() const {
        nlohmann::json json = {{"camera", camera}, {"index", first}, {"why", why}};
        if (last > first) json["through"] = last;
        if (!detail.is_null()) json["detail"] = detail;
        return json;
    }
};

nlohmann::json journal_line(const MissingRun& run) {
    nlohmann::json line = run.line();
    line["event"] = "missing";
    return line;
}

}  // namespace

struct ArchiveWriter::State {
    ArchivePlace place;
    TakeInfo info;
    JournalWriter journal;
    ReservedFile manifest;
    std::set<std::pair<uint32_t, uint32_t>> written = {};  // camera and index
    std::vector<MissingRun> missing = {};                  // that the journal has
    std::deque<MissingRun> pending = {};  // that it has not, on a full disk; what follows the last may join it
    bool finished = false;

    bool has(uint32_t camera, uint32_t index) const {
        const auto holds = [&](const MissingRun& run) {
            return run.camera == camera && run.first <= index && index <= run.last;
        };
        return written.contains({camera, index}) || std::ranges::any_of(missing, holds) ||
               std::ranges::any_of(pending, holds);
    }

    Status note(MissingRun run) {
        if (journal.append(journal_line(run))) {
            missing.push_back(std::move(run));
            return Done{};
        }
        // The room set aside is for short lines, and for one a run, however many targets a full disk takes.
        run.detail = nullptr;
        run.why.resize(std::min(run.why.size(), short_reason_bytes));
        if (!pending.empty()) {
            MissingRun& before = pending.back();
            if (before.camera == run.camera && before.last + 1 == run.first && before.why == run.why) {
                before.last = run.last;
                return Done{};
            }
        }
        const Status journaled = journal_pending();
        pending.push_back(std::move(run));
        return journaled;
    }

    Status journal_pending() {
        for (; !pending.empty(); pending.pop_front()) {
            if (auto s = journal.append_reserved(journal_line(pending.front())); !s) return s;
            missing.push_back(std::move(pending.front()));
        }
        return Done{};
    }
};

namespace {

Status check_info(const TakeInfo& info) {
    if (info.lights.empty()) return fail("an archive needs at least one lamp");
    if (!(info.frame_rate_hz > 0)) return fail("an archive needs a frame rate above 0");
    if (!info.timecode_start.empty())
        if (const auto frames = timecode_frames(info.timecode_start, info.frame_rate_hz); !frames)
            return frames.error();
    return Done{};
}

// A reason that names the target's own file says so in words: what one disk did to many targets is one reason.
std::string without_name(std::string why, const fs::path& file) {
    for (const std::string& name : {"'" + file.string() + unfinished_suffix + "'", "'" + file.string() + "'"})
        if (const size_t at = why.find(name); at != std::string::npos) why.replace(at, name.size(), "its file");
    return why;
}

// lights.lp names lamps by their layers: what stands in the file is what stands in the images.
std::vector<LightPosition> named_by_layer(std::vector<LightPosition> lights) {
    for (size_t i = 0; i < lights.size(); ++i) lights[i].name = lamp_layer(int(i), int(lights.size()));
    return lights;
}

std::string text_of(const nlohmann::json& manifest) {
    return manifest.dump(1, ' ', false, nlohmann::json::error_handler_t::replace) + "\n";
}

// What a reader will make of it: an archive whose manifest it would refuse is not begun, and its targets' headers say the same.
Result<TakeInfo> as_read(const TakeInfo& info) {
    auto manifest = read_manifest(text_of(manifest_of(info)), manifest_name);
    if (!manifest) return fail("this take cannot be archived: " + manifest.error().message);
    return std::move(manifest->info);
}

// Fills the fresh directory; the journal comes last, so that a directory with a journal is an archive.
Result<JournalWriter> begin_archive(const fs::path& root, const TakeInfo& info) {
    const std::string lights_path = (root / lights_name).string();
    if (auto s = write_lp(lights_path, named_by_layer(info.lights)); !s) return s.error();
    const auto lights = checksum_file(lights_path);
    if (!lights) return lights.error();
    const std::string manifest = text_of(manifest_of(info));
    if (auto s = write_file_durably((root / manifest_name).string(), manifest); !s) return s.error();
    auto journal = JournalWriter::create((root / journal_name).string());
    if (!journal) return journal;
    const auto begun = journal->append({{"event", "begin"},
                                        {"version", archive_version},
                                        {"lights", to_json(*lights)},
                                        {"manifest", to_json(checksum_text(manifest))}});
    if (!begun) return begun.error();
    if (auto s = sync_directory(root.parent_path().string()); !s) return s.error();
    return journal;
}

}  // namespace

ArchiveWriter::ArchiveWriter(std::unique_ptr<State> state) : state_(std::move(state)) {}
ArchiveWriter::ArchiveWriter(ArchiveWriter&&) noexcept = default;
ArchiveWriter::~ArchiveWriter() = default;

Result<ArchiveWriter> ArchiveWriter::create(const std::string& path, const TakeInfo& info, bool overwrite) {
    auto writer = create_beside(path, info, overwrite);
    if (!writer) return writer;
    if (const auto placed = writer->take_place(); !placed) return placed.error();
    return writer;
}

Result<ArchiveWriter> ArchiveWriter::create_beside(const std::string& path, const TakeInfo& info, bool overwrite) {
    if (const auto checked = check_info(info); !checked) return checked.error();
    const auto read_back = as_read(info);
    if (!read_back) return read_back.error();
    auto place = ArchivePlace::make_beside(path, overwrite);
    if (!place) return place.error();
    auto journal = begin_archive(place->folder(), *read_back);
    if (!journal) return journal.error();
    auto manifest = ReservedFile::create((place->folder() / manifest_name).string(), manifest_room);
    if (!manifest) return manifest.error();
    return ArchiveWriter(
        std::unique_ptr<State>(new State{std::move(*place), *read_back, std::move(*journal), std::move(*manifest)}));
}

Status ArchiveWriter::take_place() {
    return state_->place.take();
}

std::string ArchiveWriter::folder() const {
    return state_->place.folder().string();
}

Status ArchiveWriter::expect_targets(uint32_t camera, uint32_t count) {
    return state_->journal.append({{"event", "expect"}, {"camera", camera}, {"targets", count}});
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
    if (state.has(head.camera, head.index)) return fail("target '" + relative + "' is already noted");

    const fs::path final_name = state.place.folder() / relative, temporary = final_name.string() + unfinished_suffix;
    std::error_code error;
    const std::string folder = final_name.parent_path().string();
    if (mkdir(folder.c_str(), 0777) == 0) {
        if (auto s = sync_directory(state.place.folder().string()); !s) return s;
    } else if (errno != EEXIST) {
        return disk_error("make", folder, errno);
    }

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
    state.written.insert({head.camera, head.index});
    (void)state.journal_pending();  // what still has no room stays pending
    return Done{};
}

Status ArchiveWriter::note_missing_target(uint32_t camera, uint32_t index, const std::string& why,
                                          const nlohmann::json& detail) {
    State& state = *state_;
    assert(!state.finished && !why.empty());
    const std::string file = target_file_name(camera, index);
    if (state.has(camera, index)) return fail("target '" + file + "' is already noted");
    return state.note({camera, index, index, without_name(why, state.place.folder() / file), detail});
}

Status ArchiveWriter::note_missing_targets(uint32_t camera, uint32_t first, uint32_t last, const std::string& why) {
    State& state = *state_;
    assert(!state.finished && !why.empty() && first <= last);
    return state.note({camera, first, last, why, nullptr});
}

void ArchiveWriter::add_to_manifest(const nlohmann::json& extra) {
    state_->info.extra.merge_patch(extra);
}

Status ArchiveWriter::finish() {
    State& state = *state_;
    assert(!state.finished);
    if (auto s = state.journal_pending(); !s) return s;
    nlohmann::json manifest = manifest_of(state.info), missing = nlohmann::json::array();
    uint64_t missing_count = 0;
    for (const MissingRun& run : state.missing) {
        missing.push_back(run.line());
        missing_count += uint64_t(run.last) - run.first + 1;
    }
    manifest["targets"] = {{"written", state.written.size()}, {"missing", missing}};
    const std::string text = text_of(manifest);
    if (auto s = state.manifest.write((state.place.folder() / manifest_name).string(), text); !s) return s;
    const nlohmann::json line = {{"event", "end"},
                                 {"written", state.written.size()},
                                 {"missing", missing_count},
                                 {"manifest", to_json(checksum_text(text))}};
    if (auto s = state.journal.append_reserved(line); !s) return s;
    state.finished = true;
    return take_place();
}

}  // namespace ols

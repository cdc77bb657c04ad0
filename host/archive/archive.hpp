// SPDX-License-Identifier: MIT
// Archives of reflectance functions (`take.rfa/`): what is in one, how it is written so that a crash loses nothing that
// was finished, and how it is read.
//
//   take.rfa/manifest.json             what the take is, its lamps, and what else is known; rewritten by rename
//   take.rfa/journal.jsonl             one fsynced line an event: begin, target (file, bytes, CRC-32), missing, end; chained
//   take.rfa/lights.lp                 the lamps as lamp_000 ... and their directions, for other programs
//   take.rfa/cam0/target_000000.exr    tiled, scene-linear, parts: "lamps" (layers lamp_000.Y, or .R .G .B),
//                                      "mask" (Y, UINT, MaskBit), "variance" (Y, FLOAT; left out when not known),
//                                      "noise_gain" (Y, FLOAT; left out when no sample was filled in),
//                                      "confidence" (Y, FLOAT; left out when nothing was aligned),
//                                      "matte" (Y or R G B, and variance, FLOAT; left out where there is none),
//                                      "motion" (instant_000.u .v ..., HALF; left out when not known)
//
// A target counts only when its journal line is complete and its file agrees with it. A target's file gets its name
// after its bytes are on the disk, and its journal line after that.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "image/target.hpp"
#include "result.hpp"
#include "stage/lamps.hpp"

namespace ols {

enum class SampleType { half_float, single_float };
enum class Compression { none, zips };  // of the lamps part; zips is lossless, smaller and slower to read

// What a manifest begins with; `extra` holds what only some takes have (identification, calibration, program).
struct TakeInfo {
    std::string production, scene, take, notes;  // slate
    std::string timecode_start;                  // SMPTE "HH:MM:SS:FF" of target 0, non-drop; "" if not known
    double frame_rate_hz = 24;                   // of targets
    std::string basis;                           // "" for ingested photographs
    std::string value_unit;                      // "reflectance" (white = 1) or "pixel" (full scale = 1)
    std::vector<LightPosition> lights;
    SampleType sample_type = SampleType::half_float;
    Compression compression = Compression::none;
    std::string color_interop_id = "unknown";  // of lamp values; camera mosaics have no standard name
    nlohmann::json extra = nlohmann::json::object();
};

// A rectangle of pixels.
struct Box {
    int x = 0, y = 0, width = 0, height = 0;
};

// Fills out[(y - box.y) * box.width + x - box.x] with samples of a plane (lamp * planes + colour).
using PlaneSource = std::function<Status(int plane, const Box& box, float* out)>;

// "lamp_000": the layer of a lamp in an archive of `count` lamps; more digits beyond a thousand, so that names sort.
std::string lamp_layer(int lamp, int count);

// Only one process writes an archive at a time: a second is refused, until the first has ended, however it ended.
class ArchiveWriter {
  public:
    // Makes the directory with its manifest, lights and journal, or leaves nothing. A path that exists is refused by
    // name; `overwrite` replaces it once the new one is there, but only if it consists of an archive's files: a stranger
    // among them is an error.
    static Result<ArchiveWriter> create(const std::string& path, const TakeInfo& info, bool overwrite = false);

    // The same, but the archive is made beside `path` (as `.NAME.recording`) and what is there stays until take_place() or
    // finish(). A writer that is destroyed before leaves nothing.
    static Result<ArchiveWriter> create_beside(const std::string& path, const TakeInfo& info, bool overwrite);

    // Gives the archive its name and removes the one it replaces. After an error it stays beside and may be written on;
    // finish() tries again.
    Status take_place();

    // Where the archive's files are now.
    std::string folder() const;

    // Journals how many targets a camera is to have, so that those of which nothing came to be known are named, too.
    Status expect_targets(uint32_t camera, uint32_t count);

    // Writes a target to a temporary name, fsyncs, renames, then journals it; for one thread at a time. After an error
    // (a full disk, say) neither file nor journal line stays, what was written before is untouched, and the writer may
    // be used on. Values that the sample type cannot hold are clamped and masked (mask_clamped), never Inf or NaN. Motion is
    // stored as half floats, an error of at most 1/2048 of a vector; one that check_motion() refuses is an error, and so is a
    // matte of another size than the target's or with values that are not finite.
    Status write_target(const Target& target);

    // The same for a target larger than memory: `head.lamps` is empty and blocks of planes come from `source`.
    Status write_target(const Target& head, const PlaneSource& source);

    // Journals a target that could not be made, and why. On a full disk the line comes later, when a target succeeds again or
    // another reason begins, at finish() at the latest, into room that is set aside: neighbours that are missing for one
    // reason in one line, with a shortened reason and without `detail`.
    Status note_missing_target(uint32_t camera, uint32_t index, const std::string& why,
                               const nlohmann::json& detail = {});

    // The same for all targets from `first` to `last`, in one line.
    Status note_missing_targets(uint32_t camera, uint32_t first, uint32_t last, const std::string& why);

    // Adds to the manifest's `extra` (merged by key, RFC 7396); on the disk after finish().
    void add_to_manifest(const nlohmann::json& extra);

    // Completes the manifest, for which room was set aside, and journals the end; an archive without it reads as
    // unfinished. Calls take_place().
    Status finish();

    ArchiveWriter(ArchiveWriter&&) noexcept;
    ~ArchiveWriter();

  private:
    struct State;
    explicit ArchiveWriter(std::unique_ptr<State>);
    std::unique_ptr<State> state_;
};

struct TargetEntry {
    uint32_t camera = 0, index = 0;
    uint32_t last = 0;        // of a run of missing targets, which begins at `index`; else the index
    std::string file;         // relative to the archive; empty for a missing target
    std::string why_missing;  // empty for a finished one
    nlohmann::json detail;    // provenance of a finished target, detail of a missing one
    uint64_t bytes = 0;
    uint32_t crc32 = 0;
};

// "target 3", or of a run "targets 3 to 9".
std::string target_words(const TargetEntry& entry);

// What a finished target's file is held against before it is read. Its header is always read and checked against the manifest, and
// its size against the journal.
enum class TargetCheck {
    size,      // nothing more: a head costs a few kilobytes, and changed samples go unnoticed
    checksum,  // all its bytes, against the journal's CRC-32: the file is read once more, from the system's cache
};

// One finished target, open for reading. The ArchiveReader that it comes from must live as long.
class TargetReader {
  public:
    // Everything but its samples: size, colour filter, missing lamps, provenance, times of its motion, frames of its matte.
    const Target& head() const;

    // How many rows, whole tiles, can be read at once so that their lamps take no more than 512 MB, or one row of tiles.
    int strip_rows() const;

    // A part of it, as a target of the box's size; any box inside it, fastest when aligned to 64 pixels. Memory: the tiles
    // that the box touches times lamps * planes * 4 bytes, and one plane more while it is cut from them.
    Result<Target> read_box(const Box& box) const;
    Result<Target> read() const;

    // The motion, which no other call reads; an error where it has none.
    Result<TargetMotion> read_motion() const;

    TargetReader(TargetReader&&) noexcept;
    ~TargetReader();

  private:
    friend class ArchiveReader;
    struct State;
    explicit TargetReader(std::unique_ptr<State>);
    std::unique_ptr<State> state_;
};

// What verify found: finished targets whose files are as the journal says, and one line for everything else.
struct Verification {
    std::vector<std::string> intact;    // files, relative to the archive
    std::vector<std::string> problems;  // each names its file: damaged, never finished, left over
    std::vector<std::string> notes;     // what could not be checked
};

class ArchiveReader {
  public:
    // Opens finished and unfinished archives alike: a torn last journal line and leftovers are verify's to tell. Only regular
    // files in the archive's own folder are read.
    static Result<ArchiveReader> open(const std::string& path);

    const TakeInfo& info() const;
    const nlohmann::json& manifest() const;
    const std::vector<TargetEntry>& targets() const;  // finished and missing, by camera and index
    // Runs of targets that were to come and are neither: the recording was interrupted. Empty if how many is not known.
    std::vector<TargetEntry> undecided() const;
    bool finished() const;                                     // the journal has its end
    bool being_written() const;                                // by a process that lives; false once finished
    const std::vector<std::string>& journal_problems() const;  // lines that are not as they were written

    // Errors: there is no such target or it is missing; its file is gone, no regular file, not as the journal says, of another
    // target, or no target of this archive (archive/target_header.hpp). Each names the file.
    Result<TargetReader> open_target(uint32_t camera, uint32_t index, TargetCheck check = TargetCheck::checksum) const;

    // The same in one call, each with its own check; read_head() checks the size alone.
    Result<Target> read_head(uint32_t camera, uint32_t index) const;
    Result<Target> read_target(uint32_t camera, uint32_t index) const;
    Result<Target> read_box(uint32_t camera, uint32_t index, const Box& box) const;
    Result<TargetMotion> read_motion(uint32_t camera, uint32_t index) const;

    // Compares every file with the journal's size and checksum, and opens each target. `deep`: and decodes every sample of every
    // part, each of which must be a value that it may have.
    Verification verify(bool deep = false) const;

    ArchiveReader(ArchiveReader&&) noexcept;
    ~ArchiveReader();

  private:
    struct State;
    explicit ArchiveReader(std::unique_ptr<State>);
    std::unique_ptr<State> state_;
};

}  // namespace ols

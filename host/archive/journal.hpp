// SPDX-License-Identifier: MIT
// The journal of an archive: one JSON object a line, each on the disk before the next thing happens. It alone says what
// was finished.
//
//   {"event":"begin","version":2,"lights":{"bytes":..,"crc32":".."},"manifest":{..}, chain}
//   {"event":"expect","camera":0,"targets":48, chain}
//   {"event":"target","camera":0,"index":0,"file":"cam0/target_000000.exr","bytes":..,"crc32":"..","provenance":{..}, chain}
//   {"event":"missing","camera":0,"index":1,"why":"..","detail":{..}, chain}
//   {"event":"missing","camera":0,"index":2,"through":47,"why":"..", chain}
//   {"event":"end","written":1,"missing":1,"manifest":{"bytes":..,"crc32":".."}, chain}
//
// The chain is what a line ends with, `"chain":"xxxxxxxx"`: the CRC-32 of every byte of the file before the comma in front of it.
// So a line that is changed, removed, doubled or moved shows. Version 1 has no chain, and no checksum of the manifest in its
// begin.
#pragma once

#include <filesystem>
#include <map>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "archive/archive.hpp"
#include "archive/disk.hpp"
#include "image/whole_file.hpp"

namespace ols {

nlohmann::json to_json(const Checksum& sum);

// The chain at the end of a line, `,"chain":"xxxxxxxx"}`, after bytes of this CRC-32.
std::string chain_text(uint32_t crc32);

// Beside what it holds, a journal has some room set aside (reserve_room), so that what a full disk made of a target can still be
// noted on that disk.
class JournalWriter {
  public:
    // Makes a new journal and syncs the directory that holds it.
    static Result<JournalWriter> create(const std::string& path);

    // Adds one line and syncs it, leaving the room set aside as it is. After an error the journal ends where it did before;
    // when even that cannot be restored every later append fails.
    Status append(const nlohmann::json& line);

    // The same, into the room set aside where there is no other: for a short line that must not be lost.
    Status append_reserved(const nlohmann::json& line);

    JournalWriter(JournalWriter&& other) noexcept;
    ~JournalWriter();  // gives back the room set aside

  private:
    explicit JournalWriter(int fd) : fd_(fd) {}
    Status append(std::string text, int64_t left_aside);

    int fd_ = -1;
    int64_t size_ = 0;
    uint32_t crc32_ = 0;  // of all that is in it
    bool broken_ = false;
};

struct Journal {
    bool ended = false;
    std::optional<Checksum> lights;         // of the begin
    std::optional<Checksum> manifest;       // of the end, or of the begin of a journal without one
    std::vector<TargetEntry> targets;       // sorted by camera and index; none twice
    std::map<uint32_t, uint32_t> expected;  // by camera, how many targets it was to have
    std::string torn;                       // what an interruption left of the last line; "" where it is whole
    std::vector<std::string> problems;      // everything else that is not as it was written; each names file and line
};

// Reads the journal of the archive in `root`, whose manifest is of this version. What is there is taken in as far as it is a
// journal's; only a file that cannot be opened is an error. Memory: the longest line, and what the lines say.
Result<Journal> read_journal(const std::filesystem::path& root, int version);

// How many finished and missing targets it notes.
uint64_t count_finished(const Journal& journal);
uint64_t count_missing(const Journal& journal);

// Runs of targets that were to come and of which the journal says nothing, as missing ones without a reason.
std::vector<TargetEntry> undecided_targets(const Journal& journal);

}  // namespace ols

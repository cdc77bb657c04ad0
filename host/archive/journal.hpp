// SPDX-License-Identifier: MIT
// The journal of an archive: one JSON object a line, each on the disk before the next thing happens. It alone says what
// was finished.
//
//   {"event":"begin","version":1,"lights":{"bytes":..,"crc32":".."}}
//   {"event":"expect","camera":0,"targets":48}
//   {"event":"target","camera":0,"index":0,"file":"cam0/target_000000.exr","bytes":..,"crc32":"..","provenance":{..}}
//   {"event":"missing","camera":0,"index":1,"why":"..","detail":{..}}
//   {"event":"missing","camera":0,"index":2,"through":47,"why":".."}
//   {"event":"end","written":1,"missing":1,"manifest":{"bytes":..,"crc32":".."}}
#pragma once

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
std::optional<Checksum> checksum_from_json(const nlohmann::json& json);

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
    Status append(const std::string& text, int64_t left_aside);

    int fd_ = -1;
    int64_t size_ = 0;
    bool broken_ = false;
};

struct Journal {
    bool ended = false;
    std::optional<Checksum> lights, manifest;
    std::vector<TargetEntry> targets;       // sorted by camera and index
    std::map<uint32_t, uint32_t> expected;  // by camera, how many targets it was to have
    std::vector<std::string> problems;      // a torn last line, lines that are no journal's; each names file and line
};

// Reads what there is; only a file that cannot be opened or does not begin as a journal is an error.
Result<Journal> read_journal(const std::string& path);

// Runs of targets that were to come and of which the journal says nothing, as missing ones without a reason.
std::vector<TargetEntry> undecided_targets(const Journal& journal);

}  // namespace ols

// SPDX-License-Identifier: MIT
// The journal of an archive: one JSON object a line, each on the disk before the next thing happens. It alone says what
// was finished.
//
//   {"event":"begin","version":1,"lights":{"bytes":..,"crc32":".."}}
//   {"event":"target","camera":0,"index":0,"file":"cam0/target_000000.exr","bytes":..,"crc32":"..","provenance":{..}}
//   {"event":"missing","camera":0,"index":1,"why":"..","detail":{..}}
//   {"event":"end","written":1,"missing":1,"manifest":{"bytes":..,"crc32":".."}}
#pragma once

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

class JournalWriter {
  public:
    // Makes a new journal and syncs the directory that holds it.
    static Result<JournalWriter> create(const std::string& path);

    // Adds one line and syncs it. After an error the journal ends where it did before; when even that cannot be
    // restored every later append fails.
    Status append(const nlohmann::json& line);

    JournalWriter(JournalWriter&& other) noexcept;
    ~JournalWriter();

  private:
    JournalWriter(std::string path, int fd);
    std::string path_;
    int fd_ = -1;
    int64_t size_ = 0;
    bool broken_ = false;
};

struct Journal {
    bool ended = false;
    std::optional<Checksum> lights, manifest;
    std::vector<TargetEntry> targets;   // sorted by camera and index
    std::vector<std::string> problems;  // a torn last line, lines that are no journal's; each names file and line
};

// Reads what there is; only a file that cannot be opened or does not begin as a journal is an error.
Result<Journal> read_journal(const std::string& path);

}  // namespace ols

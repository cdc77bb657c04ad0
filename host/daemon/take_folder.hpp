// SPDX-License-Identifier: MIT
// The takes on the disk: SLATE_NNN.rfa in one folder, named by slate and number.
#pragma once

#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "result.hpp"

namespace ols {

constexpr int take_number_max = 9999;

// Whether a slate may be a part of a file's name: 1 to 64 letters, digits, '-', '.', ' ' or '_' of ASCII, not '.' first, so that it
// stands for nothing but itself in any folder. The error says so.
Status check_slate(const std::string& slate);

struct TakeName {
    std::string slate;
    int number = 1;

    std::string text() const;  // "12A_003"
};

class TakeFolder {
  public:
    explicit TakeFolder(std::string path) : path_(std::move(path)) {}
    const std::string& path() const { return path_; }

    // The name with the number asked for, or else one above the slate's highest. Errors: the slate, a number that is there or out
    // of range, the folder cannot be read.
    Result<TakeName> next(const std::string& slate, std::optional<int> number) const;

    // Of the take itself, or of the same take in another quality: SLATE_NNN-QUALITY.rfa.
    std::string archive_of(const TakeName& name, const std::string& quality = "") const;

    // The archive of a take by its name, as "12A_003". Errors: no such name, no such take.
    Result<std::string> find(const std::string& name) const;

    // Of all takes, the latest first: name, archive, state (finished, being recorded, unfinished, or why it cannot be read), targets
    // written and missing, bytes, slate. At most `limit`.
    Result<nlohmann::json> list(size_t limit) const;

    // The latest take that has a finished target, and its last one's camera and index.
    struct Target {
        std::string archive;
        uint32_t camera = 0, index = 0;
    };
    Result<Target> latest_target(const std::string& take_name) const;  // of a take, or "" of the latest

  private:
    // Names of the archives there are, the latest first.
    Result<std::vector<std::string>> names() const;

    std::string path_;
};

}  // namespace ols

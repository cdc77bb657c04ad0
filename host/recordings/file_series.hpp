// SPDX-License-Identifier: MIT
// FileSeries: files whose names differ in a number alone.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "result.hpp"

namespace ols {

struct NumberedFile {
    int64_t number;
    std::string path;
};

struct FileSeries {
    std::string name;                 // "take_#.tif"
    std::vector<NumberedFile> files;  // by number, each once
    size_t others = 0;                // files of the folder without a number, or of no kind that is looked for
};

// The number is the last run of digits in front of the extension. A sign belongs to it where the folder has both signs of a name (a
// camera that counts from its trigger writes "a-0003.tif" and "a+0003.tif"). `path` is a folder with one series, or a file of the
// series that is meant. `any_kind`: files of any name, not only those that end as pictures do. Errors: no such file, several
// series, a number twice.
Result<FileSeries> find_series(const std::string& path, bool any_kind);

}  // namespace ols

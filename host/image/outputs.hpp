// SPDX-License-Identifier: MIT
// What a command is about to write, held against what it reads, before it does either.
#pragma once

#include <string>
#include <vector>

#include "result.hpp"

namespace ols {

// Empty names stand for options that were not given.
struct Outputs {
    std::vector<std::string> inputs = {};   // that are read; of a folder, all files in it
    std::vector<std::string> files = {};    // that are written whole
    std::vector<std::string> exr = {};      // the same, as OpenEXR
    std::vector<std::string> png = {};      // the same, as PNG
    std::vector<std::string> folders = {};  // that are made
    std::vector<std::string> streams = {};  // that grow by lines: devices and pipes are welcome, too
};

// An error that names the output and what to do: it is an input under whatever name (links, hard links, another spelling),
// two outputs are one file, its folder does not exist, writing would be refused (image/whole_file.hpp), or its name ends as
// another kind of file's.
Status check_outputs(const Outputs& outputs);

}  // namespace ols

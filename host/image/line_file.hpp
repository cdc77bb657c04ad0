// SPDX-License-Identifier: MIT
// A text file that grows by lines while something else runs: an account of frames. A line that cannot be written stops nothing,
// and is not forgotten.
#pragma once

#include <cstdio>
#include <memory>
#include <string>
#include <string_view>

#include "result.hpp"

namespace ols {

class LineFile {
  public:
    // Replaces what a file holds; an empty path takes lines and keeps none. Unlike files that are written whole it may be a
    // device or a pipe. A failure to open shows in status().
    explicit LineFile(const std::string& path);

    // Each line is with the system when this returns, so that a crash of the program loses none.
    void add(std::string_view line);

    // The first error so far.
    Status status() const;

    // Closes; the first error of all.
    Status finish();

  private:
    struct Close {
        void operator()(std::FILE* file) const { std::fclose(file); }
    };
    void note_error();

    std::string path_;
    std::unique_ptr<std::FILE, Close> file_;
    int error_ = 0;  // the first errno
};

}  // namespace ols

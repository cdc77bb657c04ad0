// SPDX-License-Identifier: MIT
// Lines through stdio, flushed one by one.
#include "image/line_file.hpp"

#include <cerrno>
#include <cstring>

namespace ols {

LineFile::LineFile(const std::string& path) : path_(path) {
    if (path.empty()) return;
    file_.reset(std::fopen(path.c_str(), "we"));
    if (!file_) note_error();
}

void LineFile::note_error() {
    if (error_ == 0) error_ = errno;
}

void LineFile::add(std::string_view line) {
    if (!file_ || error_ != 0) return;
    const bool written = std::fwrite(line.data(), 1, line.size(), file_.get()) == line.size() &&
                         std::fputc('\n', file_.get()) != EOF && std::fflush(file_.get()) == 0;
    if (!written) note_error();
}

Status LineFile::status() const {
    if (error_ == 0) return Done{};
    return fail("cannot write '" + path_ + "': " + std::strerror(error_) +
                ": check that its folder exists and has space");
}

Status LineFile::finish() {
    if (file_ && std::fclose(file_.release()) != 0) note_error();
    return status();
}

}  // namespace ols

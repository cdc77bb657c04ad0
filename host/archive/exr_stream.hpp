// SPDX-License-Identifier: MIT
// The output stream that OpenEXR writes a target through, so that no write error is lost (the library's destructors
// swallow them) and the file is synced by the descriptor that wrote it.
#pragma once

#include <ImfIO.h>

#include <cstdint>
#include <string>
#include <vector>

#include "result.hpp"

namespace ols {

class ExrStream : public Imf::OStream {
  public:
    // Makes or empties the file; a failure shows in finish().
    explicit ExrStream(const std::string& path);
    ~ExrStream() override;

    // Throws on a disk error, as OpenEXR expects of a stream.
    void write(const char bytes[], int count) override;
    uint64_t tellp() override { return position_; }
    void seekp(uint64_t position) override;

    // Writes what is buffered, syncs and closes; the first error that any call met.
    Status finish();

  private:
    void flush();

    std::string path_;
    int fd_ = -1;
    int error_ = 0;               // the first errno
    uint64_t position_ = 0;       // where the next byte goes
    std::vector<char> buffered_;  // bytes that end at position_
};

}  // namespace ols

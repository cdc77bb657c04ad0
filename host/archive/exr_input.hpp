// SPDX-License-Identifier: MIT
// The input stream that OpenEXR reads a target through, and what is looked at before the library may see the file.
#pragma once

#include <ImfIO.h>

#include <cstdint>
#include <vector>

#include "archive/archive_file.hpp"
#include "result.hpp"

namespace ols {

class ExrInput : public Imf::IStream {
  public:
    // The file outlives the stream.
    explicit ExrInput(const ArchiveFile& file);

    // Throws at a disk error and where the file ends early, as OpenEXR expects of a stream.
    bool read(char bytes[], int count) override;
    uint64_t tellg() override { return position_; }
    void seekg(uint64_t position) override { position_ = position; }

  private:
    const ArchiveFile& file_;
    uint64_t position_ = 0;
    uint64_t held_at_ = 0;    // where in the file `held_` begins
    std::vector<char> held_;  // headers are read byte by byte
};

// Walks over the headers of a multi-part OpenEXR file: the library makes room for an attribute of whatever size a file states
// before it reads it. Errors name the file: it is none of these, an attribute is larger than the file or of a type that no target
// has, there are more parts than a target has.
Status check_exr_headers(const ArchiveFile& file);

}  // namespace ols

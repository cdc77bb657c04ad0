// SPDX-License-Identifier: MIT
// What the headers of a .cine file say, checked against the file's size.
#pragma once

#include <functional>
#include <span>
#include <string>
#include <vector>

#include "image/sample_layout.hpp"
#include "record/recorded_frames.hpp"

namespace ols {

// Reads bytes of the file from an offset; false where there are not as many.
using ReadBytes = std::function<bool(uint64_t offset, std::span<std::byte> to)>;

struct CineHeader {
    RecordingFacts facts;
    SampleLayout layout;         // of a row of width * colors samples
    int colors = 1;              // 3: blue, green, red
    bool is_linearised = false;  // by cine_linear
    bool is_bottom_up = false;
    uint64_t row_bytes = 0;         // from row to row
    std::vector<uint64_t> offsets;  // of the images' annotations

    uint64_t image_bytes() const { return row_bytes * facts.height; }
};

// `size` is the file's, `path` for errors. Takes no memory that the file's size does not justify.
Result<CineHeader> read_cine_header(const ReadBytes& read, uint64_t size, const std::string& path);

}  // namespace ols

// SPDX-License-Identifier: MIT
// So many rows at a time as the nearest cache holds.
#include "device/row_copy.hpp"

#include <algorithm>
#include <cstring>

#include "image/streamed_copy.hpp"

namespace ols {

namespace {

constexpr size_t near_bytes = 8 << 10;

}  // namespace

void RowCopy::copy(const std::byte* samples, Frame& frame, RowWatcher* watcher) {
    const size_t pitch = frame.pitch_bytes;
    frame.samples.make_room(pitch * frame.height);
    if (frame.samples.empty()) return;
    const size_t rows_near = std::max<size_t>(1, near_bytes / pitch);
    if (near_.size() < rows_near * pitch) near_.resize(rows_near * pitch);
    for (size_t row = 0; row < frame.height; row += rows_near) {
        const size_t rows = std::min<size_t>(rows_near, frame.height - row), bytes = rows * pitch;
        std::memcpy(near_.data(), samples + row * pitch, bytes);
        if (watcher) watcher->watch(frame, uint32_t(row), uint32_t(rows), near_.data());
        copy_past_caches(near_.data(), bytes, frame.samples.data() + row * pitch);
    }
}

}  // namespace ols

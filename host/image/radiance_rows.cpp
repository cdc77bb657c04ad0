// SPDX-License-Identifier: MIT
// Source: Ward, "Radiance File Formats", and "Real Pixels" (Graphics Gems II): a row begins with 2 2 and its length if its components
// are coded one by one; else it is pixels, of which 1 1 1 n repeats the one before n times.
#include "image/radiance_rows.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <span>

#include "image/float_picture.hpp"

namespace ols {

namespace {

constexpr int shortest_new = 8, longest_new = 0x7fff;

bool may_be_new(int length) {
    return length >= shortest_new && length <= longest_new;
}

// The fewest bytes that can hold a row.
uint64_t least_bytes(int length) {
    constexpr int longest_run = 127, run_bytes = 2, components = 4;
    uint64_t old_bytes = 4;  // a pixel, then runs whose counts go on to higher bytes
    for (int64_t left = length - 1, most = 0xff; left > 0; left -= most, most <<= 8) old_bytes += 4;
    if (!may_be_new(length)) return old_bytes;
    const uint64_t runs = uint64_t((length + longest_run - 1) / longest_run);
    return std::min(old_bytes, 4 + components * run_bytes * runs);
}

// False if the bytes end or a run goes beyond the row.
bool read_new_component(std::string_view& bytes, std::span<Rgbe> row, size_t component) {
    size_t i = 0;
    while (i < row.size()) {
        if (bytes.size() < 2) return false;
        const size_t code = uint8_t(bytes[0]);
        const bool run = code > 128;
        const size_t count = run ? code - 128 : code;
        const size_t coded = run ? 1 : count;
        if (count == 0 || count > row.size() - i || bytes.size() < 1 + coded) return false;
        for (size_t k = 0; k < count; ++k) row[i++][component] = uint8_t(bytes[run ? 1 : 1 + k]);
        bytes.remove_prefix(1 + coded);
    }
    return true;
}

bool read_old_row(std::string_view& bytes, std::span<Rgbe> row) {
    size_t i = 0;
    int shift = 0;
    while (i < row.size()) {
        if (bytes.size() < 4) return false;
        const Rgbe pixel = {uint8_t(bytes[0]), uint8_t(bytes[1]), uint8_t(bytes[2]), uint8_t(bytes[3])};
        bytes.remove_prefix(4);
        if (pixel[0] != 1 || pixel[1] != 1 || pixel[2] != 1) {
            row[i++] = pixel;
            shift = 0;
            continue;
        }
        constexpr int last_shift = 24;
        if (i == 0 || shift > last_shift) return false;
        const size_t count = size_t(pixel[3]) << shift;
        if (count > row.size() - i) return false;
        std::fill_n(row.begin() + std::ptrdiff_t(i), count, row[i - 1]);
        i += count;
        shift += 8;
    }
    return true;
}

bool read_row(std::string_view& bytes, std::span<Rgbe> row) {
    const auto byte = [&](size_t i) { return i < bytes.size() ? int(uint8_t(bytes[i])) : -1; };
    const bool is_new = may_be_new(int(row.size())) && byte(0) == 2 && byte(1) == 2 && byte(2) >= 0 && byte(2) < 128;
    if (!is_new) return read_old_row(bytes, row);
    if (byte(2) * 256 + byte(3) != int(row.size())) return false;
    bytes.remove_prefix(4);
    for (size_t component = 0; component < 4; ++component)
        if (!read_new_component(bytes, row, component)) return false;
    return true;
}

}  // namespace

Result<std::vector<Rgbe>> read_radiance_rows(std::string_view& bytes, int rows, int length) {
    if (least_bytes(length) * uint64_t(rows) > bytes.size())
        return fail(
            fmt::format("it says {} rows of {} pixels, which the {} bytes behind its header cannot hold: copy it again",
                        rows, length, bytes.size()));
    if (uint64_t(rows) * uint64_t(length) > most_pixels)
        return fail(fmt::format("it says {} rows of {} pixels, and no more than {} are read: scale it down", rows,
                                length, most_pixels));
    std::vector<Rgbe> pixels(size_t(rows) * size_t(length));
    for (int row = 0; row < rows; ++row)
        if (!read_row(bytes, std::span(pixels).subspan(size_t(row) * size_t(length), size_t(length))))
            return fail(fmt::format("it is damaged or cut short in row {} of {}: copy it again", row + 1, rows));
    return pixels;
}

}  // namespace ols

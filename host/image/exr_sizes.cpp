// SPDX-License-Identifier: MIT
// The attributes that state sizes, read with the fewest assumptions.
#include "image/exr_sizes.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <optional>
#include <string>
#include <vector>

#include "image/float_picture.hpp"

namespace ols {

namespace {

struct Window {
    int64_t min_x = 0, min_y = 0, max_x = -1, max_y = -1;
    // Differences of 32-bit numbers; as double, so that a product cannot wrap.
    double width() const { return double(max_x - min_x + 1); }
    double height() const { return double(max_y - min_y + 1); }
    double pixels() const { return width() * height(); }
    bool empty() const { return max_x < min_x || max_y < min_y; }
};

struct PartSizes {
    Window data, display;
    int compression = -1;
    double tile_width = 0, tile_height = 0;  // 0 for scanlines
    double pixel_bytes = 0;                  // all channels, subsampled ones by their share
    bool deep = false;
};

// How many times smaller than its pixels a compression can make a chunk, and how many lines a chunk has (OpenEXR 3.1's codecs by
// their number): runs of 128 in 2 bytes; deflate's 1032; Huffman with 256 16-bit symbols in 10 bits; deflate on 3 of 4 bytes; blocks
// of 32 bytes in 3; runs of runs, and deflate on the means of blocks of 8 x 8.
struct Codec {
    const char* name;
    double most_expansion;
    int lines;
};
constexpr Codec codecs[] = {{"no", 1, 1},        {"RLE", 64, 1},      {"ZIPS", 1032, 1}, {"ZIP", 1032, 16},
                            {"PIZ", 410, 32},    {"PXR24", 1376, 16}, {"B44", 11, 32},   {"B44A", 11, 32},
                            {"DWAA", 70000, 32}, {"DWAB", 70000, 256}};

class HeaderReader {
  public:
    HeaderReader(std::istream& stream, uint64_t bytes) : stream_(stream), left_(bytes) {}

    bool take(void* to, size_t n) {
        if (n > left_ || !stream_.read(static_cast<char*>(to), std::streamsize(n))) return false;
        left_ -= n;
        return true;
    }

    std::optional<std::string> text() {
        constexpr size_t longest = 256;  // names end at 255 bytes
        std::string name;
        for (char c; name.size() < longest && take(&c, 1); name.push_back(c))
            if (c == 0) return name;
        return std::nullopt;
    }

    // The bytes of an attribute's value; those of large ones, which state no sizes, are passed over.
    std::optional<std::string> value() {
        constexpr int32_t largest = 1 << 20;
        int32_t size = 0;
        if (!take(&size, 4) || size < 0 || uint64_t(size) > left_) return std::nullopt;
        std::string bytes;
        if (size > largest) {
            left_ -= uint64_t(size);
            if (!stream_.seekg(size, std::ios::cur)) return std::nullopt;
            return bytes;
        }
        bytes.resize(size_t(size));
        if (size > 0 && !take(bytes.data(), bytes.size())) return std::nullopt;
        return bytes;
    }

  private:
    std::istream& stream_;
    uint64_t left_;
};

template <typename T>
T number_at(const std::string& bytes, size_t at) {
    T value{};
    if (at + sizeof value <= bytes.size()) std::memcpy(&value, bytes.data() + at, sizeof value);
    return value;
}

Window window_of(const std::string& bytes) {
    return {number_at<int32_t>(bytes, 0), number_at<int32_t>(bytes, 4), number_at<int32_t>(bytes, 8),
            number_at<int32_t>(bytes, 12)};
}

// A list of name, type, four bytes, x and y sampling; ends with an empty name.
double pixel_bytes_of(const std::string& list) {
    double bytes = 0;
    size_t at = 0;
    while (at < list.size() && list[at] != 0) {
        const size_t end = list.find('\0', at);
        if (end == std::string::npos || end + 17 > list.size()) break;
        const double x = std::max(number_at<int32_t>(list, end + 9), 1),
                     y = std::max(number_at<int32_t>(list, end + 13), 1);
        bytes += (number_at<int32_t>(list, end + 1) == 1 ? 2 : 4) / (x * y);
        at = end + 17;
    }
    return bytes;
}

void note(PartSizes& part, const std::string& name, const std::string& value) {
    if (name == "dataWindow") part.data = window_of(value);
    if (name == "displayWindow") part.display = window_of(value);
    if (name == "compression") part.compression = value.empty() ? -1 : uint8_t(value[0]);
    if (name == "channels") part.pixel_bytes = pixel_bytes_of(value);
    if (name == "type") part.deep = value.starts_with("deep");
    if (name == "tiles") {
        part.tile_width = number_at<uint32_t>(value, 0);
        part.tile_height = number_at<uint32_t>(value, 4);
    }
}

Error damaged_header() {
    return fail("its header is damaged or cut short: copy it again");
}

// One header; nullopt for the empty one that ends the list of a multi-part file.
Result<std::optional<PartSizes>> read_part(HeaderReader& reader) {
    PartSizes part;
    for (bool first = true;; first = false) {
        const auto name = reader.text();
        if (!name) return damaged_header();
        if (name->empty()) return first ? std::optional<PartSizes>() : part;
        const auto type = reader.text();
        const auto value = reader.value();
        if (!type || !value) return damaged_header();
        note(part, *name, *value);
    }
}

double chunks_of(const PartSizes& part, const Codec& codec) {
    if (part.tile_width > 0 && part.tile_height > 0)
        return std::ceil(part.data.width() / part.tile_width) * std::ceil(part.data.height() / part.tile_height);
    return std::ceil(part.data.height() / codec.lines);
}

Status check_part(const PartSizes& part, uint64_t file_bytes) {
    if (part.data.empty() || part.display.empty()) return fail("its data or display window is empty: it is damaged");
    if (part.compression < 0 || part.compression >= int(std::size(codecs)))
        return fail(
            fmt::format("it has compression {}, which this program does not know: save it with ZIP", part.compression));
    const Codec& codec = codecs[part.compression];
    const auto too_much = [&](double width, double height, const char* what) {
        return fail(fmt::format(
            "it says {:.0f} x {:.0f} pixels{}, which its {} bytes with {} compression cannot hold: it is damaged",
            width, height, what, file_bytes, codec.name));
    };
    constexpr int offset_bytes = 8;
    if (chunks_of(part, codec) * offset_bytes > double(file_bytes))
        return too_much(part.data.width(), part.data.height(), "");
    if (part.deep) return Done{};
    if (!(part.pixel_bytes > 0)) return fail("it has no channels: it is damaged");
    const double most_bytes = codec.most_expansion * double(file_bytes);
    if (part.data.pixels() * part.pixel_bytes > most_bytes) return too_much(part.data.width(), part.data.height(), "");
    if (part.tile_width * part.tile_height * part.pixel_bytes > most_bytes)
        return too_much(part.tile_width, part.tile_height, " in a tile");
    // The library decodes into whole chunks, however few lines a picture has.
    const bool tiled = part.tile_width > 0 && part.tile_height > 0;
    if (const double lines = std::max(codec.lines, 1);
        !tiled && part.data.width() * lines * part.pixel_bytes > std::max(most_bytes, double(most_chunk_bytes)))
        return too_much(part.data.width(), lines, " in a chunk");
    const double most = double(most_pixels);
    if (part.data.pixels() > most || part.tile_width * part.tile_height > most || part.display.pixels() > most)
        return fail(fmt::format("it says {:.0f} x {:.0f} pixels, and no more than {} are read: scale it down",
                                part.display.width(), part.display.height(), most_pixels));
    if (part.display.pixels() > std::max(double(most_black_pixels), 16 * part.data.pixels()))
        return fail(fmt::format(
            "its display window of {:.0f} x {:.0f} is far larger than its data window of {:.0f} x {:.0f}: crop it",
            part.display.width(), part.display.height(), part.data.width(), part.data.height()));
    return Done{};
}

}  // namespace

Status check_exr_sizes(std::istream& file, uint64_t file_bytes) {
    constexpr uint32_t many_parts = 0x1000;
    HeaderReader reader(file, file_bytes);
    uint32_t start[2] = {};
    if (!reader.take(start, sizeof start)) return damaged_header();
    do {
        const auto part = read_part(reader);
        if (!part) return part.error();
        if (!*part) break;
        if (const Status fits = check_part(**part, file_bytes); !fits) return fits;
    } while (start[1] & many_parts);
    return Done{};
}

}  // namespace ols

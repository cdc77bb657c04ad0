// SPDX-License-Identifier: MIT
// TGA decoding.
#include "image/tga.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <fstream>
#include <iterator>
#include <vector>

namespace ols {

namespace {

using Bytes = std::vector<unsigned char>;

constexpr size_t header_bytes = 18;
constexpr size_t packet_pixels_max = 128;
enum ImageType { true_color = 2, grey = 3, run_length = 8 };  // run_length is a bit added to the others

int word_at(const Bytes& bytes, size_t at) {
    return bytes[at] | bytes[at + 1] << 8;
}

// Expands packets of up to packet_pixels_max pixels, a repeated one or that many plain ones, into `wanted` bytes; shorter when the
// file ends before.
Bytes expand_runs(const Bytes& file, size_t at, size_t pixel_bytes, size_t wanted) {
    Bytes out;
    out.reserve(wanted);
    while (out.size() < wanted && at < file.size()) {
        const unsigned char packet = file[at++];
        const size_t count = packet % packet_pixels_max + 1, repeats = packet & 128 ? count : 1;
        const size_t bytes = (packet & 128 ? 1 : count) * pixel_bytes;
        if (at + bytes > file.size()) break;
        for (size_t k = 0; k < repeats; ++k) out.insert(out.end(), file.begin() + at, file.begin() + at + bytes);
        at += bytes;
    }
    out.resize(std::min(out.size(), wanted));
    return out;
}

}  // namespace

Result<Image> read_tga(const std::string& path) {
    std::ifstream stream(path, std::ios::binary);
    if (!stream) return fail("cannot open '" + path + "': check the path");
    const Bytes file{std::istreambuf_iterator<char>(stream), {}};
    const auto reject = [&](const std::string& why) { return fail("cannot read '" + path + "' as TGA: " + why); };
    if (file.size() < header_bytes) return reject("it is too short");

    const int type = file[2] & ~run_length, bits = file[16];
    if (type != true_color && type != grey) return reject("it is colour-mapped; save it as 24-bit true colour");
    if (type == true_color ? bits != 24 && bits != 32 : bits != 8)
        return reject(fmt::format("{} bits a pixel; save it with 24", bits));
    const size_t pixel_bytes = size_t(bits) / 8;
    const size_t map_bytes = file[1] == 1 ? size_t(word_at(file, 5)) * ((file[7] + 7) / 8) : 0;
    const size_t start = header_bytes + file[0] + map_bytes;
    const int width = word_at(file, 12), height = word_at(file, 14);
    const size_t pixel_count = size_t(width) * height, wanted = pixel_count * pixel_bytes;
    if (wanted == 0) return reject("it has no pixels");

    // A header may state 65535 x 65535 pixels, so the file has to be long enough for them before any is made room for.
    const bool runs = file[2] & run_length;
    const size_t packets_min = (pixel_count + packet_pixels_max - 1) / packet_pixels_max;
    const size_t stored_min = runs ? packets_min * (1 + pixel_bytes) : wanted;
    const auto early = [&] { return reject("it ends early; copy it again"); };
    if (file.size() < start + stored_min) return early();
    const auto stored = file.begin() + std::ptrdiff_t(start);
    const Bytes pixels =
        runs ? expand_runs(file, start, pixel_bytes, wanted) : Bytes(stored, stored + std::ptrdiff_t(wanted));
    if (pixels.size() < wanted) return early();

    // Descriptor bit 4: columns run right to left; bit 5: rows run top to bottom.
    const bool from_right = file[17] & 16, from_top = file[17] & 32;
    Image image(width, height, type == grey ? 1 : 3);
    for (int y = 0; y < height; ++y)
        for (int x = 0; x < width; ++x) {
            const size_t row = from_top ? y : height - 1 - y, column = from_right ? width - 1 - x : x;
            const unsigned char* p = pixels.data() + (row * width + column) * pixel_bytes;
            for (int c = 0; c < image.channels; ++c) image.at(x, y, c) = p[image.channels - 1 - c];  // stored B G R
        }
    return image;
}

}  // namespace ols

// SPDX-License-Identifier: MIT
// libpng's simplified interface. It labels what it writes as sRGB.
#include "image/png.hpp"

#include <png.h>

#include <cassert>
#include <string_view>
#include <vector>

#include "image/tone.hpp"
#include "image/whole_file.hpp"

namespace ols {

namespace {

Result<std::vector<uint8_t>> encode_png(int width, int height, std::span<const uint8_t> rgb8) {
    assert(rgb8.size() == size_t(width) * height * 3);
    png_image image{};
    image.version = PNG_IMAGE_VERSION;
    image.width = png_uint_32(width);
    image.height = png_uint_32(height);
    image.format = PNG_FORMAT_RGB;
    std::vector<uint8_t> encoded(PNG_IMAGE_PNG_SIZE_MAX(image));
    png_alloc_size_t size = encoded.size();
    if (!png_image_write_to_memory(&image, encoded.data(), &size, 0, rgb8.data(), 0, nullptr))
        return fail(std::string("cannot encode a PNG: ") + image.message);
    encoded.resize(size);
    return encoded;
}

}  // namespace

Status write_png(const std::string& path, int width, int height, std::span<const uint8_t> rgb8) {
    const auto encoded = encode_png(width, height, rgb8);
    if (!encoded.ok()) return fail("cannot write '" + path + "': " + encoded.error().message);
    return write_whole_file(path, std::string_view(reinterpret_cast<const char*>(encoded->data()), encoded->size()));
}

Result<std::vector<uint8_t>> encode_png_preview(const Image& scene_linear) {
    return encode_png(scene_linear.width, scene_linear.height, tone_mapped_rgb8(scene_linear));
}

Status write_png_preview(const std::string& path, const Image& scene_linear) {
    return write_png(path, scene_linear.width, scene_linear.height, tone_mapped_rgb8(scene_linear));
}

}  // namespace ols

// SPDX-License-Identifier: MIT
// The chunks of a WebP file.
#include "photographs/webp_label.hpp"

#include <fmt/format.h>

#include <string_view>

#include "image/input_file.hpp"
#include "photographs/file_damage.hpp"

namespace ols {

namespace {

uint32_t little_word(std::string_view bytes, size_t at) {
    uint32_t value = 0;
    for (size_t i = 4; i-- > 0;) value = value << 8 | (unsigned char)bytes[at + i];
    return value;
}

}  // namespace

Result<WebpLabel> read_webp_label(const std::string& path) {
    const auto bytes = read_input(path, "picture", largest_picture_file);
    if (!bytes) return bytes.error();
    const std::string_view file = *bytes;
    if (file.size() < 12 || uint64_t(little_word(file, 4)) + 8 > file.size())
        return damaged_picture(path, "it is cut short");
    WebpLabel result;
    for (size_t at = 12; at + 8 <= file.size();) {
        const size_t length = little_word(file, at + 4);
        if (length > file.size() - at - 8) return damaged_picture(path, "it is cut short");
        const std::string_view type = file.substr(at, 4), data = file.substr(at + 8, length);
        if (type == "ICCP") {
            result.label.profile.assign(data.begin(), data.end());
            result.label.name = "its profile";
        }
        if (type == "EXIF") {
            const std::string_view tiff =
                data.starts_with("Exif") ? data.substr(std::min<size_t>(6, data.size())) : data;
            result.exif.assign(tiff.begin(), tiff.end());
        }
        at += 8 + length + (length & 1);
    }
    return result;
}

}  // namespace ols

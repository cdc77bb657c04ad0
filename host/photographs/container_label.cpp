// SPDX-License-Identifier: MIT
// WebP is a list of chunks; H.273 is a list of codes.
#include "photographs/container_label.hpp"

#include <fmt/format.h>

#include <string_view>

#include "image/input_file.hpp"

namespace ols {

namespace {

constexpr uint64_t largest_file = uint64_t(1) << 32;

Error damaged(const std::string& path, const std::string& why) {
    return fail("'" + path + "' is damaged (" + why + "): copy it again");
}

uint32_t little_word(std::string_view bytes, size_t at) {
    uint32_t value = 0;
    for (size_t i = 4; i-- > 0;) value = value << 8 | (unsigned char)bytes[at + i];
    return value;
}

}  // namespace

Result<ColorLabel> label_of_codes(int primaries, int transfer, const std::string& name) {
    // Transfers: 1, 6, 14 and 15 are video's curve, which pictures of sRGB's are often said to have; 2 is not said; 8 is linear; 13 sRGB's.
    constexpr int bt709 = 1, unsaid = 2, bt2020 = 9, display_p3 = 12;
    if (transfer == 16 || transfer == 18)
        return fail(fmt::format("is coded for a display ({})", transfer == 16 ? "PQ" : "HLG"));
    const bool is_srgb_curve = transfer == 13 || transfer == 1 || transfer == 6 || transfer == 14 || transfer == 15;
    if (!is_srgb_curve && transfer != unsaid && transfer != 8)
        return fail(fmt::format("has a transfer of an unusual kind (code {} of H.273)", transfer));
    ColorLabel label;
    if (transfer == unsaid && (primaries == unsaid || primaries == bt709)) return label;
    label.name = name;
    label.is_srgb = is_srgb_curve && (primaries == bt709 || primaries == unsaid);
    if (label.is_srgb) return label;
    if (primaries == bt2020)
        label.primaries = Primaries{{0.708, 0.292}, {0.170, 0.797}, {0.131, 0.046}, {0.3127, 0.3290}};
    else if (primaries == display_p3)
        label.primaries = Primaries{{0.680, 0.320}, {0.265, 0.690}, {0.150, 0.060}, {0.3127, 0.3290}};
    else if (primaries == bt709 || primaries == unsaid)
        label.primaries = rec709_primaries;
    else
        return fail(fmt::format("has primaries of an unusual kind (code {} of H.273)", primaries));
    if (transfer == 8)
        label.gamma = 1;
    else
        label.curves.fill(srgb_curve());
    return label;
}

Result<WebpLabel> read_webp_label(const std::string& path) {
    const auto bytes = read_input(path, "picture", largest_file);
    if (!bytes) return bytes.error();
    const std::string_view file = *bytes;
    if (file.size() < 12 || uint64_t(little_word(file, 4)) + 8 > file.size()) return damaged(path, "it is cut short");
    WebpLabel result;
    for (size_t at = 12; at + 8 <= file.size();) {
        const size_t length = little_word(file, at + 4);
        if (length > file.size() - at - 8) return damaged(path, "it is cut short");
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

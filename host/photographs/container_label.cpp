// SPDX-License-Identifier: MIT
// libheif for HEIF; WebP is a list of chunks.
#include "photographs/container_label.hpp"

#include <fmt/format.h>
#include <libheif/heif.h>

#include <memory>
#include <string_view>

#include "image/input_file.hpp"

namespace ols {

namespace {

constexpr uint64_t largest_file = uint64_t(1) << 32;

using Context = std::unique_ptr<heif_context, void (*)(heif_context*)>;

struct HandleRelease {
    void operator()(heif_image_handle* handle) const { heif_image_handle_release(handle); }
};
using Handle = std::unique_ptr<heif_image_handle, HandleRelease>;

Error damaged(const std::string& path, const std::string& why) {
    return fail("'" + path + "' is damaged (" + why + "): copy it again");
}

Result<ColorLabel> label_of_nclx(heif_image_handle* handle, const std::string& path) {
    heif_color_profile_nclx* codes = nullptr;
    if (heif_image_handle_get_nclx_color_profile(handle, &codes).code != heif_error_Ok || !codes) return ColorLabel{};
    const int primaries = codes->color_primaries, transfer = codes->transfer_characteristics;
    heif_nclx_color_profile_free(codes);
    auto label = label_of_codes(primaries, transfer, "its colour codes");
    if (!label) return fail("'" + path + "' " + label.error().message + ": save it as sRGB or linear");
    return label;
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

Result<ContainerLabel> read_heif_label(const std::string& path) {
    const Context context(heif_context_alloc(), heif_context_free);
    const auto read = heif_context_read_from_file(context.get(), path.c_str(), nullptr);
    if (read.code != heif_error_Ok) return damaged(path, read.message);
    heif_image_handle* primary = nullptr;
    const auto found = heif_context_get_primary_image_handle(context.get(), &primary);
    if (found.code != heif_error_Ok) return damaged(path, found.message);
    const Handle handle(primary);
    ContainerLabel result;
    if (const int bits = heif_image_handle_get_luma_bits_per_pixel(primary); bits > 8)
        result.said.push_back(fmt::format("its {} bits are read as 8", bits));
    const auto type = heif_image_handle_get_color_profile_type(primary);
    if (type == heif_color_profile_type_prof || type == heif_color_profile_type_rICC) {
        result.label.profile.resize(heif_image_handle_get_raw_color_profile_size(primary));
        result.label.name = "its profile";
        const auto got = heif_image_handle_get_raw_color_profile(primary, result.label.profile.data());
        if (got.code != heif_error_Ok) return damaged(path, got.message);
    } else if (type == heif_color_profile_type_nclx) {
        auto label = label_of_nclx(primary, path);
        if (!label) return label.error();
        result.label = std::move(*label);
    }
    return result;
}

Result<ContainerLabel> read_webp_label(const std::string& path) {
    const auto bytes = read_input(path, "picture", largest_file);
    if (!bytes) return bytes.error();
    const std::string_view file = *bytes;
    if (file.size() < 12 || uint64_t(little_word(file, 4)) + 8 > file.size()) return damaged(path, "it is cut short");
    ContainerLabel result;
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

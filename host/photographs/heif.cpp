// SPDX-License-Identifier: MIT
#include "photographs/heif.hpp"

#include <fmt/format.h>
#include <libheif/heif.h>

#include <algorithm>
#include <cstring>
#include <memory>

#include "image/input_file.hpp"
#include "photographs/file_damage.hpp"
#include "photographs/stated_size.hpp"

namespace ols {

namespace {

template <auto release>
struct Release {
    template <typename T>
    void operator()(T* object) const {
        release(object);
    }
};
using Context = std::unique_ptr<heif_context, Release<heif_context_free>>;
using Handle = std::unique_ptr<heif_image_handle, Release<heif_image_handle_release>>;
using Options = std::unique_ptr<heif_decoding_options, Release<heif_decoding_options_free>>;
using Decoded = std::unique_ptr<heif_image, Release<heif_image_release>>;

Result<Handle> open_page(heif_context* context, const std::string& path, int page) {
    std::vector<heif_item_id> ids(size_t(std::max(heif_context_get_number_of_top_level_images(context), 0)));
    ids.resize(size_t(heif_context_get_list_of_top_level_image_IDs(context, ids.data(), int(ids.size()))));
    if (ids.empty()) return damaged_picture(path, "it holds no picture");
    if (auto s = check_page(path, int(ids.size()), page); !s) return s.error();
    heif_image_handle* handle = nullptr;
    const auto got = heif_context_get_image_handle(context, ids[size_t(std::max(page, 1) - 1)], &handle);
    if (got.code != heif_error_Ok) return damaged_picture(path, got.message);
    return Handle(handle);
}

Result<ColorLabel> label_of(heif_image_handle* handle, const std::string& path) {
    const auto type = heif_image_handle_get_color_profile_type(handle);
    ColorLabel label;
    if (type == heif_color_profile_type_prof || type == heif_color_profile_type_rICC) {
        label.profile.resize(heif_image_handle_get_raw_color_profile_size(handle));
        label.name = "its profile";
        const auto got = heif_image_handle_get_raw_color_profile(handle, label.profile.data());
        if (got.code != heif_error_Ok) return damaged_picture(path, got.message);
        return label;
    }
    heif_color_profile_nclx* codes = nullptr;
    if (heif_image_handle_get_nclx_color_profile(handle, &codes).code != heif_error_Ok || !codes) return label;
    const int primaries = codes->color_primaries, transfer = codes->transfer_characteristics;
    heif_nclx_color_profile_free(codes);
    auto of_codes = label_of_codes(primaries, transfer, "its colour codes");
    if (!of_codes) return fail("'" + path + "' " + of_codes.error().message + ": save it as sRGB or linear");
    return of_codes;
}

// The first Exif block: four bytes that say where the TIFF header is, then that (ISO/IEC 23008-12, A.2.1).
std::vector<uint8_t> exif_of(heif_image_handle* handle) {
    heif_item_id id = 0;
    if (heif_image_handle_get_list_of_metadata_block_IDs(handle, "Exif", &id, 1) != 1) return {};
    std::vector<uint8_t> block(heif_image_handle_get_metadata_size(handle, id));
    if (block.size() < 4 || heif_image_handle_get_metadata(handle, id, block.data()).code != heif_error_Ok) return {};
    const size_t offset = size_t(block[0]) << 24 | block[1] << 16 | block[2] << 8 | block[3];
    block.erase(block.begin(), block.begin() + std::ptrdiff_t(std::min(4 + offset, block.size())));
    return block;
}

Result<Decoded> decode(heif_image_handle* handle, heif_chroma chroma, const std::string& path) {
    const Options options(heif_decoding_options_alloc());
    options->strict_decoding = 1;
    heif_image* decoded = nullptr;
    const auto done = heif_decode_image(handle, &decoded, heif_colorspace_RGB, chroma, options.get());
    Decoded image(decoded);
    if (done.code != heif_error_Ok) return damaged_picture(path, done.message);
    heif_error warning;
    if (heif_image_get_decoding_warnings(decoded, 0, &warning, 1) > 0) return damaged_picture(path, warning.message);
    return image;
}

// Codes of `bits` in 16 little-endian ones, as fractions of 65535.
std::vector<uint16_t> wide_codes(const uint8_t* plane, int stride, int row_samples, int height, int bits) {
    const uint32_t last = (1u << bits) - 1;
    std::vector<uint16_t> codes;
    codes.reserve(size_t(row_samples) * height);
    for (int y = 0; y < height; ++y)
        for (int x = 0; x < row_samples; ++x) {
            const uint8_t* code = plane + size_t(y) * stride + 2 * x;
            const uint32_t value = std::min<uint32_t>(code[0] | code[1] << 8, last);
            codes.push_back(uint16_t((value * 65535 + last / 2) / last));
        }
    return codes;
}

std::vector<uint8_t> byte_codes(const uint8_t* plane, int stride, int row_samples, int height) {
    std::vector<uint8_t> codes(size_t(row_samples) * height);
    for (int y = 0; y < height; ++y)
        std::memcpy(codes.data() + size_t(y) * row_samples, plane + size_t(y) * stride, row_samples);
    return codes;
}

Status read_codes(heif_image_handle* handle, const std::string& path, int bits, PictureSamples& samples) {
    const bool wide = bits > 8, alpha = samples.alpha >= 0;
    const auto image = decode(handle,
                              wide    ? alpha ? heif_chroma_interleaved_RRGGBBAA_LE : heif_chroma_interleaved_RRGGBB_LE
                              : alpha ? heif_chroma_interleaved_RGBA
                                      : heif_chroma_interleaved_RGB,
                              path);
    if (!image) return image.error();
    int stride = 0;
    const uint8_t* plane = heif_image_get_plane_readonly(image->get(), heif_channel_interleaved, &stride);
    const int width = heif_image_get_width(image->get(), heif_channel_interleaved);
    const int height = heif_image_get_height(image->get(), heif_channel_interleaved);
    if (!plane || width != samples.width || height != samples.height)
        return damaged_picture(
            path, fmt::format("it says {} x {} and holds {} x {}", samples.width, samples.height, width, height));
    const int row_samples = width * samples.channels;
    if (stride < row_samples * (wide ? 2 : 1)) return damaged_picture(path, "its rows are too short");
    if (wide)
        samples.codes = wide_codes(plane, stride, row_samples, height, bits);
    else
        samples.codes = byte_codes(plane, stride, row_samples, height);
    return Done{};
}

}  // namespace

Result<HeifPicture> read_heif(const std::string& path, int page) {
    const auto bytes = read_input(path, "picture", largest_picture_file);
    if (!bytes) return bytes.error();
    const Context context(heif_context_alloc());
    heif_context_set_maximum_image_size_limit(context.get(), 65535);
    const auto read = heif_context_read_from_memory_without_copy(context.get(), bytes->data(), bytes->size(), nullptr);
    if (read.code != heif_error_Ok) return damaged_picture(path, read.message);
    const auto opened = open_page(context.get(), path, page);
    if (!opened) return opened.error();
    heif_image_handle* handle = opened->get();

    HeifPicture picture;
    PictureSamples& samples = picture.samples;
    samples.width = heif_image_handle_get_width(handle);
    samples.height = heif_image_handle_get_height(handle);
    samples.colors = 3;
    samples.channels = heif_image_handle_has_alpha_channel(handle) ? 4 : 3;
    samples.alpha = samples.channels == 4 ? 3 : -1;
    samples.is_multiplied = samples.alpha >= 0 && heif_image_handle_is_premultiplied_alpha(handle);
    const int bits = heif_image_handle_get_luma_bits_per_pixel(handle);
    if (bits < 8 || bits > 16) return damaged_picture(path, fmt::format("it says it has {} bits", bits));
    samples.last_code = (1 << bits) - 1;
    if (auto s = check_stated_size(path, samples.width, samples.height, samples.channels * (bits > 8 ? 2 : 1)); !s)
        return s.error();
    auto label = label_of(handle, path);
    if (!label) return label.error();
    samples.label = std::move(*label);
    say_other_channel(samples);
    picture.exif = exif_of(handle);
    if (auto s = read_codes(handle, path, bits, samples); !s) return s.error();
    return picture;
}

}  // namespace ols

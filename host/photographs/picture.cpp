// SPDX-License-Identifier: MIT
// One format a function, then linear light, then upright.
#include "photographs/picture.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "exceptions.hpp"
#include "image/exr.hpp"
#include "image/orientation.hpp"
#include "image/radiance.hpp"
#include "image/tone.hpp"

namespace ols {

namespace {

// The largest code of an array of codes; 1 of fractions and floats.
template <typename Code>
constexpr double last_of = std::is_same_v<Code, float> ? 1 : double(std::numeric_limits<Code>::max());

// Fractions of full scale of the colour channels, by a table of all codes where there is one; `to_light` maps a fraction.
template <typename ToLight>
Image colors_of(const PictureSamples& samples, double scale, const ToLight& to_light) {
    Image image(samples.width, samples.height, samples.colors);
    std::visit(
        [&]<typename Code>(const std::vector<Code>& codes) {
            std::vector<float> table;
            constexpr bool has_table = !std::is_same_v<Code, float>;
            if constexpr (has_table) {
                table.resize(size_t(last_of<Code>) + 1);
                // OpenImageIO stretches codes of fewer bits to 8 or 16: back to the code itself, which is exact.
                for (size_t i = 0; i < table.size(); ++i) {
                    const double code = std::round(double(i) / last_of<Code> * samples.last_code);
                    table[i] = to_light(float(code / samples.last_code * scale));
                }
            }
            const size_t pixels = size_t(samples.width) * samples.height;
            for (size_t p = 0; p < pixels; ++p)
                for (int c = 0; c < samples.colors; ++c) {
                    const Code code = codes[p * samples.channels + c];
                    if constexpr (has_table)
                        image.data[p * samples.colors + c] = table[code];
                    else
                        image.data[p * samples.colors + c] = to_light(float(double(code) * scale));
                }
        },
        samples.codes);
    return image;
}

std::optional<Image> alpha_of(const PictureSamples& samples) {
    if (samples.alpha < 0) return std::nullopt;
    Image alpha(samples.width, samples.height, 1);
    std::visit(
        [&]<typename Code>(const std::vector<Code>& codes) {
            for (size_t p = 0; p < alpha.data.size(); ++p)
                alpha.data[p] = float(codes[p * samples.channels + samples.alpha] / last_of<Code>);
        },
        samples.codes);
    return alpha;
}

double largest_code(const PictureSamples& samples) {
    return std::visit(
        [&]<typename Code>(const std::vector<Code>& codes) -> double {
            if constexpr (std::is_same_v<Code, float>) return 0;
            Code largest = 0;
            for (auto pixel = codes.begin(); pixel != codes.end(); pixel += samples.channels)
                for (int c = 0; c < samples.colors; ++c) largest = std::max(largest, pixel[c]);
            return std::round(double(largest) / last_of<Code> * samples.last_code);
        },
        samples.codes);
}

// From fractions to light, as the file's label says.
Status convert(const PictureSamples& samples, double scale, Picture& picture, const std::string& path) {
    ColorLabel label = samples.label;
    const bool says_transfer = !label.profile.empty() || label.gamma != 0 || !label.curves[0].empty() || label.is_srgb;
    if (!says_transfer && !label.primaries) {
        // Nothing, or a colour space by name alone.
        picture.was_unlabelled = samples.is_integer && label.name.empty();
        picture.is_rec709 = picture.was_unlabelled;
        if (!label.name.empty()) picture.said.push_back(label.name + " is not known: taken as sRGB, without a label");
        picture.light = samples.is_integer ? colors_of(samples, scale, srgb_decode)
                                           : colors_of(samples, scale, [](float v) { return v; });
        return Done{};
    }
    if (!says_transfer) {
        if (samples.is_integer)
            label.curves.fill(srgb_curve());
        else
            label.gamma = 1;
    }
    picture.is_rec709 = true;
    if (label.is_srgb) {
        picture.light = colors_of(samples, scale, srgb_decode);
        return Done{};
    }
    const auto conversion = ColorConversion::create(label, samples.colors);
    if (!conversion)
        return fail("'" + path + "' cannot be converted: " + conversion.error().message +
                    "; say how it is coded with --transfer, or save it as sRGB");
    if (conversion->is_srgb()) {
        picture.light = colors_of(samples, scale, srgb_decode);
        return Done{};
    }
    picture.light = colors_of(samples, scale, [](float v) { return v; });
    conversion->apply(picture.light.data);
    picture.said.push_back("converted from " + label.name + " to linear Rec. 709");
    return Done{};
}

Status to_light(const PictureSamples& samples, const PictureOptions& options, Picture& picture,
                const std::string& path) {
    const double last = samples.is_integer ? samples.last_code : 1;
    const double scale = options.full_scale > 0 ? last / options.full_scale : 1;
    if (options.transfer == Transfer::by_file) return convert(samples, scale, picture, path);
    const bool srgb = options.transfer == Transfer::srgb;
    picture.light =
        srgb ? colors_of(samples, scale, srgb_decode) : colors_of(samples, scale, [](float v) { return v; });
    const bool agrees = samples.label.name.empty() || (srgb && samples.label.is_srgb);
    picture.is_rec709 = srgb && agrees;
    if (!agrees) picture.said.push_back(samples.label.name + " is left out: --transfer says how it is coded");
    return Done{};
}

Result<Picture> read_coded(const std::string& path, PictureFormat format, const PictureOptions& options) {
    const auto samples = read_samples(path, format, options.page);
    if (!samples) return samples.error();
    Picture picture;
    picture.said = samples->said;
    if (auto s = to_light(*samples, options, picture, path); !s) return s.error();
    picture.cfa = samples->colors == 3 ? Cfa::rgb : Cfa::none;
    picture.alpha = alpha_of(*samples);
    picture.orientation = samples->orientation;
    picture.last_code = samples->last_code;
    picture.largest_code = largest_code(*samples);
    picture.exposure = samples->exposure;
    return picture;
}

Result<Picture> read_camera_raw(const std::string& path, const PictureOptions& options) {
    if (options.raw == RawUse::refuse)
        return fail(
            "'" + path +
            "' is a camera's raw file: say --raw mosaic (the sensor's samples) or --raw rgb (demosaiced, linear)");
    if (options.transfer == Transfer::srgb || options.full_scale > 0)
        return fail("'" + path +
                    "' is a camera's raw file, which is linear and knows its full scale: leave out --transfer and "
                    "--full-scale");
    auto raw = read_raw(path, options.raw);
    if (!raw) return raw.error();
    Picture picture;
    picture.cfa = options.raw == RawUse::mosaic ? raw->cfa : raw->light.channels == 3 ? Cfa::rgb : Cfa::none;
    picture.light = std::move(raw->light);
    picture.is_rec709 = raw->is_rec709;
    picture.orientation = raw->orientation;
    picture.said = std::move(raw->said);
    return picture;
}

// The alpha of an image of 4 channels, taken out of it.
std::optional<Image> take_alpha(Image& image) {
    if (image.channels != 4) return std::nullopt;
    Image rgb(image.width, image.height, 3), alpha(image.width, image.height, 1);
    for (size_t p = 0; p < alpha.data.size(); ++p) {
        std::copy_n(&image.data[p * 4], 3, &rgb.data[p * 3]);
        alpha.data[p] = image.data[p * 4 + 3];
    }
    image = std::move(rgb);
    return alpha;
}

// OpenEXR and Radiance.
Result<Picture> read_floats(const std::string& path, PictureFormat format, const PictureOptions& options) {
    const bool srgb = options.transfer == Transfer::srgb;
    if (srgb && format == PictureFormat::radiance)
        return fail("'" + path + "' is a Radiance picture, which is linear: leave out --transfer srgb");
    // Primaries are of light, which codes of sRGB's curve are not yet.
    auto read = format == PictureFormat::openexr ? read_exr_picture(path, {.convert = !srgb, .turn = false})
                                                 : read_radiance(path);
    if (!read) return read.error();
    Picture picture;
    picture.orientation = read->orientation;
    picture.said = std::move(read->said);
    picture.alpha = take_alpha(read->pixels);
    if (picture.alpha)
        picture.said.push_back("alpha is left out; the colours are multiplied by it as the file has them");
    picture.light = std::move(read->pixels);
    picture.cfa = picture.light.channels == 3 ? Cfa::rgb : Cfa::none;
    picture.is_rec709 = read->is_rec709 && !srgb;
    const float scale = options.full_scale > 0 ? float(1 / options.full_scale) : 1;
    if (srgb || scale != 1)
        for (float& v : picture.light.data) v = srgb ? srgb_decode(v * scale) : v * scale;
    return picture;
}

Result<Picture> read_any(const std::string& path, const PictureOptions& options) {
    const auto format = picture_format(path);
    if (!format) return format.error();
    if (options.page > 1 && *format != PictureFormat::tiff && *format != PictureFormat::heif)
        return fail(fmt::format("'{}' has one page: leave out --page {}", path, options.page));
    if (*format == PictureFormat::raw) return read_camera_raw(path, options);
    if (*format == PictureFormat::openexr || *format == PictureFormat::radiance)
        return read_floats(path, *format, options);
    return read_coded(path, *format, options);
}

void turn(Picture& picture) {
    if (is_mosaic(picture.cfa))
        picture.cfa = upright(picture.cfa, picture.orientation, picture.light.width, picture.light.height);
    picture.light = upright(std::move(picture.light), picture.orientation);
    if (picture.alpha) picture.alpha = upright(std::move(*picture.alpha), picture.orientation);
}

}  // namespace

Result<Picture> read_picture(const std::string& path, const PictureOptions& options) {
    return guarded("cannot read '" + path + "'", [&] {
        auto picture = read_any(path, options);
        if (picture.ok() && options.turn) turn(*picture);
        return picture;
    });
}

}  // namespace ols

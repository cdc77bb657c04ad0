// SPDX-License-Identifier: MIT
// OpenImageIO's ImageInput. What it passes over is looked after by file_damage.
#include "photographs/picture_samples.hpp"

#include <OpenImageIO/imageio.h>
#include <OpenImageIO/tiffutils.h>
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <type_traits>

#include "photographs/file_damage.hpp"
#include "photographs/heif.hpp"
#include "photographs/stated_size.hpp"
#include "photographs/webp_label.hpp"

namespace ols {

namespace {

using OIIO::ImageInput;
using OIIO::ImageSpec;
using OIIO::TypeDesc;

struct OpenPicture {
    std::unique_ptr<ImageInput> input;
    ImageSpec spec;
};

std::string one_line(std::string text) {
    std::ranges::replace(text, '\n', ' ');
    while (text.ends_with(' ')) text.pop_back();
    return text;
}

Error unreadable(const std::string& path, const std::string& why) {
    return fail("cannot read '" + path + "': it is damaged or of an unusual kind" +
                (why.empty() ? "" : " (" + one_line(why) + ")") + "; copy it again, or save it as PNG or TIFF");
}

Result<OpenPicture> open_picture(const std::string& path, PictureFormat format) {
    auto input = ImageInput::create(format_name(format));
    if (!input) return fail("this system's OpenImageIO does not read " + std::string(format_name(format)) + " files");
    input->threads(1);  // pictures are read side by side
    ImageSpec config, spec;
    config.attribute("oiio:UnassociatedAlpha", 1);  // colours are not multiplied by alpha
    if (!input->open(path, spec, config)) return unreadable(path, input->geterror());
    return OpenPicture{std::move(input), spec};
}

// By an input of its own: some of OpenImageIO's do not come back from a page that is not there.
int count_pages(const std::string& path, PictureFormat format) {
    if (format != PictureFormat::webp) return 1;
    const auto picture = open_picture(path, format);
    int pages = 1;
    while (picture.ok() && pages < 10000 && picture->input->seek_subimage(pages, 0)) ++pages;
    return pages;
}

// Moves to the page that is meant.
Status choose_page(OpenPicture& picture, const std::string& path, int pages, int page) {
    if (auto s = check_page(path, pages, page); !s) return s;
    if (page > 1 && !picture.input->seek_subimage(page - 1, 0)) return unreadable(path, picture.input->geterror());
    picture.spec = picture.input->spec();
    return Done{};
}

// What of the channels is colour, alpha, or neither.
Status sort_channels(const ImageSpec& spec, const std::string& path, PictureSamples& samples) {
    samples.channels = spec.nchannels;
    samples.alpha = spec.alpha_channel;
    samples.is_multiplied = samples.alpha >= 0 && spec.get_int_attribute("oiio:UnassociatedAlpha", 0) == 0;
    const std::string space = spec.get_string_attribute("tiff:ColorSpace");
    if (!space.empty() && space != "YCbCr" && space != "palette")
        return fail("'" + path + "' is in " + space + " colours, which are no light: save it as R G B");
    samples.colors = spec.nchannels <= 2 ? 1 : 3;
    const int others = spec.nchannels - samples.colors;
    if (spec.deep || spec.depth > 1 || spec.nchannels < 1 || others > 1 ||
        (others == 1 && samples.alpha >= 0 && samples.alpha != samples.colors))
        return fail(fmt::format("'{}' has {} channels: save it as grey or R G B", path, spec.nchannels));
    say_other_channel(samples);
    return Done{};
}

double attribute(const ImageSpec& spec, const char* name) {
    const double value = spec.get_float_attribute(name, 0);
    return std::isfinite(value) && value > 0 ? value : 0;
}

void take_label(const ImageSpec& spec, PictureSamples& samples) {
    if (!samples.label.name.empty()) return;  // by a reader of our own
    if (const auto* profile = spec.find_attribute("ICCProfile")) {
        const auto* bytes = static_cast<const uint8_t*>(profile->data());
        samples.label = {};
        samples.label.profile.assign(bytes, bytes + profile->datasize());
        const std::string name = spec.get_string_attribute("ICCProfile:profile_description");
        samples.label.name = name.empty() ? "its profile" : "its profile '" + one_line(name) + "'";
    } else if (spec.get_int_attribute("Exif:ColorSpace", 1) == 0xffff) {
        // DCF 2.0: R03 is Adobe RGB; without it nobody knows.
        samples.label.name = "its Exif colour space";
        if (spec.get_string_attribute("Exif:InteroperabilityIndex") == "R03") {
            samples.label.primaries = adobe_primaries;
            samples.label.gamma = 563.0 / 256;
        }
    }
}

void take_exposure(const ImageSpec& spec, PictureSamples& samples) {
    samples.exposure = {attribute(spec, "ExposureTime"), attribute(spec, "FNumber"),
                        attribute(spec, "Exif:PhotographicSensitivity")};
    if (samples.exposure.iso == 0) samples.exposure.iso = attribute(spec, "Exif:ISOSpeedRatings");
}

void take_metadata(const ImageSpec& spec, PictureSamples& samples) {
    take_exposure(spec, samples);
    take_label(spec, samples);
    const int x = spec.x - spec.full_x, y = spec.y - spec.full_y;
    if (x != 0 || y != 0) samples.said.push_back("its place on a page is left out");
    const double aspect = spec.get_float_attribute("PixelAspectRatio", 1);
    if (std::abs(aspect - 1) > 1e-3)
        samples.said.push_back(fmt::format("its pixels' aspect of {:g} is left out", aspect));
}

template <typename Code>
Status read_codes(ImageInput& input, const std::string& path, TypeDesc type, PictureSamples& samples) {
    std::vector<Code> codes(size_t(samples.width) * samples.height * samples.channels);
    const bool done = input.read_image(input.current_subimage(), 0, 0, samples.channels, type, codes.data());
    const std::string why = input.geterror();
    if (!done || !why.empty()) return unreadable(path, why);
    samples.codes = std::move(codes);
    return Done{};
}

Status read_any_codes(OpenPicture& picture, const std::string& path, PictureSamples& samples) {
    const auto type = picture.spec.format.basetype;
    samples.is_integer = type != TypeDesc::HALF && type != TypeDesc::FLOAT && type != TypeDesc::DOUBLE;
    if (samples.is_integer) {
        // A float in one of OpenImageIO's readers, an int in the others.
        const int stated = int(attribute(picture.spec, "oiio:BitsPerSample"));
        const int bits = stated > 0 ? stated : int(picture.spec.format.size() * 8);
        const bool has_sign = type == TypeDesc::INT8 || type == TypeDesc::INT16 || type == TypeDesc::INT32;
        samples.last_code = std::exp2(std::clamp(bits, 1, 32) - (has_sign ? 1 : 0)) - 1;
    }
    if (type == TypeDesc::UINT8) return read_codes<uint8_t>(*picture.input, path, TypeDesc::UINT8, samples);
    if (type == TypeDesc::UINT16) return read_codes<uint16_t>(*picture.input, path, TypeDesc::UINT16, samples);
    return read_codes<float>(*picture.input, path, TypeDesc::FLOAT, samples);
}

// Of 1 bit a pixel.
Status read_two_codes(const std::string& path, int page, PictureSamples& samples) {
    auto bits = read_bilevel(path, page);
    if (!bits) return bits.error();
    for (auto& bit : *bits) bit *= 255;
    samples.codes = std::move(*bits);
    samples.last_code = 1;
    return Done{};
}

// White is zero (TIFF 6.0 section 8): OpenImageIO turns all channels of up to 8 bits, of more bits none. Alpha has no white.
void invert(PictureSamples& samples, int first_channel, int end_channel) {
    std::visit(
        [&]<typename Code>(std::vector<Code>& codes) {
            constexpr Code last = std::is_integral_v<Code> ? std::numeric_limits<Code>::max() : Code(1);
            for (size_t i = 0; i < codes.size(); i += size_t(samples.channels))
                for (int c = first_channel; c < end_channel; ++c) codes[i + c] = Code(last - codes[i + c]);
        },
        samples.codes);
}

bool openimageio_inverts(const TiffPage& page) {
    return page.bits > 1 && page.bits <= 8;
}

Status check_photometric(const TiffPage& page, const std::string& path) {
    switch (page.photometric) {
        case 0:
        case 1:
        case 2:
        case photometric_palette:
        case 6: return Done{};  // white or black is zero, R G B, palette, Y'CbCr
        case 5: return fail("'" + path + "' is in CMYK, which is ink and no light: save it as R G B");
        case 4: return fail("'" + path + "' is a transparency mask of another picture: save it as grey");
        case photometric_cfa:
        case photometric_linear_raw:
            return fail("'" + path +
                        "' is a sensor's raw mosaic without what a DNG file has to say of it: convert it to DNG");
        default:
            return fail(fmt::format("'{}' is in colours of another kind (photometric {}): save it as R G B", path,
                                    page.photometric));
    }
}

// HEIC and AVIF. Turning them is the container's and done: their Exif says nothing of it (ISO/IEC 23008-12, A.2.2).
Result<PictureSamples> read_heif_file(const std::string& path, int page) {
    auto heif = read_heif(path, page);
    if (!heif) return heif.error();
    ImageSpec spec;
    if (!heif->exif.empty()) OIIO::decode_exif(OIIO::cspan<uint8_t>(heif->exif.data(), heif->exif.size()), spec);
    take_exposure(spec, heif->samples);
    return std::move(heif->samples);
}

Result<PictureSamples> read_checked(const std::string& path, PictureFormat format, int page) {
    if (format == PictureFormat::heif) return read_heif_file(path, page);
    PictureSamples samples;
    std::vector<TiffPage> tiff_pages;
    if (format == PictureFormat::jpeg)
        if (auto s = check_jpeg(path); !s) return s.error();
    if (format == PictureFormat::png) {
        auto label = read_png_label(path);
        if (!label) return label.error();
        samples.label = std::move(*label);
    }
    std::vector<uint8_t> exif;
    if (format == PictureFormat::webp) {
        auto webp = read_webp_label(path);
        if (!webp) return webp.error();
        samples.label = std::move(webp->label);
        exif = std::move(webp->exif);
    }
    if (format == PictureFormat::tiff) {
        auto pages = read_tiff_pages(path);
        if (!pages) return pages.error();
        tiff_pages = std::move(*pages);
    }
    auto picture = open_picture(path, format);
    if (!picture) return picture.error();
    const int pages = tiff_pages.empty() ? count_pages(path, format) : int(tiff_pages.size());
    if (auto s = choose_page(*picture, path, pages, page); !s) return s.error();
    ImageSpec& spec = picture->spec;
    if (!exif.empty()) OIIO::decode_exif(OIIO::cspan<uint8_t>(exif.data(), exif.size()), spec);
    if (auto s = check_stated_size(path, spec.width, spec.height, double(spec.pixel_bytes(true))); !s) return s.error();
    const size_t index = size_t(std::max(page, 1) - 1);
    if (index < tiff_pages.size()) {
        if (auto s = check_photometric(tiff_pages[index], path); !s) return s.error();
        if (auto s = check_tiff_page(path, int(index)); !s) return s.error();
        samples.label = tiff_pages[index].label;
        if (spec.find_attribute("ICCProfile")) samples.label = {};
    }
    samples.width = spec.width;
    samples.height = spec.height;
    if (auto s = sort_channels(spec, path, samples); !s) return s.error();
    take_metadata(spec, samples);
    samples.orientation = spec.get_int_attribute("Orientation", 1);
    if (samples.orientation < 1 || samples.orientation > 8)
        return fail(fmt::format("'{}' says its orientation is {}: the tag has 1 to 8; remove or correct it", path,
                                samples.orientation));
    const bool is_palette = index < tiff_pages.size() && tiff_pages[index].photometric == photometric_palette;
    const bool is_bilevel =
        index < tiff_pages.size() && tiff_pages[index].bits == 1 && tiff_pages[index].samples == 1 && !is_palette;
    if (auto s = is_bilevel ? read_two_codes(path, int(index), samples) : read_any_codes(*picture, path, samples); !s)
        return s.error();
    if (is_palette) samples.last_code = 255;  // its colours', not its indices'
    if (index < tiff_pages.size() && tiff_pages[index].photometric == 0) {
        if (openimageio_inverts(tiff_pages[index]))
            invert(samples, samples.colors, samples.channels);
        else
            invert(samples, 0, samples.colors);
    }
    return samples;
}

}  // namespace

void say_other_channel(PictureSamples& samples) {
    if (samples.channels == samples.colors) return;
    samples.said.push_back(samples.alpha < 0 ? "a channel beside the colours is left out"
                           : samples.is_multiplied
                               ? "alpha is left out; the colours are multiplied by it as the file has them"
                               : "alpha is left out");
}

Result<PictureSamples> read_samples(const std::string& path, PictureFormat format, int page) {
    try {
        return read_checked(path, format, page);
    } catch (const std::bad_alloc&) {
        return fail("'" + path + "' does not fit into memory");
    } catch (const std::exception& e) {
        return unreadable(path, e.what());
    }
}

}  // namespace ols

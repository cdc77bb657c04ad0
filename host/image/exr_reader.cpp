// SPDX-License-Identifier: MIT
// OpenEXR pictures: sizes checked, a layer chosen, decoded by the library, placed in the display window, made Rec. 709.
#include <ImfChannelList.h>
#include <ImfFrameBuffer.h>
#include <ImfHeader.h>
#include <ImfInputPart.h>
#include <ImfIntAttribute.h>
#include <ImfMultiPartInputFile.h>
#include <ImfStandardAttributes.h>
#include <ImfStdIO.h>
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <filesystem>

#include "image/exr.hpp"
#include "image/exr_choice.hpp"
#include "image/exr_chroma.hpp"
#include "image/exr_colour.hpp"
#include "image/exr_sizes.hpp"
#include "image/input_file.hpp"
#include "image/orientation.hpp"
#include "image/primaries.hpp"

namespace ols {

namespace {

using Window = Imath::Box2i;

int width_of(const Window& w) {
    return w.max.x - w.min.x + 1;
}

int height_of(const Window& w) {
    return w.max.y - w.min.y + 1;
}

// Where channel `c` of an image goes that holds every n-th pixel of a window. The base is the place of pixel (0, 0), which may lie
// outside: it is found as a number.
Imf::Slice float_slice(Image& image, int c, const Window& window, int n = 1) {
    const intptr_t x_stride = intptr_t(sizeof(float)) * image.channels, y_stride = x_stride * image.width;
    const intptr_t first = reinterpret_cast<intptr_t>(image.data.data() + c);
    const intptr_t base = first - window.min.x / n * x_stride - window.min.y / n * y_stride;
    return Imf::Slice(Imf::FLOAT, reinterpret_cast<char*>(base), size_t(x_stride), size_t(y_stride), n, n);
}

// The layer's channels over the data window; chroma as it is stored (RY, BY in the second and third channel).
Image read_layer(Imf::InputPart& part, const ExrLayer& layer) {
    const Window window = part.header().dataWindow();
    const auto& names = layer.channels;
    Image image(width_of(window), height_of(window), int(names.size()));
    Image chroma;
    Imf::FrameBuffer buffer;
    for (int c = 0; c < int(names.size()); ++c) {
        const bool halved = part.header().channels().findChannel(names[size_t(c)])->xSampling == 2;
        if (halved && chroma.data.empty()) chroma = Image(image.width / 2, image.height / 2, 2);
        buffer.insert(names[size_t(c)], halved ? float_slice(chroma, c - 1, window, 2) : float_slice(image, c, window));
    }
    part.setFrameBuffer(buffer);
    part.readPixels(window.min.y, window.max.y);
    if (chroma.data.empty()) return image;
    const Image full = full_chroma(chroma);
    for (int y = 0; y < image.height; ++y)
        for (int x = 0; x < image.width; ++x)
            for (int c = 0; c < 2; ++c) image.at(x, y, c + 1) = full.at(x, y, c);
    return image;
}

// The picture on its display window.
Image placed(Image image, const Window& data, const Window& display) {
    if (data == display) return image;
    Image canvas(width_of(display), height_of(display), image.channels);
    const int left = std::max(data.min.x, display.min.x), right = std::min(data.max.x, display.max.x);
    for (int y = std::max(data.min.y, display.min.y); left <= right && y <= std::min(data.max.y, display.max.y); ++y)
        std::copy_n(&image.at(left - data.min.x, y - data.min.y), size_t(right - left + 1) * size_t(image.channels),
                    &canvas.at(left - display.min.x, y - display.min.y));
    return canvas;
}

std::string window_words(const Window& w) {
    return fmt::format("{} x {} at ({}, {})", width_of(w), height_of(w), w.min.x, w.min.y);
}

void say_windows(const Window& data, const Window& display, std::vector<std::string>& said) {
    if (data == display) return;
    const std::string windows =
        fmt::format("the data window is {}, the display window {}: ", window_words(data), window_words(display));
    const bool beyond = data.min.x < display.min.x || data.min.y < display.min.y || data.max.x > display.max.x ||
                        data.max.y > display.max.y;
    const bool within = data.min.x > display.min.x || data.min.y > display.min.y || data.max.x < display.max.x ||
                        data.max.y < display.max.y;
    if (!data.intersects(display))
        said.push_back(windows + "they do not meet, so the picture is black");
    else if (beyond && within)
        said.push_back(windows + "what lies outside was cropped, the rest filled with black");
    else
        said.push_back(windows + (beyond ? "what lies outside was cropped" : "the rest was filled with black"));
}

Status make_rec709(FloatPicture& picture, const Imf::Header& header, ExrColour colour, bool convert) {
    const auto stated = stated_exr_colour(header);
    if (!stated) return stated.error();
    picture.is_rec709 = stated->known;
    if (!stated->said.empty()) picture.said.push_back(stated->said);
    if (colour == ExrColour::grey) return Done{};
    if (colour == ExrColour::luminance_chroma) {
        const auto weights = luminance_weights(stated->primaries);
        if (!weights) return weights.error();
        chroma_to_rgb(picture.pixels, *weights);
        picture.said.push_back("luminance and chroma (Y RY BY) were converted to R G B");
    }
    if (are_rec709(stated->primaries)) return Done{};
    if (!convert) {
        picture.is_rec709 = false;
        picture.said.push_back("its primaries are left out");
        return Done{};
    }
    const Primaries& p = stated->primaries;
    picture.said.push_back(fmt::format(
        "its primaries R ({:.4g}, {:.4g}), G ({:.4g}, {:.4g}), B ({:.4g}, {:.4g}), white ({:.4g}, {:.4g}) were "
        "converted to Rec. 709, white to white",
        p.red.x, p.red.y, p.green.x, p.green.y, p.blue.x, p.blue.y, p.white.x, p.white.y));
    return convert_to_rec709(picture.pixels, p);
}

// Y [A] to one channel, or with alpha to four.
Image with_usual_channels(Image image) {
    if (image.channels != 2) return image;
    Image rgba(image.width, image.height, 4);
    for (size_t i = 0; i < rgba.data.size() / 4; ++i) {
        std::fill_n(&rgba.data[4 * i], 3, image.data[2 * i]);
        rgba.data[4 * i + 3] = image.data[2 * i + 1];
    }
    return rgba;
}

void say_header(const Imf::Header& header, FloatPicture& picture) {
    if (Imf::hasEnvmap(header))
        picture.layout =
            Imf::envmap(header) == Imf::ENVMAP_CUBE ? StatedLayout::cube : StatedLayout::latitude_longitude;
    const float aspect = header.pixelAspectRatio();
    if (!(std::abs(aspect - 1) < 1e-3f))
        picture.said.push_back(fmt::format("its pixels are {:.4g} times as wide as high: taken as square", aspect));
}

// OpenEXR itself has no such attribute; OpenImageIO writes Exif's, and leaves the pixels as they lie.
Result<int> stated_orientation(const Imf::Header& header) {
    const auto* attribute = header.findTypedAttribute<Imf::IntAttribute>("Orientation");
    const int orientation = attribute ? attribute->value() : 1;
    if (orientation >= 1 && orientation <= 8) return orientation;
    return fail(
        fmt::format("it says its Orientation is {}: the attribute has 1 to 8; remove or correct it", orientation));
}

void turn(FloatPicture& picture) {
    if (picture.orientation == 1) return;
    picture.pixels = upright(std::move(picture.pixels), picture.orientation);
    picture.said.push_back(fmt::format("turned or mirrored as it says (Orientation {})", picture.orientation));
}

Result<FloatPicture> read_part(Imf::MultiPartInputFile& file, const ExrLayer& layer, bool convert) {
    const auto orientation = stated_orientation(file.header(layer.part));
    if (!orientation) return orientation.error();
    if (!file.partComplete(layer.part))
        return fail("it is incomplete (rows or tiles are missing): copy or save it again");
    Imf::InputPart part(file, layer.part);
    const Imf::Header& header = part.header();
    FloatPicture picture;
    picture.orientation = *orientation;
    if (!layer.left_out.empty()) picture.said.push_back("left out: " + layer.left_out);
    say_header(header, picture);
    say_windows(header.dataWindow(), header.displayWindow(), picture.said);
    picture.pixels = with_usual_channels(read_layer(part, layer));
    if (const Status done = make_rec709(picture, header, layer.colour, convert); !done) return done.error();
    picture.pixels = placed(std::move(picture.pixels), header.dataWindow(), header.displayWindow());
    return picture;
}

Result<FloatPicture> read_stream(std::ifstream& stream, const std::string& path, const ExrChoice& choice) {
    stream.clear();
    stream.seekg(0);
    Imf::StdIFStream exr_stream(stream, path.c_str());
    constexpr int no_threads = 0;
    constexpr bool repair = false;
    Imf::MultiPartInputFile file(exr_stream, no_threads, repair);
    std::vector<const Imf::Header*> headers;
    for (int i = 0; i < file.parts(); ++i) headers.push_back(&file.header(i));
    const auto layer = choose_exr_layer(headers, choice);
    if (!layer) return layer.error();
    auto picture = read_part(file, *layer, choice.convert);
    if (picture && !layer->name.empty() && !choice.layer)
        picture->said.insert(picture->said.begin(), "its layer '" + layer->name + "' was taken");
    if (picture && choice.turn) turn(*picture);
    return picture;
}

}  // namespace

bool begins_as_exr(std::string_view bytes) {
    return bytes.starts_with("\x76\x2f\x31\x01");
}

Result<FloatPicture> read_exr_picture(const std::string& path, const ExrChoice& choice) {
    auto stream = open_input(path);
    if (!stream) return stream.error();
    const auto cannot = [&](const std::string& why) { return fail("cannot read '" + path + "' as OpenEXR: " + why); };
    char start[16] = {};
    stream->read(start, sizeof start);
    const std::string_view bytes(start, size_t(stream->gcount()));
    if (!begins_as_exr(bytes)) return cannot("it is " + kind_of_bytes(bytes) + ": name an .exr file");
    stream->clear();
    stream->seekg(0);
    try {
        if (const Status fits = check_exr_sizes(*stream, std::filesystem::file_size(path)); !fits)
            return cannot(fits.error().message);
        auto picture = read_stream(*stream, path, choice);
        if (!picture) return cannot(picture.error().message);
        return picture;
    } catch (const std::bad_alloc&) {
        return cannot("there is not enough memory for its pixels: scale it down");
    } catch (const std::exception& e) {
        return cannot(fmt::format("it is damaged ({}): copy it again", e.what()));
    }
}

Result<Image> read_exr(const std::string& path) {
    auto picture = read_exr_picture(path);
    if (!picture) return picture.error();
    return std::move(picture->pixels);
}

}  // namespace ols

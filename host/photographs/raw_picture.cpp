// SPDX-License-Identifier: MIT
// LibRaw with everything that looks at a picture's content (automatic brightness, white balance and white level) switched off: the
// pictures of a set stay comparable.
#include "photographs/raw_picture.hpp"

#include <fmt/format.h>
#include <libraw/libraw.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <optional>

#include "photographs/file_damage.hpp"

namespace ols {

namespace {

constexpr double largest_pixels = 1 << 28;  // a quarter of a gigapixel: 4 GB while it is demosaiced

struct Crop {
    int x = 0, y = 0, width = 0, height = 0;
};

// LibRaw's flip (after dcraw) as an Exif orientation.
int orientation_of(int flip) {
    static constexpr int orientations[8] = {1, 2, 4, 3, 5, 8, 6, 7};
    return flip >= 0 && flip < 8 ? orientations[flip] : 1;
}

// Within the active area, as DNG's tags say; LibRaw 0.20 leaves them out.
Crop crop_of(const libraw_data_t& data, const std::string& path) {
    const Crop whole{0, 0, data.sizes.width, data.sizes.height};
    const auto crop = data.idata.dng_version == 0 ? std::nullopt : dng_default_crop(path);
    const bool fits = crop && crop->x >= 0 && crop->y >= 0 && crop->width >= 1 && crop->height >= 1 &&
                      crop->x + crop->width <= whole.width && crop->y + crop->height <= whole.height;
    return fits ? Crop{int(crop->x), int(crop->y), int(crop->width), int(crop->height)} : whole;
}

// The filter pattern from (x, y) on; none if it is not one of Bayer's four.
std::optional<Cfa> bayer_at(LibRaw& raw, int x0, int y0) {
    const auto color = [&](int x, int y) {
        const int index = raw.COLOR(y0 + y, x0 + x);
        const char name = index >= 0 && index < 4 ? raw.imgdata.idata.cdesc[index] : '?';
        return name == 'R' ? 0 : name == 'G' ? 1 : name == 'B' ? 2 : 3;
    };
    if (raw.imgdata.idata.filters <= 1000) return std::nullopt;  // LibRaw: 0 none, 1 Leaf's, 9 X-Trans
    for (const Cfa cfa : {Cfa::rggb, Cfa::bggr, Cfa::grbg, Cfa::gbrg}) {
        bool same = true;
        for (int y = 0; y < 8; ++y)
            for (int x = 0; x < 2; ++x) same &= color(x, y) == cfa_color(cfa, x, y);
        if (same) return cfa;
    }
    return std::nullopt;
}

// Black of a sample of the active area: LibRaw's three terms, of all, of the colour, of the place in a repeated block.
double black_at(LibRaw& raw, int x, int y) {
    const auto& color = raw.imgdata.color;
    double black = double(color.black) + color.cblack[raw.COLOR(y, x) & 3];
    const unsigned rows = color.cblack[4], columns = color.cblack[5];
    if (rows > 0 && columns > 0 && 6 + size_t(rows) * columns <= LIBRAW_CBLACK_SIZE)
        black += color.cblack[6 + (unsigned(y) % rows) * columns + unsigned(x) % columns];
    return black;
}

// The samples of a crop, row by row.
const uint16_t* raw_row(const libraw_data_t& data, const Crop& crop, int y) {
    const size_t pitch = data.sizes.raw_pitch / sizeof(uint16_t);
    return data.rawdata.raw_image + (size_t(data.sizes.top_margin) + crop.y + y) * pitch + data.sizes.left_margin +
           crop.x;
}

Result<RawPicture> read_mosaic(LibRaw& raw, const std::string& path) {
    const auto& data = raw.imgdata;
    const Crop crop = crop_of(data, path);
    const auto cfa = bayer_at(raw, crop.x, crop.y);
    if (!cfa || !data.rawdata.raw_image)
        return fail("'" + path + "' holds no Bayer mosaic of integers: ask for --raw rgb");
    RawPicture picture;
    picture.cfa = *cfa;
    picture.light = Image(crop.width, crop.height, 1);
    const double white = data.color.maximum;
    for (int y = 0; y < crop.height; ++y) {
        const uint16_t* row = raw_row(data, crop, y);
        for (int x = 0; x < crop.width; ++x) {
            const double black = black_at(raw, crop.x + x, crop.y + y);
            if (!(white > black))
                return fail(fmt::format("'{}' says that white ({:g}) is not above black ({:g}): it is damaged", path,
                                        white, black));
            picture.light.at(x, y) = float((row[x] - black) / (white - black));
        }
    }
    picture.said.push_back(fmt::format("raw: the sensor's mosaic, black {:g} and white {:g} of its counts",
                                       black_at(raw, crop.x, crop.y), white));
    return picture;
}

using Processed = std::unique_ptr<libraw_processed_image_t, decltype(&LibRaw::dcraw_clear_mem)>;

// LibRaw's matrix from the camera's colours to sRGB's primaries is diagonal as long as it knows nothing.
bool has_camera_matrix(const libraw_data_t& data) {
    return data.color.rgb_cam[0][1] != 0 || data.color.rgb_cam[1][0] != 0;
}

Result<RawPicture> read_rgb(LibRaw& raw, const std::string& path) {
    auto& params = raw.imgdata.params;
    params.output_bps = 16;
    params.gamm[0] = params.gamm[1] = 1;
    params.no_auto_bright = 1;
    params.adjust_maximum_thr = 0;
    params.use_camera_wb = params.use_auto_wb = 0;
    params.output_color = 1;  // sRGB's primaries
    params.user_flip = 0;
    params.user_qual = 3;  // adaptive homogeneity-directed
    if (const int error = raw.dcraw_process(); error != LIBRAW_SUCCESS)
        return fail("cannot read '" + path + "' as raw: " + libraw_strerror(error));
    int error = 0;
    const Processed image(raw.dcraw_make_mem_image(&error), LibRaw::dcraw_clear_mem);
    if (!image || image->type != LIBRAW_IMAGE_BITMAP || image->bits != 16 || (image->colors != 3 && image->colors != 1))
        return fail("cannot read '" + path + "' as raw: LibRaw makes no picture of it");
    Crop crop = crop_of(raw.imgdata, path);
    if (crop.x + crop.width > image->width || crop.y + crop.height > image->height)
        crop = {0, 0, image->width, image->height};
    RawPicture picture;
    picture.light = Image(crop.width, crop.height, image->colors);
    const auto* samples = reinterpret_cast<const uint16_t*>(image->data);
    for (int y = 0; y < crop.height; ++y)
        for (int i = 0; i < crop.width * image->colors; ++i)
            picture.light.data[size_t(y) * crop.width * image->colors + i] =
                samples[(size_t(crop.y + y) * image->width + crop.x) * image->colors + i] / 65535.0f;
    picture.is_rec709 = image->colors == 3 && has_camera_matrix(raw.imgdata);
    picture.said.push_back(picture.is_rec709
                               ? "raw: demosaiced to linear R G B by the camera's own matrix, white balance of daylight"
                               : "raw: demosaiced to linear R G B of the camera, whose matrix is not known");
    return picture;
}

}  // namespace

bool is_camera_raw(const std::string& path) {
    LibRaw raw;
    return raw.open_file(path.c_str()) == LIBRAW_SUCCESS;
}

namespace {

Result<std::unique_ptr<LibRaw>> unpack_raw(const std::string& path) {
    auto raw = std::make_unique<LibRaw>();  // some hundred kilobytes
    const auto failed = [&](int error) { return fail("cannot read '" + path + "' as raw: " + libraw_strerror(error)); };
    if (const int error = raw->open_file(path.c_str()); error != LIBRAW_SUCCESS) return failed(error);
    const auto& sizes = raw->imgdata.sizes;
    if (double(sizes.raw_width) * sizes.raw_height > largest_pixels)
        return fail(fmt::format("'{}' says it is {} x {}: no camera's raw", path, sizes.raw_width, sizes.raw_height));
    int damage = 0;
    raw->set_dataerror_handler([](void* count, const char*, int) { ++*static_cast<int*>(count); }, &damage);
    if (const int error = raw->unpack(); error != LIBRAW_SUCCESS) return failed(error);
    if (damage > 0) return fail("'" + path + "' is damaged: copy it again");
    return raw;
}

}  // namespace

Result<RawPicture> read_raw(const std::string& path, RawUse use) {
    const auto raw = unpack_raw(path);
    if (!raw.ok()) return raw.error();
    const int orientation = orientation_of((*raw)->imgdata.sizes.flip);
    auto picture = use == RawUse::mosaic ? read_mosaic(**raw, path) : read_rgb(**raw, path);
    if (picture.ok()) picture->orientation = orientation;
    return picture;
}

Result<RawCounts> read_raw_counts(const std::string& path) {
    const auto unpacked = unpack_raw(path);
    if (!unpacked.ok()) return unpacked.error();
    LibRaw& raw = **unpacked;
    const auto& data = raw.imgdata;
    const Crop crop = crop_of(data, path);
    const bool is_grey = data.idata.filters == 0 && data.idata.colors == 1;
    const auto cfa = is_grey ? Cfa::none : bayer_at(raw, crop.x, crop.y);
    if (!cfa || !data.rawdata.raw_image)
        return fail("'" + path + "' holds no Bayer mosaic and no grey samples of integers: a recording is of these");
    RawCounts counts{crop.width, crop.height, {}, *cfa, 0, double(data.color.maximum)};
    for (int place = 0; place < 4; ++place) {
        const double black = black_at(raw, crop.x + place % 2, crop.y + place / 2);
        counts.has_one_black &= place == 0 || black == counts.black / place;
        counts.black += black;
    }
    counts.black /= 4;
    if (!(counts.white > counts.black))
        return fail(fmt::format("'{}' says that white ({:g}) is not above black ({:g}): it is damaged", path,
                                counts.white, counts.black));
    for (int y = 0; y < crop.height; ++y) {
        const uint16_t* row = raw_row(data, crop, y);
        counts.counts.insert(counts.counts.end(), row, row + crop.width);
    }
    return counts;
}

}  // namespace ols

// SPDX-License-Identifier: MIT
// libtiff with its errors and warnings caught by file. OpenImageIO decodes deflated strips by itself and does not notice when their
// checksum is wrong.
#include <fmt/format.h>
#include <tiffio.h>
#include <zlib.h>

#include <algorithm>
#include <array>
#include <cstdarg>
#include <cstdio>
#include <memory>

#include "photographs/file_damage.hpp"
#include "photographs/stated_size.hpp"

namespace ols {

namespace {

struct Complaints {
    std::string first;
    int count = 0;
};

int note(TIFF*, void* complaints, const char*, const char* format, va_list arguments) {
    auto& all = *static_cast<Complaints*>(complaints);
    char text[256];
    std::vsnprintf(text, sizeof text, format, arguments);
    if (all.count++ == 0) all.first = text;
    return 1;
}

using File = std::unique_ptr<TIFF, void (*)(TIFF*)>;

File open_tiff(const std::string& path, Complaints& complaints) {
    TIFFOpenOptions* options = TIFFOpenOptionsAlloc();
    TIFFOpenOptionsSetErrorHandlerExtR(options, note, &complaints);
    TIFFOpenOptionsSetWarningHandlerExtR(options, note, &complaints);
    File file(TIFFOpenExt(path.c_str(), "r", options), TIFFClose);
    TIFFOpenOptionsFree(options);
    return file;
}

Error damaged(const std::string& path, const Complaints& complaints) {
    return fail("'" + path + "' is damaged (" + (complaints.first.empty() ? "libtiff says no more" : complaints.first) +
                "): copy it again");
}

ColorLabel label_of(TIFF* file) {
    ColorLabel label;
    uint16_t bits = 1, *curves[3] = {};
    TIFFGetFieldDefaulted(file, TIFFTAG_BITSPERSAMPLE, &bits);
    if (bits <= 16 && TIFFGetField(file, TIFFTAG_TRANSFERFUNCTION, &curves[0], &curves[1], &curves[2])) {
        for (int c = 0; c < 3; ++c) {
            const uint16_t* curve = curves[c] ? curves[c] : curves[0];
            label.curves[c].assign(curve, curve + (size_t(1) << bits));
        }
        label.name = "its TransferFunction";
    }
    float *primaries = nullptr, *white = nullptr;
    if (TIFFGetField(file, TIFFTAG_PRIMARYCHROMATICITIES, &primaries)) {
        const auto xy = [](const float* v) { return Chromaticity{double(v[0]), double(v[1])}; };
        const bool has_white = TIFFGetField(file, TIFFTAG_WHITEPOINT, &white);
        label.primaries = Primaries{xy(primaries), xy(primaries + 2), xy(primaries + 4),
                                    has_white ? xy(white) : rec709_primaries.white};
        if (label.name.empty()) label.name = "its primaries";
    }
    return label;
}

TiffPage page_of(TIFF* file) {
    TiffPage page;
    uint16_t photometric = 1;
    uint32_t width = 0, height = 0;
    TIFFGetField(file, TIFFTAG_PHOTOMETRIC, &photometric);
    TIFFGetField(file, TIFFTAG_IMAGEWIDTH, &width);
    TIFFGetField(file, TIFFTAG_IMAGELENGTH, &height);
    page.photometric = photometric;
    uint16_t bits = 1, samples = 1;
    TIFFGetFieldDefaulted(file, TIFFTAG_BITSPERSAMPLE, &bits);
    TIFFGetFieldDefaulted(file, TIFFTAG_SAMPLESPERPIXEL, &samples);
    page.bits = bits;
    page.samples = samples;
    page.width = int(width);
    page.height = int(height);
    page.label = label_of(file);
    return page;
}

// Where a page's sub-directories lie (TIFF Technical Note 1). Cameras put the raw there, behind a preview.
std::vector<uint64_t> sub_directories(TIFF* file) {
    uint16_t count = 0;
    uint64_t* offsets = nullptr;
    if (!TIFFGetField(file, TIFFTAG_SUBIFD, &count, &offsets)) return {};
    return {offsets, offsets + count};
}

// A page whose sub-directory holds more pixels than it, or a sensor's mosaic, is only its preview.
Status check_sub_directories(TIFF* file, const std::vector<TiffPage>& pages,
                             const std::vector<std::vector<uint64_t>>& subs, const std::string& path) {
    for (size_t i = 0; i < pages.size(); ++i)
        for (const uint64_t offset : subs[i]) {
            if (!TIFFSetSubDirectory(file, offset))
                return fail("'" + path + "' is damaged (a sub-directory is not there): copy it again");
            const TiffPage sub = page_of(file);
            const bool is_larger = double(sub.width) * sub.height > double(pages[i].width) * pages[i].height;
            if (is_larger || sub.photometric == photometric_cfa || sub.photometric == photometric_linear_raw)
                return fail(
                    fmt::format("'{}' is the preview ({} x {}) of a picture in a sub-directory ({} x {}), which is no "
                                "raw that LibRaw "
                                "knows: convert it to DNG or plain TIFF",
                                path, pages[i].width, pages[i].height, sub.width, sub.height));
        }
    return Done{};
}

// Whether a deflated block has its end and its checksum (RFC 1950). libtiff stops when it has the samples, before either.
bool is_whole_deflate(const std::vector<uint8_t>& block) {
    z_stream stream{};
    if (inflateInit(&stream) != Z_OK) return false;
    std::array<Bytef, 1 << 16> sink;
    stream.next_in = const_cast<Bytef*>(block.data());
    stream.avail_in = uInt(block.size());
    int state = Z_OK;
    while (state == Z_OK) {
        stream.next_out = sink.data();
        stream.avail_out = uInt(sink.size());
        state = inflate(&stream, Z_NO_FLUSH);
    }
    inflateEnd(&stream);
    return state == Z_STREAM_END;
}

Status check_deflate(TIFF* file, uint32_t blocks, const std::string& path) {
    for (uint32_t i = 0; i < blocks; ++i) {
        const bool tiled = TIFFIsTiled(file);
        std::vector<uint8_t> block(TIFFGetStrileByteCount(file, i));
        const auto size = tmsize_t(block.size());
        const auto read =
            tiled ? TIFFReadRawTile(file, i, block.data(), size) : TIFFReadRawStrip(file, i, block.data(), size);
        if (read != size || !is_whole_deflate(block))
            return fail("'" + path + "' is damaged (a checksum is wrong): copy it again");
    }
    return Done{};
}

}  // namespace

Result<std::vector<TiffPage>> read_tiff_pages(const std::string& path) {
    constexpr size_t most_pages = 10000;
    Complaints complaints;
    const File file = open_tiff(path, complaints);
    if (!file) return damaged(path, complaints);
    std::vector<TiffPage> pages;
    std::vector<std::vector<uint64_t>> subs;
    do {
        pages.push_back(page_of(file.get()));
        subs.push_back(sub_directories(file.get()));
    } while (pages.size() < most_pages && TIFFReadDirectory(file.get()));
    if (auto s = check_sub_directories(file.get(), pages, subs, path); !s) return s.error();
    return pages;
}

Status check_tiff_page(const std::string& path, int page) {
    Complaints complaints;
    const File file = open_tiff(path, complaints);
    if (!file || !TIFFSetDirectory(file.get(), uint16_t(page))) return damaged(path, complaints);
    complaints = {};  // of unknown tags: those do no harm
    uint16_t compression = COMPRESSION_NONE;
    TIFFGetFieldDefaulted(file.get(), TIFFTAG_COMPRESSION, &compression);
    if (!TIFFIsCODECConfigured(compression))
        return fail(fmt::format("'{}' has a compression that libtiff does not read here ({}): save it with another",
                                path, compression));
    const bool tiled = TIFFIsTiled(file.get());
    const tmsize_t size = tiled ? TIFFTileSize(file.get()) : TIFFStripSize(file.get());
    const uint32_t blocks = tiled ? TIFFNumberOfTiles(file.get()) : TIFFNumberOfStrips(file.get());
    if (size <= 0) return damaged(path, complaints);
    if (!can_hold(path, double(size)))  // a tile may be larger than its picture
        return fail(
            fmt::format("'{}' says that a tile takes {} bytes, which it cannot hold; it is damaged", path, size));
    std::vector<uint8_t> block(static_cast<size_t>(size));
    for (uint32_t i = 0; i < blocks; ++i) {
        const auto read = tiled ? TIFFReadEncodedTile(file.get(), i, block.data(), size)
                                : TIFFReadEncodedStrip(file.get(), i, block.data(), size);
        if (read < 0 || complaints.count > 0) return damaged(path, complaints);
    }
    const bool is_deflated = compression == COMPRESSION_ADOBE_DEFLATE || compression == COMPRESSION_DEFLATE;
    return is_deflated ? check_deflate(file.get(), blocks, path) : Done{};
}

Result<std::vector<uint8_t>> read_bilevel(const std::string& path, int page) {
    Complaints complaints;
    const File file = open_tiff(path, complaints);
    if (!file || !TIFFSetDirectory(file.get(), uint16_t(page))) return damaged(path, complaints);
    const TiffPage facts = page_of(file.get());
    if (TIFFIsTiled(file.get())) return fail("'" + path + "' has 1 bit a pixel in tiles: save it with 8 bits");
    std::vector<uint8_t> row(size_t(TIFFScanlineSize(file.get()))), samples;
    for (int y = 0; y < facts.height; ++y) {
        if (TIFFReadScanline(file.get(), row.data(), uint32_t(y)) < 0) return damaged(path, complaints);
        for (int x = 0; x < facts.width; ++x) samples.push_back(row[size_t(x) / 8] >> (7 - x % 8) & 1);
    }
    return samples;
}

std::optional<DngCrop> dng_default_crop(const std::string& path) {
    Complaints complaints;
    const File file = open_tiff(path, complaints);
    if (!file) return std::nullopt;
    std::vector<uint64_t> directories = {TIFFCurrentDirOffset(file.get())};
    const auto subs = sub_directories(file.get());
    directories.insert(directories.end(), subs.begin(), subs.end());
    for (const uint64_t offset : directories) {
        float *origin = nullptr, *size = nullptr;
        if (!TIFFSetSubDirectory(file.get(), offset)) continue;
        if (TIFFGetField(file.get(), TIFFTAG_DEFAULTCROPORIGIN, &origin) &&
            TIFFGetField(file.get(), TIFFTAG_DEFAULTCROPSIZE, &size))
            return DngCrop{origin[0], origin[1], size[0], size[1]};
    }
    return std::nullopt;
}

}  // namespace ols

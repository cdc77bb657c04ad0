// SPDX-License-Identifier: MIT
// libtiff with its errors and warnings caught by file. OpenImageIO decodes deflated strips by itself and does not notice when their
// checksum is wrong.
#include <fmt/format.h>
#include <tiffio.h>

#include <algorithm>
#include <cstdarg>
#include <cstdio>
#include <memory>

#include "photographs/file_damage.hpp"

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
        const auto xy = [](const float* v) { return std::array{double(v[0]), double(v[1])}; };
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
    const bool tiled = TIFFIsTiled(file.get());
    const tmsize_t size = tiled ? TIFFTileSize(file.get()) : TIFFStripSize(file.get());
    const uint32_t blocks = tiled ? TIFFNumberOfTiles(file.get()) : TIFFNumberOfStrips(file.get());
    if (size <= 0) return damaged(path, complaints);
    std::vector<uint8_t> block(static_cast<size_t>(size));
    for (uint32_t i = 0; i < blocks; ++i) {
        const auto read = tiled ? TIFFReadEncodedTile(file.get(), i, block.data(), size)
                                : TIFFReadEncodedStrip(file.get(), i, block.data(), size);
        if (read < 0 || complaints.count > 0) return damaged(path, complaints);
    }
    return Done{};
}

}  // namespace ols

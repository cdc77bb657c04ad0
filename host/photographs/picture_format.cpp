// SPDX-License-Identifier: MIT
// Signatures: PNG (W3C, 5.2), JPEG (T.81, B.1.1.3), TIFF 6.0 (section 2) and BigTIFF, BMP, WebP (container specification), HEIF
// (ISO/IEC 14496-12, brands of 23008-12 and AV1-AVIF), Netpbm, OpenEXR, Radiance.
#include "photographs/picture_format.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <filesystem>
#include <set>
#include <string_view>

#include "image/input_file.hpp"
#include "photographs/raw_picture.hpp"

namespace ols {

namespace {

using namespace std::string_view_literals;

struct Signature {
    std::string_view bytes;
    PictureFormat format;
};

constexpr std::array signatures = {
    Signature{"\x89PNG\r\n\x1a\n"sv, PictureFormat::png},
    Signature{"\xff\xd8\xff"sv, PictureFormat::jpeg},
    Signature{"II\x2a\x00"sv, PictureFormat::tiff},
    Signature{"MM\x00\x2a"sv, PictureFormat::tiff},
    Signature{"II\x2b\x00"sv, PictureFormat::tiff},
    Signature{"MM\x00\x2b"sv, PictureFormat::tiff},
    Signature{"BM"sv, PictureFormat::bmp},
    Signature{"\x76\x2f\x31\x01"sv, PictureFormat::openexr},
    Signature{"#?"sv, PictureFormat::radiance},
};

// What else people have pictures in, so that the answer can say so.
struct Unread {
    std::string_view bytes;
    const char* name;
};

constexpr std::array unread = {
    Unread{"GIF8"sv, "GIF"},
    Unread{"8BPS"sv, "Photoshop"},
    Unread{"SDPX"sv, "DPX"},
    Unread{"XPDS"sv, "DPX"},
    Unread{"\x00\x00\x00\x0cjP  "sv, "JPEG 2000"},
    Unread{"\x00\x00\x00\x0cJXL "sv, "JPEG XL"},
    Unread{"\xff\x0a"sv, "JPEG XL"},
    Unread{"%PDF"sv, "PDF"},
    Unread{"SIMPLE  ="sv, "FITS"},
    Unread{"PF\n"sv, "PFM"},
    Unread{"Pf\n"sv, "PFM"},
    Unread{"\x93NUMPY"sv, "numpy"},
};

bool is_webp(std::string_view head) {
    return head.starts_with("RIFF") && head.substr(std::min<size_t>(8, head.size())).starts_with("WEBP");
}

bool is_heif(std::string_view head) {
    static constexpr std::array brands = {"heic"sv, "heix"sv, "heim"sv, "heis"sv, "hevc"sv,
                                          "mif1"sv, "msf1"sv, "avif"sv, "avis"sv};
    if (head.size() < 12 || head.substr(4, 4) != "ftyp") return false;
    return std::find(brands.begin(), brands.end(), head.substr(8, 4)) != brands.end();
}

bool is_pnm(std::string_view head) {
    return head.size() > 2 && head[0] == 'P' && head[1] >= '1' && head[1] <= '6' && isspace((unsigned char)head[2]);
}

std::string lower_extension(const std::string& path) {
    std::string extension = std::filesystem::path(path).extension().string();
    std::ranges::transform(extension, extension.begin(), [](unsigned char c) { return tolower(c); });
    return extension;
}

Result<std::string> first_bytes(const std::string& path) {
    auto stream = open_input(path);
    if (!stream) return stream.error();
    std::string head(32, '\0');
    stream->read(head.data(), std::streamsize(head.size()));
    head.resize(size_t(stream->gcount()));
    if (head.empty()) return fail("'" + path + "' is empty: copy it again");
    return head;
}

}  // namespace

const char* format_name(PictureFormat format) {
    switch (format) {
        case PictureFormat::png: return "png";
        case PictureFormat::jpeg: return "jpeg";
        case PictureFormat::tiff: return "tiff";
        case PictureFormat::bmp: return "bmp";
        case PictureFormat::targa: return "targa";
        case PictureFormat::webp: return "webp";
        case PictureFormat::heif: return "heif";
        case PictureFormat::pnm: return "pnm";
        case PictureFormat::openexr: return "openexr";
        case PictureFormat::radiance: return "hdr";
        case PictureFormat::raw: return "raw";
    }
    return "";
}

Result<PictureFormat> picture_format(const std::string& path) {
    const auto head = first_bytes(path);
    if (!head) return head.error();
    for (const auto& signature : signatures) {
        if (!head->starts_with(signature.bytes)) continue;
        return signature.format == PictureFormat::tiff && is_camera_raw(path) ? PictureFormat::raw : signature.format;
    }
    if (is_webp(*head)) return PictureFormat::webp;
    if (is_heif(*head)) return PictureFormat::heif;
    if (is_pnm(*head)) return PictureFormat::pnm;
    for (const auto& kind : unread)
        if (head->starts_with(kind.bytes))
            return fail(
                fmt::format("'{}' is a {} file, which is not read: save it as PNG, TIFF or OpenEXR", path, kind.name));
    if (lower_extension(path) == ".tga") return PictureFormat::targa;
    if (is_camera_raw(path)) return PictureFormat::raw;
    return fail("cannot read '" + path +
                "': it is damaged or no picture of a known format (PNG, JPEG, TIFF, BMP, TGA, WebP, HEIC, AVIF, PNM, "
                "OpenEXR, Radiance, camera RAW)");
}

bool looks_like_a_picture(const std::string& name) {
    static const std::set<std::string> extensions = {".png", ".jpg", ".jpeg", ".tif",  ".tiff", ".tga",  ".exr",
                                                     ".hdr", ".bmp", ".webp", ".heic", ".heif", ".avif", ".pgm",
                                                     ".ppm", ".pnm", ".dng",  ".nef",  ".cr2",  ".cr3",  ".arw",
                                                     ".raf", ".orf", ".rw2",  ".pef",  ".gif",  ".psd",  ".jp2"};
    return extensions.contains(lower_extension(name));
}

}  // namespace ols

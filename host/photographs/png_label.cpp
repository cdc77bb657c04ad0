// SPDX-License-Identifier: MIT
// The chunks of a PNG file. libpng drops damaged ancillary ones, which say what the colours are, with a warning.
#include <fmt/format.h>
#include <zlib.h>

#include <fstream>
#include <iterator>
#include <string_view>

#include "photographs/file_damage.hpp"

namespace ols {

namespace {

uint32_t word(std::string_view bytes, size_t at) {
    uint32_t value = 0;
    for (size_t i = 0; i < 4; ++i) value = value << 8 | (unsigned char)bytes[at + i];
    return value;
}

Status take_cicp(std::string_view data, ColorLabel& label) {
    // ITU-T H.273: primaries 1 are Rec. 709's; transfer 8 is linear, 13 sRGB's, 16 and 18 are PQ and HLG.
    const int primaries = (unsigned char)data[0], transfer = (unsigned char)data[1], matrix = (unsigned char)data[2];
    if (matrix != 0 || (transfer != 8 && transfer != 13) || data[3] != 1)
        return fail(fmt::format("is coded for a display or as video (cICP {} {} {} {})", primaries, transfer, matrix,
                                int(data[3])));
    label = {};
    label.name = "its cICP chunk";
    label.is_srgb = transfer == 13 && primaries == 1;
    if (label.is_srgb) return Done{};
    static const Primaries bt2020 = {{0.708, 0.292}, {0.170, 0.797}, {0.131, 0.046}, {0.3127, 0.3290}};
    static const Primaries p3 = {{0.680, 0.320}, {0.265, 0.690}, {0.150, 0.060}, {0.3127, 0.3290}};
    if (primaries != 1 && primaries != 9 && primaries != 12)
        return fail(fmt::format("has primaries of an unusual kind (cICP {})", primaries));
    label.primaries = primaries == 9 ? bt2020 : primaries == 12 ? p3 : rec709_primaries;
    if (transfer == 8) {
        label.gamma = 1;
    } else {
        label.curves = {};
        for (auto& curve : label.curves) curve = srgb_curve();
    }
    return Done{};
}

// Whose word counts: cICP, iCCP (not here), sRGB, then gAMA and cHRM (table of 4.3).
Status take_chunk(std::string_view type, std::string_view data, ColorLabel& label, bool& has_cicp) {
    if (type == "cICP" && data.size() == 4) {
        has_cicp = true;
        return take_cicp(data, label);
    }
    if (has_cicp) return Done{};
    if (type == "sRGB" && data.size() == 1) {
        label = {};
        label.name = "its sRGB chunk";
        label.is_srgb = true;
    }
    if (label.is_srgb) return Done{};
    if (type == "gAMA" && data.size() == 4) {
        const uint32_t gamma = word(data, 0);
        if (gamma == 0) return fail("says that its gamma is 0");
        label.gamma = 100000.0 / gamma;
        label.name = fmt::format("its gamma of 1/{:.4g}", label.gamma);
    }
    if (type == "cHRM" && data.size() == 32) {
        const auto xy = [&](size_t i) { return std::array{word(data, 8 * i) / 1e5, word(data, 8 * i + 4) / 1e5}; };
        label.primaries = Primaries{xy(1), xy(2), xy(3), xy(0)};
    }
    return Done{};
}

}  // namespace

Result<ColorLabel> read_png_label(const std::string& path) {
    std::ifstream stream(path, std::ios::binary);
    const std::string bytes{std::istreambuf_iterator<char>(stream), {}};
    const std::string_view file = bytes;
    const auto damaged = [&](const std::string& why) {
        return fail("'" + path + "' is damaged (" + why + "): copy it again");
    };
    ColorLabel label;
    bool has_cicp = false;
    for (size_t at = 8;;) {
        if (file.size() < at + 12) return damaged("it is cut short");
        const size_t length = word(file, at);
        if (length > file.size() - at - 12) return damaged("it is cut short");
        const std::string_view type = file.substr(at + 4, 4), data = file.substr(at + 8, length);
        const auto crc = crc32(0, reinterpret_cast<const Bytef*>(type.data()), uInt(length + 4));
        if (crc != word(file, at + 8 + length))
            return damaged(fmt::format("the checksum of a chunk at byte {} is wrong", at));
        if (type == "IEND") break;
        if (auto s = take_chunk(type, data, label, has_cicp); !s)
            return fail("'" + path + "' " + s.error().message + ": save it as sRGB or linear");
        at += 12 + length;
    }
    // cHRM alone leaves the transfer open; primaries that differ are worth nothing without it.
    if (label.name.empty() && label.primaries) label.name = "its primaries";
    return label;
}

}  // namespace ols

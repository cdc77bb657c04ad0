// SPDX-License-Identifier: MIT
// The chunks of a PNG file. libpng drops damaged ancillary ones, which say what the colours are, with a warning.
#include <fmt/format.h>
#include <zlib.h>

#include <string_view>

#include "image/input_file.hpp"
#include "photographs/file_damage.hpp"

namespace ols {

namespace {

uint32_t word(std::string_view bytes, size_t at) {
    uint32_t value = 0;
    for (size_t i = 0; i < 4; ++i) value = value << 8 | (unsigned char)bytes[at + i];
    return value;
}

Status take_cicp(std::string_view data, ColorLabel& label) {
    const int primaries = (unsigned char)data[0], transfer = (unsigned char)data[1];
    if (data[2] != 0 || data[3] != 1) return fail("is coded as video (cICP)");
    auto codes = label_of_codes(primaries, transfer, "its cICP chunk");
    if (!codes) return codes.error();
    label = std::move(*codes);
    return Done{};
}

// A name, a zero, a zero for deflate, a deflated ICC profile. libpng drops one that it does not like.
Status take_iccp(std::string_view data, ColorLabel& label) {
    constexpr size_t largest = 16 << 20;
    const size_t name = data.find('\0');
    if (name == std::string_view::npos || data.size() < name + 3 || data[name + 1] != 0)
        return fail("has a damaged profile (iCCP)");
    const std::string_view deflated = data.substr(name + 2);
    label = {};
    label.profile.resize(std::min(largest, deflated.size() * 1100 + 128));
    uLongf size = label.profile.size();
    if (uncompress(label.profile.data(), &size, reinterpret_cast<const Bytef*>(deflated.data()), deflated.size()) !=
        Z_OK)
        return fail("has a damaged profile (iCCP)");
    label.profile.resize(size);
    label.name = fmt::format("its profile '{}'", data.substr(0, name));
    return Done{};
}

// Whose word counts: cICP, iCCP, sRGB, then gAMA and cHRM (table of 4.3).
Status take_chunk(std::string_view type, std::string_view data, ColorLabel& label, bool& has_cicp) {
    if (type == "cICP" && data.size() == 4) {
        has_cicp = true;
        return take_cicp(data, label);
    }
    if (has_cicp) return Done{};
    if (type == "iCCP") return take_iccp(data, label);
    if (!label.profile.empty()) return Done{};
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
        const auto xy = [&](size_t i) { return Chromaticity{word(data, 8 * i) / 1e5, word(data, 8 * i + 4) / 1e5}; };
        label.primaries = Primaries{xy(1), xy(2), xy(3), xy(0)};
    }
    return Done{};
}

}  // namespace

Result<ColorLabel> read_png_label(const std::string& path) {
    const auto bytes = read_input(path, "picture", largest_picture_file);
    if (!bytes) return bytes.error();
    const std::string_view file = *bytes;
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

// SPDX-License-Identifier: MIT
// Header, resolution line, then rows: a byte cursor over the whole file.
#include "image/radiance.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <cstdint>
#include <optional>

#include "image/input_file.hpp"
#include "image/primaries.hpp"
#include "image/radiance_rows.hpp"

namespace ols {

namespace {

// Four bytes a pixel, a little more for rows that runs do not shorten, and a header.
constexpr uint64_t most_file_bytes = 5 * most_pixels;
constexpr double lumens_per_watt = 179;  // WHTEFFICACY in Radiance's color.h

struct Header {
    bool has_format = false, xyz = false;
    double exposure = 1;
    std::array<double, 3> correction = {1, 1, 1};
    std::optional<Primaries> primaries;
    std::vector<std::string> said;
};

// The next line without its end, carriage returns included; nullopt at the end of the file.
std::optional<std::string_view> take_line(std::string_view& rest) {
    const size_t end = rest.find('\n');
    if (end == std::string_view::npos) return std::nullopt;
    std::string_view line = rest.substr(0, end);
    rest.remove_prefix(end + 1);
    if (line.ends_with('\r')) line.remove_suffix(1);
    return line;
}

std::string_view without_blanks_behind(std::string_view text) {
    while (!text.empty() && (text.back() == ' ' || text.back() == '\t')) text.remove_suffix(1);
    return text;
}

std::string_view trimmed(std::string_view text) {
    while (!text.empty() && (text.front() == ' ' || text.front() == '\t')) text.remove_prefix(1);
    return without_blanks_behind(text);
}

// Exactly N finite numbers.
template <size_t N>
std::optional<std::array<double, N>> numbers(std::string_view text) {
    std::array<double, N> values{};
    for (double& value : values) {
        text = trimmed(text);
        if (text.starts_with('+')) text.remove_prefix(1);
        const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
        if (error != std::errc() || !std::isfinite(value)) return std::nullopt;
        text.remove_prefix(size_t(end - text.data()));
    }
    return trimmed(text).empty() ? std::optional(values) : std::nullopt;
}

Error bad_line(std::string_view line) {
    return fail(fmt::format("its header says '{}', which cannot be: correct it", line.substr(0, 80)));
}

bool all_positive(const std::array<double, 3>& values) {
    return std::all_of(values.begin(), values.end(), [](double v) { return v > 0; });
}

// A line that states what pixels mean; the rest (SOFTWARE, CAPDATE, commands ...) describes where they come from.
Status read_variable(std::string_view line, std::string_view name, std::string_view value, Header& header) {
    if (name == "FORMAT") {
        const auto format = trimmed(value);
        header.has_format = true;
        header.xyz = format == "32-bit_rle_xyze";
        if (!header.xyz && format != "32-bit_rle_rgbe")
            return fail(fmt::format("its FORMAT is '{}': only 32-bit_rle_rgbe and 32-bit_rle_xyze are read",
                                    format.substr(0, 80)));
    } else if (name == "EXPOSURE") {
        const auto one = numbers<1>(value);
        if (!one || !((*one)[0] > 0)) return bad_line(line);
        header.exposure *= (*one)[0];
        if (!std::isnormal(header.exposure)) return bad_line(line);
    } else if (name == "COLORCORR") {
        const auto three = numbers<3>(value);
        if (!three || !all_positive(*three)) return bad_line(line);
        for (size_t c = 0; c < 3; ++c) header.correction[c] *= (*three)[c];
        if (!std::all_of(header.correction.begin(), header.correction.end(), [](double v) { return std::isnormal(v); }))
            return bad_line(line);
    } else if (name == "PRIMARIES") {
        const auto p = numbers<8>(value);
        if (!p) return bad_line(line);
        header.primaries = Primaries{{(*p)[0], (*p)[1]}, {(*p)[2], (*p)[3]}, {(*p)[4], (*p)[5]}, {(*p)[6], (*p)[7]}};
    } else if (name == "GAMMA") {
        const auto one = numbers<1>(value);
        if (!one || (*one)[0] != 1)
            return fail(fmt::format("its header says '{}', so it holds no linear light: save it with GAMMA=1",
                                    line.substr(0, 80)));
    } else if (name == "NCOMP") {
        const auto one = numbers<1>(value);
        if (!one || (*one)[0] != 3) return bad_line(line);
    } else if (name == "PIXASPECT") {
        const auto one = numbers<1>(value);
        if (!one || std::abs((*one)[0] - 1) > 1e-3)
            header.said.push_back(
                fmt::format("its header says '{}': its pixels are taken as square", line.substr(0, 80)));
    } else if (name == "VIEW") {
        header.said.push_back(fmt::format("its view is not used ({})", line.substr(0, 80)));
    }
    return Done{};
}

// Up to the empty line. Lines that begin with a blank are other pictures' headers, kept by the programs that joined them.
Result<Header> read_header(std::string_view& rest) {
    Header header;
    if (!take_line(rest)) return fail("its header is cut short: copy it again");
    for (;;) {
        const auto line = take_line(rest);
        if (!line) return fail("its header is cut short: copy it again");
        if (line->empty()) return header;
        const size_t equals = line->find('=');
        if (line->starts_with('#') || equals == std::string_view::npos) continue;
        const Status done =
            read_variable(*line, without_blanks_behind(line->substr(0, equals)), line->substr(equals + 1), header);
        if (!done) return done.error();
    }
}

// How the file's rows and the pixels in them lie on an upright picture.
struct Order {
    bool columns = false;  // what the file calls a row is a column of the picture
    bool right_to_left = false, bottom_up = false;
    int rows = 0, length = 0;  // as the file has them
};

struct Axis {
    char sign, letter;
    int count;
};

std::optional<Axis> take_axis(std::string_view& text) {
    text = trimmed(text);
    if (text.size() < 2 || (text[0] != '-' && text[0] != '+') || (text[1] != 'X' && text[1] != 'Y'))
        return std::nullopt;
    Axis axis{text[0], text[1], 0};
    text = trimmed(text.substr(2));
    const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), axis.count);
    if (error != std::errc() || axis.count < 1) return std::nullopt;
    text.remove_prefix(size_t(end - text.data()));
    return axis;
}

std::optional<Order> read_order(std::string_view& rest) {
    auto line = take_line(rest);
    if (!line) return std::nullopt;
    const auto first = take_axis(*line), second = take_axis(*line);
    if (!first || !second || first->letter == second->letter || !trimmed(*line).empty()) return std::nullopt;
    const Axis& x = first->letter == 'X' ? *first : *second;
    const Axis& y = first->letter == 'X' ? *second : *first;
    return Order{first->letter == 'X', x.sign == '-', y.sign == '+', first->count, second->count};
}

// Stored bytes to numbers, each at its place.
Image upright(const std::vector<Rgbe>& rows, const Order& order, const std::array<double, 3>& factors) {
    constexpr int exponent_bias = 128 + 8;
    Image image(order.columns ? order.rows : order.length, order.columns ? order.length : order.rows, 3);
    size_t i = 0;
    for (int row = 0; row < order.rows; ++row) {
        for (int along = 0; along < order.length; ++along, ++i) {
            int x = order.columns ? row : along, y = order.columns ? along : row;
            if (order.right_to_left) x = image.width - 1 - x;
            if (order.bottom_up) y = image.height - 1 - y;
            const Rgbe& stored = rows[i];
            const double unit = stored[3] == 0 ? 0 : std::ldexp(1.0, stored[3] - exponent_bias);
            for (int c = 0; c < 3; ++c) image.at(x, y, c) = float(stored[size_t(c)] * unit * factors[size_t(c)]);
        }
    }
    return image;
}

bool is_unstated(const Primaries& p) {
    return p.red.x == 0 && p.red.y == 0 && p.green.x == 0 && p.green.y == 0 && p.blue.x == 0 && p.blue.y == 0 &&
           p.white.x == 0 && p.white.y == 0;
}

Status make_rec709(FloatPicture& picture, const Header& header) {
    if (header.xyz) {
        picture.said.push_back(
            fmt::format("CIE XYZ in candelas/m2 (XYZE) was converted to Rec. 709 by {} lm/W", lumens_per_watt));
        if (header.primaries) picture.said.push_back("its PRIMARIES were not used: XYZ has its own");
        return convert_xyz_to_rec709(picture.pixels, equal_energy_white);
    }
    if (!header.primaries || are_rec709(*header.primaries)) return Done{};
    if (is_unstated(*header.primaries)) {
        picture.said.push_back("its PRIMARIES are all 0, as Photoshop writes them: taken as Rec. 709");
        return Done{};
    }
    picture.said.push_back("its PRIMARIES were converted to Rec. 709, white to white");
    return convert_to_rec709(picture.pixels, *header.primaries);
}

void say_factors(const Header& header, std::vector<std::string>& said) {
    if (header.exposure != 1) said.push_back(fmt::format("its EXPOSURE of {:.6g} was divided out", header.exposure));
    const auto& c = header.correction;
    if (c != std::array<double, 3>{1, 1, 1})
        said.push_back(fmt::format("its COLORCORR of {:.6g} {:.6g} {:.6g} was divided out", c[0], c[1], c[2]));
}

Result<FloatPicture> decode(std::string_view rest) {
    const auto header = read_header(rest);
    if (!header) return header.error();
    const auto order = read_order(rest);
    if (!order) return fail("its line of sizes is not like '-Y 512 +X 1024': it is damaged");
    const auto rows = read_radiance_rows(rest, order->rows, order->length);
    if (!rows) return rows.error();
    FloatPicture picture;
    picture.said = header->said;
    if (!header->has_format) picture.said.push_back("it has no FORMAT line: taken as 32-bit_rle_rgbe");
    if (!rest.empty()) picture.said.push_back(fmt::format("{} bytes behind the picture were left out", rest.size()));
    say_factors(*header, picture.said);
    std::array<double, 3> factors{};
    for (size_t c = 0; c < 3; ++c)
        factors[c] = 1 / (header->exposure * header->correction[c] * (header->xyz ? lumens_per_watt : 1));
    picture.pixels = upright(*rows, *order, factors);
    if (const Status done = make_rec709(picture, *header); !done) return done.error();
    return picture;
}

}  // namespace

bool begins_as_radiance(std::string_view bytes) {
    return bytes.starts_with("#?");
}

Result<FloatPicture> read_radiance(const std::string& path) {
    try {
        const auto bytes = read_input(path, "picture", most_file_bytes);
        if (!bytes) return bytes.error();
        if (!begins_as_radiance(*bytes))
            return fail("cannot read '" + path + "' as Radiance: it is " + kind_of_bytes(*bytes) +
                        ": name an .hdr file");
        auto picture = decode(*bytes);
        if (!picture) return fail("cannot read '" + path + "' as Radiance: " + picture.error().message);
        return picture;
    } catch (const std::bad_alloc&) {
        return fail("cannot read '" + path + "' as Radiance: there is not enough memory for its pixels: scale it down");
    }
}

}  // namespace ols

// SPDX-License-Identifier: MIT
// Text of any system to lines, lines to lights.
#include "stage/light_file.hpp"

#include <fmt/format.h>
#include <iconv.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <optional>
#include <string_view>

#include "image/input_file.hpp"

namespace ols {

namespace {

constexpr uintmax_t largest_text = 64 << 20;

std::optional<std::string> utf8_of(const std::string& bytes, const char* encoding) {
    const iconv_t converter = iconv_open("UTF-8", encoding);
    if (converter == iconv_t(-1)) return std::nullopt;
    std::string text(bytes.size() * 2 + 4, '\0');  // a UTF-16 word is at most 3 bytes of UTF-8
    char *from = const_cast<char*>(bytes.data()), *to = text.data();
    size_t left = bytes.size(), room = text.size();
    const bool done = iconv(converter, &from, &left, &to, &room) != size_t(-1) && left == 0;
    iconv_close(converter);
    if (!done) return std::nullopt;
    text.resize(text.size() - room);
    return text;
}

// Text without a byte order mark; nothing if it is none.
std::optional<std::string> decoded(const std::string& bytes) {
    const std::string_view view = bytes;
    if (view.starts_with("\xef\xbb\xbf")) return bytes.substr(3);
    if (view.starts_with("\xff\xfe")) return utf8_of(bytes.substr(2), "UTF-16LE");
    if (view.starts_with("\xfe\xff")) return utf8_of(bytes.substr(2), "UTF-16BE");
    if (view.find('\0') == std::string_view::npos) return bytes;
    if (view.size() < 4) return std::nullopt;
    return utf8_of(bytes, view[0] == '\0' ? "UTF-16BE" : "UTF-16LE");
}

struct Word {
    size_t begin, end;
};

std::vector<Word> words_of(const std::string& line) {
    std::vector<Word> words;
    for (size_t i = 0; (i = line.find_first_not_of(" \t", i)) != std::string::npos;) {
        const size_t end = std::min(line.find_first_of(" \t", i), line.size());
        words.push_back({i, end});
        i = end;
    }
    return words;
}

// One number with either decimal mark, whatever the locale; what is too small for a double is 0.
std::optional<double> number_of(std::string text) {
    std::ranges::replace(text, ',', '.');
    const char* begin = text.c_str() + (text.starts_with('+') ? 1 : 0);
    const char* end = text.c_str() + text.size();
    double value = 0;
    const auto parsed = std::from_chars(begin, end, value);
    if (parsed.ptr != end || parsed.ec == std::errc::invalid_argument) return std::nullopt;
    if (parsed.ec == std::errc::result_out_of_range) value = std::strtod(begin, nullptr);
    if (!std::isfinite(value)) return std::nullopt;
    return value;
}

// Unit length without overflow; nothing for a vector of 0.
std::optional<Vec3> direction_of(const double* v) {
    const double largest = std::max({std::abs(v[0]), std::abs(v[1]), std::abs(v[2])});
    if (!(largest > 0)) return std::nullopt;
    return normalized({v[0] / largest, v[1] / largest, v[2] / largest});
}

std::optional<size_t> parse_count(const std::string& line) {
    const auto words = words_of(line);
    if (words.size() != 1) return std::nullopt;
    size_t count = 0;
    const char* end = line.data() + words[0].end;
    const auto parsed = std::from_chars(line.data() + words[0].begin, end, count);
    if (parsed.ec != std::errc() || parsed.ptr != end || count == 0) return std::nullopt;
    return count;
}

// How many of a line's numbers stand behind its name: 3, or 4 or 6 behind a picture's name.
size_t numbers_behind_name(const NumberedName& words) {
    const std::string extension = std::filesystem::path(words.name).extension().string();
    const bool is_file = extension.size() >= 4 && extension.size() <= 5 && !number_of(extension.substr(1));
    return is_file && (words.numbers.size() == 4 || words.numbers.size() == 6) ? words.numbers.size() : 3;
}

struct Light {
    LightPosition position;
    std::optional<std::array<double, 3>> intensity;
    size_t columns = 3;  // of numbers
};

Result<Light> parse_light(const TextLine& line, const std::string& where) {
    const auto words = split_numbers(line.text);
    const size_t count = numbers_behind_name(words);
    const auto all = words_of(line.text);
    if (words.numbers.size() < 3 || all.size() < count + 1)
        return fail(where + ": '" + line.text + "' is no light: write `name x y z` with a direction that is not zero");
    const double* v = words.numbers.data() + words.numbers.size() - count;
    const auto direction = direction_of(v);
    if (!direction)
        return fail(where + ": '" + line.text + "' is no light: write `name x y z` with a direction that is not zero");
    const size_t begin = all[0].begin, end = all[all.size() - count - 1].end;
    Light light{{line.text.substr(begin, end - begin), *direction}, std::nullopt, count};
    if (count == 4) light.intensity = {v[3], v[3], v[3]};
    if (count == 6) light.intensity = {v[3], v[4], v[5]};
    if (light.intensity)
        for (const double i : *light.intensity)
            if (!(i > 1e-12 && i < 1e12))
                return fail(fmt::format("{}: an intensity of {:g} is none: write one above 0", where, i));
    return light;
}

double angle_between(const Vec3& a, const Vec3& b) {
    return 2 * std::asin(std::min(1.0, length(a - b) / 2));
}

// Sorted along x: neighbours in direction are neighbours in x.
Status check_directions(const LightFile& file, const std::string& path) {
    std::vector<size_t> order(file.lights.size());
    for (size_t i = 0; i < order.size(); ++i) order[i] = i;
    std::ranges::sort(order, {}, [&](size_t i) { return file.lights[i].direction.x; });
    for (size_t i = 0; i < order.size(); ++i)
        for (size_t j = i + 1; j < order.size(); ++j) {
            const auto &a = file.lights[order[i]], &b = file.lights[order[j]];
            if (b.direction.x - a.direction.x > closest_lamps_rad) break;
            if (angle_between(a.direction, b.direction) >= closest_lamps_rad) continue;
            const auto [first, second] = std::minmax(order[i], order[j]);
            return fail(fmt::format(
                "{}:{}: '{}' stands in the direction of '{}' (line {}): correct or remove one of them", path,
                file.lines[second], file.lights[second].name, file.lights[first].name, file.lines[first]));
        }
    return Done{};
}

}  // namespace

Result<std::vector<TextLine>> read_text_lines(const std::string& path) {
    const auto bytes = read_input(path, "list of lights", largest_text);
    if (!bytes) return bytes.error();
    const auto text = decoded(*bytes);
    if (!text || text->find('\0') != std::string::npos) return fail("'" + path + "' is no text: save it as UTF-8");
    std::vector<TextLine> lines;
    int number = 1;
    for (size_t at = 0; at < text->size(); ++number) {
        const size_t end = std::min(text->find_first_of("\r\n", at), text->size());
        const std::string line = text->substr(at, end - at);
        if (!words_of(line).empty()) lines.push_back({number, line});
        at = end + (text->compare(end, 2, "\r\n") == 0 ? 2 : 1);
    }
    return lines;
}

NumberedName split_numbers(const std::string& line) {
    auto words = words_of(line);
    NumberedName result;
    constexpr size_t most = 8;  // no line has as many
    while (!words.empty() && result.numbers.size() < most) {
        const auto value = number_of(line.substr(words.back().begin, words.back().end - words.back().begin));
        if (!value) break;
        result.numbers.insert(result.numbers.begin(), *value);
        words.pop_back();
    }
    if (!words.empty()) result.name = line.substr(words.front().begin, words.back().end - words.front().begin);
    return result;
}

Result<LightFile> read_light_file(const std::string& path) {
    const auto lines = read_text_lines(path);
    if (!lines) return lines.error();
    if (lines->empty()) return fail("'" + path + "' is empty: an .lp file begins with the number of lights");
    const auto count = parse_count(lines->front().text);
    if (!count)
        return fail(fmt::format("{}:{}: '{}' is not the number of lights an .lp file begins with", path,
                                lines->front().number, lines->front().text));
    LightFile file;
    size_t columns = 0;
    for (size_t i = 1; i < lines->size(); ++i) {
        const TextLine& line = (*lines)[i];
        const auto where = fmt::format("{}:{}", path, line.number);
        auto light = parse_light(line, where);
        if (!light) return light.error();
        if (i == 1) columns = light->columns;
        if (light->columns != columns) return fail(where + ": has another number of columns than the lines before it");
        file.lights.push_back(light->position);
        file.lines.push_back(line.number);
        if (light->intensity) file.intensities.push_back(*light->intensity);
    }
    if (file.lights.size() != *count)
        return fail(fmt::format("{}: says {} lights and lists {}: correct the first line or add the missing lights",
                                path, *count, file.lights.size()));
    if (auto s = check_directions(file, path); !s) return s.error();
    return file;
}

}  // namespace ols

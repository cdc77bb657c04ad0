// SPDX-License-Identifier: MIT
// The once-subdivided icosahedron, and .lp reading and writing.
#include "stage/lamps.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <fstream>
#include <numbers>
#include <optional>

#include "image/whole_file.hpp"

namespace ols {

double dot(Vec3 a, Vec3 b) {
    return a.x * b.x + a.y * b.y + a.z * b.z;
}

Vec3 cross(Vec3 a, Vec3 b) {
    return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}

double length(Vec3 v) {
    return std::sqrt(dot(v, v));
}

Vec3 normalized(Vec3 v) {
    return v * (1 / length(v));
}

namespace {

// The 12 vertices: the poles on the y axis, two rings of five at latitude atan(1/2), turned by 36 degrees.
std::vector<Vec3> icosahedron() {
    std::vector<Vec3> vertices = {{0, 1, 0}, {0, -1, 0}};
    const double y = 1 / std::sqrt(5.0), r = 2 / std::sqrt(5.0);
    for (int i = 0; i < 5; ++i) {
        const double upper = 2 * std::numbers::pi * i / 5, lower = upper + std::numbers::pi / 5;
        vertices.push_back({r * std::sin(upper), y, r * std::cos(upper)});
        vertices.push_back({r * std::sin(lower), -y, r * std::cos(lower)});
    }
    return vertices;
}

// Adds the midpoint of every edge, pushed out to the sphere: an edge is a pair closer than `longest_edge`.
std::vector<Vec3> with_edge_midpoints(const std::vector<Vec3>& vertices, double longest_edge) {
    std::vector<Vec3> all = vertices;
    for (size_t i = 0; i < vertices.size(); ++i)
        for (size_t j = i + 1; j < vertices.size(); ++j)
            if (length(vertices[i] - vertices[j]) < longest_edge) all.push_back(normalized(vertices[i] + vertices[j]));
    return all;
}

// Top to bottom, then azimuth; coordinates are compared on a grid coarser than rounding errors.
bool above(Vec3 a, Vec3 b) {
    const auto grid = [](double v) { return std::lround(v * 1e6); };
    const auto azimuth = [&](Vec3 v) {
        const double angle = std::atan2(v.x, v.z);
        return grid(angle < -1e-9 ? angle + 2 * std::numbers::pi : angle);
    };
    if (grid(a.y) != grid(b.y)) return a.y > b.y;
    return azimuth(a) < azimuth(b);
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

// One coordinate with either decimal mark, whatever the locale.
std::optional<double> coordinate(std::string text) {
    std::replace(text.begin(), text.end(), ',', '.');
    const char* begin = text.c_str() + (text.starts_with('+') ? 1 : 0);
    const char* end = text.c_str() + text.size();
    double value = 0;
    const auto parsed = std::from_chars(begin, end, value);
    if (parsed.ec != std::errc() || parsed.ptr != end || !std::isfinite(value)) return std::nullopt;
    return value;
}

// `name x y z`: the last three words are the coordinates, what stands before them is the name.
std::optional<LightPosition> parse_light(const std::string& line) {
    const auto words = words_of(line);
    if (words.size() < 4) return std::nullopt;
    double v[3];
    for (int i = 0; i < 3; ++i) {
        const Word word = words[words.size() - 3 + i];
        const auto value = coordinate(line.substr(word.begin, word.end - word.begin));
        if (!value) return std::nullopt;
        v[i] = *value;
    }
    const Vec3 direction{v[0], v[1], v[2]};
    if (!(length(direction) > 1e-9)) return std::nullopt;
    const size_t name_end = words[words.size() - 4].end;
    return LightPosition{line.substr(words[0].begin, name_end - words[0].begin), normalized(direction)};
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

}  // namespace

std::vector<Vec3> full_sphere_directions() {
    // Halved twice: 12 corners and their 30 midpoints make the 42 vertices (edges 0.5465 and 0.6180) of the
    // once-subdivided icosahedron; lamps sit on these and on the middles of its 120 edges.
    auto points = with_edge_midpoints(with_edge_midpoints(icosahedron(), 1.06), 0.63);
    // The lowest vertex and the middles of its five edges are the last six of this order.
    std::sort(points.begin(), points.end(), above);
    return points;
}

std::vector<Vec3> stage_lamp_directions() {
    auto points = full_sphere_directions();
    points.resize(sphere_lamp_count);
    return points;
}

Result<std::vector<LightPosition>> read_lp(const std::string& path) {
    std::ifstream file(path);
    if (!file) return fail("cannot open light positions '" + path + "': check the path");
    std::string line;
    int line_number = 0;
    std::optional<size_t> count;
    std::vector<LightPosition> lights;
    while (std::getline(file, line)) {
        ++line_number;
        if (line_number == 1 && line.starts_with("\xef\xbb\xbf")) line.erase(0, 3);
        if (line.ends_with('\r')) line.pop_back();
        if (words_of(line).empty()) continue;
        if (!count) {
            count = parse_count(line);
            if (!count)
                return fail(fmt::format("{}:{}: '{}' is not the number of lights an .lp file begins with", path,
                                        line_number, line));
            continue;
        }
        const auto light = parse_light(line);
        if (!light)
            return fail(fmt::format("{}:{}: '{}' is no light: write `name x y z` with a direction that is not zero",
                                    path, line_number, line));
        lights.push_back(*light);
    }
    if (!count) return fail("'" + path + "' is empty: an .lp file begins with the number of lights");
    if (lights.size() != *count)
        return fail(fmt::format("{}: says {} lights and lists {}: correct the first line or add the missing lights",
                                path, *count, lights.size()));
    return lights;
}

std::vector<LightPosition> named_lamps(const std::vector<Vec3>& directions) {
    std::vector<LightPosition> lamps;
    for (size_t i = 0; i < directions.size(); ++i) lamps.push_back({fmt::format("lamp_{:03}", i), directions[i]});
    return lamps;
}

Status write_lp(const std::string& path, std::vector<LightPosition> lights) {
    std::sort(lights.begin(), lights.end(), [](const auto& a, const auto& b) { return a.name < b.name; });
    std::string text = fmt::format("{}\n", lights.size());
    for (const auto& light : lights) {
        const Vec3 d = normalized(light.direction);
        text += fmt::format("{} {:.9f} {:.9f} {:.9f}\n", light.name, d.x, d.y, d.z);
    }
    return write_whole_file(path, text);
}

}  // namespace ols

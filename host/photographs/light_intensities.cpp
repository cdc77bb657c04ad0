// SPDX-License-Identifier: MIT
// Lines of numbers, with names or without.
#include "photographs/light_intensities.hpp"

#include <fmt/format.h>

#include <cmath>
#include <map>
#include <optional>

#include "photographs/picture_names.hpp"
#include "stage/light_file.hpp"

namespace ols {

namespace {

struct Line {
    std::string name;  // may be empty
    Intensity intensity;
};

std::optional<Line> parse(const std::string& text) {
    const auto words = split_numbers(text);
    if (words.numbers.size() != 1 && words.numbers.size() != 3) return std::nullopt;
    const double red = words.numbers[0];
    const Intensity intensity =
        words.numbers.size() == 1 ? Intensity{red, red, red} : Intensity{red, words.numbers[1], words.numbers[2]};
    for (const double v : intensity)
        if (!(v > 1e-12 && v < 1e12)) return std::nullopt;
    return Line{words.name, intensity};
}

}  // namespace

Result<std::vector<Intensity>> read_light_intensities(const std::string& path,
                                                      const std::vector<LightPosition>& lights) {
    const auto lines = read_text_lines(path);
    if (!lines) return lines.error();
    std::map<std::string, size_t> light_of;
    for (size_t i = 0; i < lights.size(); ++i) light_of.try_emplace(lights[i].name, i);
    for (size_t i = 0; i < lights.size(); ++i) light_of.try_emplace(base_name(lights[i].name), i);
    std::vector<std::optional<Intensity>> found(lights.size());
    size_t count = 0;
    bool have_names = false;
    for (const auto& line : *lines) {
        const auto parsed = parse(line.text);
        const auto where = fmt::format("{}:{}", path, line.number);
        if (!parsed)
            return fail(where + ": '" + line.text +
                        "' is no intensity: write one number or R G B, above 0, a line for each light");
        if (count == 0) have_names = !parsed->name.empty();
        if (parsed->name.empty() == have_names)
            return fail(where + ": some lines have names and others none: write all or none");
        size_t index = count;
        if (have_names) {
            auto light = light_of.find(parsed->name);
            if (light == light_of.end()) light = light_of.find(base_name(parsed->name));
            if (light == light_of.end())
                return fail(where + ": '" + parsed->name + "' is none of the lights of the .lp file");
            index = light->second;
        }
        if (index < found.size() && found[index]) return fail(where + ": this light has its intensity already");
        if (index < found.size()) found[index] = parsed->intensity;
        ++count;
    }
    if (count != lights.size())
        return fail(fmt::format("'{}' has {} intensities, the .lp file {} lights: one line for each light", path, count,
                                lights.size()));
    std::vector<Intensity> intensities;
    for (const auto& intensity : found) intensities.push_back(*intensity);  // as many as lights, each once
    return intensities;
}

}  // namespace ols

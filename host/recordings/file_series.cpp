// SPDX-License-Identifier: MIT
// Names taken apart.
#include "recordings/file_series.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <filesystem>
#include <map>
#include <optional>
#include <set>

#include "photographs/picture_format.hpp"
#include "photographs/picture_names.hpp"

namespace ols {

namespace {

namespace fs = std::filesystem;

struct ParsedName {
    std::string before, after;  // the number
    char sign = 0;              // '+' or '-' in front of it
    int64_t number = 0;
    std::string name;

    std::string unsigned_series() const { return before + "#" + after; }
    std::string series() const { return before + (sign ? std::string(1, sign) : "") + "#" + after; }
};

bool is_digit(char c) {
    return c >= '0' && c <= '9';
}

std::optional<ParsedName> parse(const std::string& name) {
    const size_t extension = name.rfind('.');
    size_t end = extension == std::string::npos || extension == 0 ? name.size() : extension;
    while (end > 0 && !is_digit(name[end - 1])) --end;
    size_t begin = end;
    while (begin > 0 && is_digit(name[begin - 1])) --begin;
    if (begin == end || end - begin > 18) return std::nullopt;
    ParsedName parsed{name.substr(0, begin), name.substr(end), 0, 0, name};
    std::from_chars(name.data() + begin, name.data() + end, parsed.number);
    if (begin > 0 && (name[begin - 1] == '+' || name[begin - 1] == '-')) {
        parsed.sign = name[begin - 1];
        parsed.before.pop_back();
    }
    return parsed;
}

}  // namespace

Result<FileSeries> find_series(const std::string& path, bool any_kind) {
    std::error_code error;
    const bool is_folder = fs::is_directory(path, error);
    if (!is_folder && !fs::is_regular_file(path, error))
        return fail(fmt::format("'{}' is not there, or neither a folder nor a file: check the path", path));
    const fs::path folder = is_folder ? fs::path(path) : fs::absolute(path, error).parent_path();
    const auto names = file_names(folder.string());
    if (!names.ok()) return names.error();

    FileSeries series;
    std::map<std::string, std::set<char>> signs;  // of each series without its signs
    std::vector<ParsedName> all;
    for (const std::string& name : *names) {
        auto parsed = any_kind || looks_like_a_picture(name) ? parse(name) : std::nullopt;
        if (!parsed) {
            ++series.others;
            continue;
        }
        signs[parsed->unsigned_series()].insert(parsed->sign);
        all.push_back(std::move(*parsed));
    }
    const auto series_of = [&](const ParsedName& one) {
        const auto& seen = signs[one.unsigned_series()];
        return seen.contains('+') && seen.contains('-') ? one.unsigned_series() : one.series();
    };
    std::map<std::string, std::vector<ParsedName>> by_series;
    for (ParsedName& one : all) {
        const std::string name = series_of(one);
        if (name == one.unsigned_series() && one.sign == '-') one.number = -one.number;
        by_series[name].push_back(std::move(one));
    }
    if (by_series.empty())
        return fail(
            fmt::format("'{}' holds no numbered {}: a frame's number stands in its file's name, as in take_0001.tif",
                        folder.string(), any_kind ? "files" : "pictures"));
    auto chosen = by_series.begin();
    if (is_folder && by_series.size() > 1)
        return fail(fmt::format("'{}' holds several series, as '{}' and '{}': name one file of the one that is meant",
                                path, by_series.begin()->first, std::next(by_series.begin())->first));
    if (!is_folder) {
        const std::string name = fs::path(path).filename().string();
        chosen = std::ranges::find_if(by_series, [&](const auto& one) {
            return std::ranges::any_of(one.second, [&](const ParsedName& file) { return file.name == name; });
        });
        if (chosen == by_series.end())
            return fail(fmt::format(
                "'{}' has no number in its name, or is no picture (--raw says how other files are laid out)", path));
    }
    series.name = chosen->first;
    for (const ParsedName& one : chosen->second) series.files.push_back({one.number, (folder / one.name).string()});
    std::ranges::sort(series.files, {}, &NumberedFile::number);
    const auto twice = std::ranges::adjacent_find(series.files, {}, &NumberedFile::number);
    if (twice != series.files.end())
        return fail(fmt::format("'{}' and '{}' have one number: remove one", twice->path, std::next(twice)->path));
    return series;
}

}  // namespace ols

// SPDX-License-Identifier: MIT
// Names are compared in Unicode's NFC with its case folding (utf8proc): macOS writes NFD, most programs NFC.
#include "photographs/picture_names.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <utf8proc.h>

#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <map>

namespace ols {

namespace {

namespace fs = std::filesystem;

// A name that is no UTF-8 stays as it is.
std::string in_one_form(const std::string& name, bool fold_case) {
    utf8proc_uint8_t* mapped = nullptr;
    const auto options = utf8proc_option_t(UTF8PROC_STABLE | UTF8PROC_COMPOSE | (fold_case ? UTF8PROC_CASEFOLD : 0));
    const auto length = utf8proc_map(reinterpret_cast<const utf8proc_uint8_t*>(name.data()),
                                     utf8proc_ssize_t(name.size()), &mapped, options);
    if (length < 0) return name;
    std::string result(reinterpret_cast<const char*>(mapped), size_t(length));
    std::free(mapped);
    return result;
}

std::string some_of(const std::vector<std::string>& names) {
    constexpr size_t shown = 5;
    const std::vector<std::string> first(names.begin(), names.begin() + std::ptrdiff_t(std::min(shown, names.size())));
    std::string text = fmt::format("'{}'", fmt::join(first, "', '"));
    if (names.size() > shown) text += fmt::format(" and {} more", names.size() - shown);
    return text;
}

bool is_inside(const fs::path& relative) {
    return relative.is_relative() && !relative.empty() && *relative.begin() != "..";
}

// The path, relative to the folder, of the picture that a light means; empty when there is none.
Result<std::string> picture_of(const std::string& light, const fs::path& folder, const std::set<std::string>& files) {
    std::error_code error;
    std::string slashes = light;
    std::ranges::replace(slashes, '\\', '/');
    for (const auto& written : {light, slashes}) {
        const fs::path path = fs::path(written).lexically_normal();
        if (is_inside(path) && fs::is_regular_file(folder / path, error)) return path.string();
    }
    const std::string base = base_name(light);
    if (files.contains(base)) return base;
    for (const bool fold_case : {false, true}) {
        std::vector<std::string> alike;
        for (const auto& file : files)
            if (in_one_form(file, fold_case) == in_one_form(base, fold_case)) alike.push_back(file);
        if (alike.size() > 1)
            return fail(fmt::format("'{}' may mean {} of '{}': write the name in the .lp file as one of these", base,
                                    some_of(alike), folder.string()));
        if (!alike.empty()) return alike.front();
    }
    return std::string();
}

}  // namespace

std::string base_name(const std::string& path) {
    const size_t slash = path.find_last_of("/\\");
    return slash == std::string::npos ? path : path.substr(slash + 1);
}

Result<std::set<std::string>> file_names(const std::string& folder) {
    std::set<std::string> names;
    std::error_code error;
    for (fs::directory_iterator entry(folder, error), end; !error && entry != end; entry.increment(error)) {
        std::error_code none_of_ours;  // a link that leads nowhere
        if (entry->is_regular_file(none_of_ours)) names.insert(entry->path().filename().string());
    }
    if (error) return fail("cannot read folder '" + folder + "': " + error.message());
    return names;
}

Result<std::vector<std::string>> match_pictures(const std::vector<LightPosition>& lights, const std::string& lp,
                                                const std::string& folder) {
    const auto files = file_names(folder);
    if (!files) return files.error();
    std::vector<std::string> pictures, missing;
    std::map<std::string, std::string> meant_by;
    for (const auto& light : lights) {
        const auto picture = picture_of(light.name, folder, *files);
        if (!picture) return picture.error();
        if (picture->empty()) {
            missing.push_back(base_name(light.name));
            continue;
        }
        const auto [other, fresh] = meant_by.try_emplace(*picture, light.name);
        if (!fresh)
            return fail(fmt::format("{}: '{}' and '{}' both mean '{}/{}': every light needs a picture of its own", lp,
                                    other->second, light.name, folder, *picture));
        pictures.push_back(*picture);
    }
    if (!missing.empty())
        return fail(fmt::format("{} of the {} pictures that '{}' names are not in '{}': {}", missing.size(),
                                lights.size(), lp, folder, some_of(missing)));
    return pictures;
}

}  // namespace ols

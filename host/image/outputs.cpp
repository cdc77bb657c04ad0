// SPDX-License-Identifier: MIT
// Files are compared by device and inode, places that are still empty by their canonical names.
#include "image/outputs.hpp"

#include <filesystem>
#include <map>

#include "image/whole_file.hpp"

namespace ols {

namespace {

namespace fs = std::filesystem;

// Where an output will stand; its folder exists.
struct Place {
    std::string name;  // as it was given
    fs::path path;     // canonical
};

Result<Place> place_of(const std::string& name, const fs::path& path) {
    std::error_code error;
    // Not normalised as text first: what "link/.." is, only the file system knows.
    const fs::path folder = fs::canonical(fs::absolute(path, error).parent_path(), error);
    if (error) return fail("cannot write '" + name + "': check that the folder exists");
    return Place{name, folder / path.filename()};
}

bool is_regular(const fs::path& path) {
    std::error_code error;
    return fs::is_regular_file(path, error);
}

// The input that an existing file is, by whatever name; empty for none.
std::string input_that_is(const fs::path& file, const std::vector<std::string>& inputs) {
    std::error_code error;
    for (const auto& input : inputs) {
        if (input.empty()) continue;
        if (is_regular(input) && fs::equivalent(file, input, error)) return input;
        if (!fs::is_directory(input, error)) continue;
        for (auto entry = fs::recursive_directory_iterator(input, error); !error && entry != end(entry);
             entry.increment(error))
            if (is_regular(entry->path()) && fs::equivalent(file, entry->path(), error)) return entry->path().string();
    }
    return "";
}

// Where all outputs will stand, each of which may be written.
Result<std::vector<Place>> places_of(const Outputs& outputs) {
    std::vector<std::pair<std::string, fs::path>> wanted;
    for (const auto* names : {&outputs.files, &outputs.exr, &outputs.png})
        for (const auto& name : *names) {
            if (name.empty()) continue;
            auto path = output_place(name);
            if (!path) return path.error();
            wanted.emplace_back(name, std::move(*path));
        }
    for (const auto& name : outputs.folders) {
        if (name.empty()) continue;
        auto path = new_folder_place(name);
        if (!path) return path.error();
        wanted.emplace_back(name, std::move(*path));
    }
    for (const auto& name : outputs.streams) {
        std::error_code error;
        if (name.empty() || (fs::exists(name, error) && fs::is_other(name, error))) continue;
        auto path = output_place(name);
        if (!path) return path.error();
        wanted.emplace_back(name, std::move(*path));
    }
    std::vector<Place> places;
    for (const auto& [name, path] : wanted) {
        auto place = place_of(name, path);
        if (!place) return place.error();
        places.push_back(std::move(*place));
    }
    return places;
}

// Whoever opens a file by its name finds what the name says.
Status check_endings(const std::vector<std::string>& names, const std::string& ending, const char* kind) {
    for (const auto& name : names) {
        std::string other = fs::path(name).extension().string();
        for (char& c : other)
            if (c >= 'A' && c <= 'Z') c = char(c - 'A' + 'a');
        if (name.empty() || other == ending) continue;
        return fail("cannot write '" + name + "': it becomes " + kind + ": end its name in " + ending);
    }
    return Done{};
}

}  // namespace

Status check_outputs(const Outputs& outputs) {
    const auto places = places_of(outputs);
    if (!places) return places.error();
    std::map<fs::path, std::string> taken;
    for (const Place& place : *places) {
        if (const std::string input = is_regular(place.path) ? input_that_is(place.path, outputs.inputs) : "";
            !input.empty())
            return fail("cannot write '" + place.name + "': it is '" + input +
                        "', which is read: choose another name for what is written");
        const auto [other, fresh] = taken.try_emplace(place.path, place.name);
        if (!fresh)
            return fail("cannot write both '" + other->second + "' and '" + place.name +
                        "': they are one file: give each output a name of its own");
    }
    if (const Status exr = check_endings(outputs.exr, ".exr", "an OpenEXR file"); !exr) return exr;
    return check_endings(outputs.png, ".png", "a PNG picture");
}

}  // namespace ols

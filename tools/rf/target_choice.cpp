// SPDX-License-Identifier: MIT
// Targets of one camera by number, the first, or all.
#include "target_choice.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <charconv>
#include <filesystem>

namespace ols {

namespace fs = std::filesystem;

void TargetOptions::add_to(CLI::App& verb) {
    verb.add_option("--target", target, "number, `first` (default) or `all` (then names get _NNNNNN)")->type_name("N");
    verb.add_option("--camera", camera, "camera of the targets")->type_name("N");
}

std::string TargetChoice::warning() const {
    if (missing.empty()) return "";
    uint64_t count = 0;
    std::vector<std::string> runs;
    for (const TargetEntry& run : missing) {
        count += uint64_t(run.last) - run.index + 1;
        runs.push_back(target_words(run));
    }
    return fmt::format("{} {} missing in the archive and left out, and the numbers with them: {}; rf info says why",
                       count, count == 1 ? "target is" : "targets are", fmt::join(runs, ", "));
}

nlohmann::json TargetChoice::missing_json() const {
    auto runs = nlohmann::json::array();
    for (const TargetEntry& run : missing) {
        runs.push_back({{"index", run.index}});
        if (run.last > run.index) runs.back()["through"] = run.last;
    }
    return runs;
}

namespace {

// An error unless it is one number, `first` or `all`.
Status check_target(const std::string& target) {
    uint32_t number = 0;
    const char* end = target.data() + target.size();
    const auto [stop, error] = std::from_chars(target.data(), end, number);
    if (target == "first" || target == "all" || (error == std::errc() && stop == end)) return Done{};
    return fail("--target '" + target + "' is neither one number nor `first` nor `all`: choose one of these");
}

}  // namespace

Result<TargetChoice> choose_targets(const ArchiveReader& archive, const std::string& path,
                                    const TargetOptions& options) {
    if (const Status known = check_target(options.target); !known) return known.error();
    TargetChoice all;
    for (const auto& entry : archive.targets()) {
        if (entry.camera != options.camera) continue;
        if (entry.file.empty())
            all.missing.push_back(entry);
        else
            all.finished.push_back(entry);
    }
    for (const auto& run : archive.undecided())
        if (run.camera == options.camera) all.missing.push_back(run);
    if (all.finished.empty())
        return fail(
            fmt::format("'{}' has no finished target of camera {}: see `rf info {}`", path, options.camera, path));
    if (options.takes_all()) return all;
    if (options.target == "first") return TargetChoice{{all.finished.front()}, {}};
    for (const auto& entry : all.finished)
        if (std::to_string(entry.index) == options.target) return TargetChoice{{entry}, {}};
    return fail(fmt::format("'{}' has no finished target {} of camera {}: see `rf info {}`", path, options.target,
                            options.camera, path));
}

std::string file_of_target(const std::string& path, const TargetEntry& entry, const TargetOptions& options) {
    if (!options.takes_all() || path.empty()) return path;
    const fs::path p(path);
    return (p.parent_path() / fmt::format("{}_{:06}{}", p.stem().string(), entry.index, p.extension().string()))
        .string();
}

std::string folder_of_target(const std::string& path, const TargetEntry& entry, const TargetOptions& options) {
    if (!options.takes_all() || path.empty()) return path;
    fs::path folder = fs::path(path).lexically_normal();
    if (!folder.has_filename()) folder = folder.parent_path();  // "lamps/"
    return fmt::format("{}_{:06}", folder.string(), entry.index);
}

}  // namespace ols

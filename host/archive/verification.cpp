// SPDX-License-Identifier: MIT
// One line for each thing that is not as it was written.
#include "archive/verification.hpp"

#include <fmt/format.h>
#include <sys/stat.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <set>

#include "archive/archive_file.hpp"
#include "archive/target_file.hpp"
#include "exceptions.hpp"

namespace ols {

namespace fs = std::filesystem;

namespace {

// Nothing where a file is as the journal says.
std::string damage(const fs::path& root, const std::string& name, const Checksum& expected) {
    const auto file = ArchiveFile::open(root, name);
    if (!file) return name + ": " + file.error().message;
    const auto sum = file->checksum();
    if (!sum) return name + ": " + sum.error().message;
    return difference(name, *sum, expected);
}

template <typename Samples, typename IsGood>
Status check_samples(const char* what, const Samples& samples, IsGood is_good) {
    if (std::ranges::all_of(samples, is_good)) return Done{};
    return fail(fmt::format("its {} holds values that no archive has", what));
}

Status check_values(const Target& target) {
    const auto is_finite = [](float value) { return std::isfinite(value); };
    const auto is_positive = [](float value) { return std::isfinite(value) && value >= 0; };
    const auto is_share = [](float value) { return value >= 0 && value <= 1; };
    for (const Plane& plane : target.lamps)
        if (const Status s = check_samples("part 'lamps'", plane, is_finite); !s) return s;
    for (const auto& plane : target.matte.planes)
        if (const Status s = check_samples("part 'matte'", plane, is_finite); !s) return s;
    if (const Status s = check_samples("variance of the matte", target.matte.variance, is_positive); !s) return s;
    if (const Status s = check_samples("part 'variance'", target.variance, is_positive); !s) return s;
    if (const Status s = check_samples("part 'noise_gain'", target.noise_gain, is_positive); !s) return s;
    return check_samples("part 'confidence'", target.confidence, is_share);
}

Status decode_all(const TargetReader& target) {
    const Target& head = target.head();
    const int rows = target.strip_rows();
    for (int y = 0; y < head.height; y += rows) {
        const auto strip = target.read_box({0, y, head.width, std::min(rows, head.height - y)});
        if (!strip) return strip.error();
        if (const Status s = check_values(*strip); !s) return s;
    }
    if (head.motion.times_s.empty()) return Done{};
    const auto motion = target.read_motion();
    return motion ? Status(Done{}) : motion.error();
}

std::string target_problem(const ArchiveToVerify& archive, const TargetEntry& entry, bool deep) {
    if (auto problem = damage(archive.root, entry.file, {entry.bytes, entry.crc32}); !problem.empty()) return problem;
    const auto target = archive.open_target(entry);
    if (!target) return entry.file + ": " + target.error().message;
    if (!deep) return "";
    const Status decoded = guarded("cannot decode it", [&] { return decode_all(*target); });
    return decoded ? "" : entry.file + ": " + decoded.error().message;
}

// The room for the manifest of an archive that is being written, or was.
bool is_set_aside(const std::string& name, const struct stat& info) {
    return name == fmt::format("{}{}", manifest_name, unfinished_suffix) && S_ISREG(info.st_mode) && info.st_size == 0;
}

std::string what_stands_there(const std::string& name, const struct stat& info, const std::set<std::string>& known) {
    unsigned camera = 0;
    if (S_ISDIR(info.st_mode) && std::sscanf(name.c_str(), "cam%u", &camera) == 1 &&
        name == fmt::format("cam{}", camera))
        return "";
    if (!S_ISREG(info.st_mode))
        return known.contains(name)
                   ? ""
                   : fmt::format("{}: is {}, and no part of the archive", name, entry_kind(info.st_mode));
    if (known.contains(name) || is_set_aside(name, info)) return "";
    if (name.ends_with(unfinished_suffix)) return name + ": was not finished; it may be removed";
    if (name.ends_with(".exr")) return name + ": is not in the journal: it was not finished";
    return name + ": is no part of the archive";
}

void find_leftovers(const fs::path& root, const Journal& journal, std::vector<std::string>& problems) {
    std::set<std::string> known = {manifest_name, lights_name, journal_name};
    for (const auto& entry : journal.targets) known.insert(entry.file);
    std::vector<std::string> found;
    std::error_code error;
    for (auto entry = fs::recursive_directory_iterator(root, error); !error && entry != end(entry);
         entry.increment(error)) {
        const std::string name = entry->path().lexically_relative(root).generic_string();
        struct stat info {};
        if (lstat(entry->path().c_str(), &info) != 0) continue;  // it went away meanwhile
        if (auto problem = what_stands_there(name, info, known); !problem.empty()) found.push_back(std::move(problem));
    }
    if (error) found.push_back(fmt::format("'{}' cannot be looked into: {}", root.string(), error.message()));
    std::ranges::sort(found);
    problems.insert(problems.end(), found.begin(), found.end());
}

void check_manifest(const ArchiveToVerify& archive, std::vector<std::string>& problems) {
    const Manifest& manifest = archive.manifest;
    const Journal& journal = archive.journal;
    // Between the manifest's last writing and the journal's end the begin's checksum is of the one before.
    const bool is_newer_than_begin = !journal.ended && manifest.written.has_value();
    if (journal.manifest && !is_newer_than_begin)
        if (auto problem = damage(archive.root, manifest_name, *journal.manifest); !problem.empty())
            problems.push_back(std::move(problem));
    if (!journal.ended) return;
    const auto check = [&](const char* what, std::optional<uint64_t> stated, uint64_t counted) {
        if (stated != counted)
            problems.push_back(fmt::format("{}: does not count the {} targets that the journal notes as {}",
                                           manifest_name, counted, what));
    };
    check("written", manifest.written, count_finished(journal));
    check("missing", manifest.missing, count_missing(journal));
}

void check_undecided(const ArchiveToVerify& archive, std::vector<std::string>& problems) {
    for (const auto& run : undecided_targets(archive.journal))
        problems.push_back(fmt::format("camera {}: {} {}", run.camera, target_words(run),
                                       archive.is_being_written ? "to come" : "never finished"));
    if (!archive.journal.ended)
        problems.push_back(fmt::format("{}: has no end: the recording {}", journal_name,
                                       archive.is_being_written ? "goes on" : "was interrupted"));
}

}  // namespace

Verification verify_archive(const ArchiveToVerify& archive, bool deep) {
    const Journal& journal = archive.journal;
    Verification result;
    auto& problems = result.problems;
    for (const auto& entry : journal.targets) {
        if (entry.file.empty()) continue;
        if (auto problem = target_problem(archive, entry, deep); !problem.empty())
            problems.push_back(std::move(problem));
        else
            result.intact.push_back(entry.file);
    }
    if (journal.lights)
        if (auto problem = damage(archive.root, lights_name, *journal.lights); !problem.empty())
            problems.push_back(std::move(problem));
    check_manifest(archive, problems);
    problems.insert(problems.end(), journal.problems.begin(), journal.problems.end());
    if (!journal.torn.empty()) problems.push_back(journal.torn);
    find_leftovers(archive.root, journal, problems);
    check_undecided(archive, problems);
    if (archive.manifest.version < 2)
        result.notes.push_back(
            fmt::format("{}: is of version 1, whose lines are not chained: of what it notes only the "
                        "files, the counts and the numbers of targets could be checked",
                        journal_name));
    return result;
}

}  // namespace ols

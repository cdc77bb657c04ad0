// SPDX-License-Identifier: MIT
// rf verify: which targets are as they were written, and what is wrong with the rest.
#include <fmt/format.h>

#include <memory>

#include "archive/archive.hpp"
#include "program.hpp"
#include "verbs.hpp"

namespace ols {

namespace {

// Runs of missing targets; `through` is the last of a run of several.
nlohmann::json missing_json(const ArchiveReader& archive) {
    nlohmann::json missing = nlohmann::json::array();
    for (const auto& entry : archive.targets()) {
        if (!entry.file.empty()) continue;
        missing.push_back({{"camera", entry.camera}, {"index", entry.index}, {"why", entry.why_missing}});
        if (entry.last > entry.index) missing.back()["through"] = entry.last;
    }
    return missing;
}

uint64_t count_missing(const ArchiveReader& archive) {
    uint64_t count = 0;
    for (const auto& entry : archive.targets())
        if (entry.file.empty()) count += uint64_t(entry.last) - entry.index + 1;
    return count;
}

nlohmann::json report_of(const ArchiveReader& archive, const Verification& found) {
    return {{"finished", archive.finished()},   {"ok", found.problems.empty()}, {"intact", found.intact},
            {"missing", missing_json(archive)}, {"problems", found.problems},   {"notes", found.notes}};
}

// The number of problems.
Result<size_t> run(const std::string& path, bool deep, bool as_json) {
    const auto archive = ArchiveReader::open(path);
    if (!archive) return archive.error();
    const Verification found = archive->verify(deep);
    if (as_json) {
        print_json(report_of(*archive, found));
        return found.problems.size();
    }
    for (const auto& file : found.intact) fmt::print("ok       {}\n", file);
    for (const auto& entry : archive->targets())
        if (entry.file.empty())
            fmt::print("missing  camera {} {}: {}\n", entry.camera, target_words(entry), entry.why_missing);
    for (const auto& problem : found.problems) fmt::print("problem  {}\n", problem);
    for (const auto& note : found.notes) fmt::print("note     {}\n", note);
    fmt::print("{}: {} targets intact, {} missing, {} problems\n", path, found.intact.size(), count_missing(*archive),
               found.problems.size());
    return found.problems.size();
}

}  // namespace

void add_verify_verb(CLI::App& app, int& exit_code) {
    struct Options {
        std::string archive;
        bool deep = false, json = false;
    };
    auto options = std::make_shared<Options>();
    CLI::App* verb = app.add_subcommand("verify", "check every file of an archive against its journal");
    verb->footer(
        "Example: rf verify take.rfa\n"
        "Exit code 0: finished, and every file is as it was written. 1: problems, each named; targets listed as ok are "
        "whole even so. Notes say what an archive of an older version does not let be checked. Targets that the "
        "recording itself noted as missing are no problem of the archive.");
    verb->add_option("archive", options->archive, "take.rfa")->required();
    verb->add_flag("--deep", options->deep,
                   "decode every sample, too: slower, and finds what was wrong before it was noted");
    verb->add_flag("--json", options->json, "print JSON");
    verb->callback([options, &exit_code] {
        const auto problems = run(options->archive, options->deep, options->json);
        if (!problems) fmt::print(stderr, "rf verify: {}\n", problems.error().message);
        if (!problems || *problems > 0) exit_code = 1;
    });
}

}  // namespace ols

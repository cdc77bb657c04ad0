// SPDX-License-Identifier: MIT
// rf info: what is in an archive.
#include <fmt/format.h>

#include <memory>

#include "archive/archive.hpp"
#include "image/json_object.hpp"
#include "program.hpp"
#include "verbs.hpp"

namespace ols {

namespace {

using nlohmann::json;

constexpr const char* cfa_words[] = {"monochrome", "RGGB mosaic", "BGGR mosaic", "GRBG mosaic", "GBRG mosaic", "RGB"};

json target_report(const ArchiveReader& archive, const TargetEntry& entry) {
    json report = {{"camera", entry.camera}, {"index", entry.index}};
    if (entry.last > entry.index) report["through"] = entry.last;
    if (entry.file.empty()) {
        report["missing"] = entry.why_missing;
        return report;
    }
    report["file"] = entry.file;
    report["bytes"] = entry.bytes;
    const auto head = archive.read_head(entry.camera, entry.index);
    if (!head) {
        report["damaged"] = head.error().message;
        return report;
    }
    report["width"] = head->width;
    report["height"] = head->height;
    report["pixels"] = cfa_words[int(head->cfa)];
    report["missing_lamps"] = head->missing_lamps;
    report["provenance"] = head->provenance;
    report["motion_times_s"] = head->motion.times_s;
    report["matte_frames"] = head->matte.frames;
    return report;
}

json archive_report(const ArchiveReader& archive, const std::string& path) {
    json report = archive.manifest();
    report["path"] = path;
    report["finished"] = archive.finished();
    report["being_written"] = archive.being_written();
    report["lamps"] = archive.info().lights.size();
    report["targets"] = json::array();
    for (const auto& entry : archive.targets()) report["targets"].push_back(target_report(archive, entry));
    for (TargetEntry run : archive.undecided()) {
        run.why_missing = archive.being_written() ? "to come" : "never finished: the recording was interrupted";
        report["targets"].push_back(target_report(archive, run));
    }
    return report;
}

std::string target_line(const json& target) {
    TargetEntry entry;
    entry.index = target["index"], entry.last = target.value("through", entry.index);
    const auto name = fmt::format("camera {} {}", target["camera"].get<uint32_t>(), target_words(entry));
    if (target.contains("missing")) return name + ": missing: " + target["missing"].get<std::string>();
    if (target.contains("damaged")) return name + ": damaged: " + target["damaged"].get<std::string>();
    auto line = fmt::format("{}: {} x {}, {}, {:.1f} MB", name, target["width"].get<int>(), target["height"].get<int>(),
                            target["pixels"].get<std::string>(), target["bytes"].get<double>() / 1e6);
    if (const int frames = target["matte_frames"]; frames > 0) line += fmt::format(", matte of {} frames", frames);
    if (const auto& times = target["motion_times_s"]; !times.empty())
        line += fmt::format(", motion at {} instants from {:+.1f} to {:+.1f} ms", times.size(),
                            times.front().get<double>() * 1e3, times.back().get<double>() * 1e3);
    if (const auto& lamps = target["missing_lamps"]; !lamps.empty())
        line += fmt::format(", {} lamps missing: {}", lamps.size(), lamps.dump());
    return line;
}

// `extra` is what a take chose to say: what is of another kind than expected is shown as it is.
std::string basis_line(const json& basis) {
    const auto shown = [&](const char* key) { return json_line(basis.value(key, json())); };
    const json condition = basis.value("condition", json());
    return fmt::format("{} rows over {} lamps, rank {}, condition {}{}", shown("rows"), shown("lamps"), shown("rank"),
                       condition.is_number() ? fmt::format("{:.4g}", condition.get<double>()) : shown("condition"),
                       basis.value("is_estimate", json()) == true
                           ? "; fewer independent rows than lamps: the values are an ESTIMATE"
                           : "");
}

void print_report(const json& report, const TakeInfo& info) {
    fmt::print("{}: {}\n", report["path"].get<std::string>(),
               report["finished"]        ? "finished"
               : report["being_written"] ? "being recorded"
                                         : "NOT FINISHED: the recording was interrupted, see rf verify");
    fmt::print("  lamps      {}{}\n", info.lights.size(),
               info.basis.empty() ? ", photographed one by one" : ", basis " + info.basis);
    if (const json& basis = info.extra.value("basis", json()); basis.is_object())
        fmt::print("  basis      {}\n", basis_line(basis));
    fmt::print("  values     {}, {} float, scene-linear, color {}\n",
               info.value_unit == "reflectance" ? "r = pi L / E (a white surface facing the lamp is 1)"
                                                : "pixel values (full scale is 1)",
               report["sample_type"].get<std::string>(), info.color_interop_id);
    const auto line = [](const char* label, const std::string& text) {
        if (!text.empty()) fmt::print("  {:<10} {}\n", label, text);
    };
    line("production", info.production);
    line("scene", info.scene);
    line("take", info.take);
    line("notes", info.notes);
    line("timecode", info.timecode_start);
    fmt::print("  frame rate {:g} Hz\n", info.frame_rate_hz);
    for (const auto& target : report["targets"]) fmt::print("  {}\n", target_line(target));
}

Status run(const std::string& path, bool as_json) {
    const auto archive = ArchiveReader::open(path);
    if (!archive) return archive.error();
    for (const auto& problem : archive->journal_problems()) fmt::print(stderr, "rf info: {}\n", problem);
    const json report = archive_report(*archive, path);
    if (as_json)
        print_json(report);
    else
        print_report(report, archive->info());
    return Done{};
}

}  // namespace

void add_info_verb(CLI::App& app, int& exit_code) {
    struct Options {
        std::string archive;
        bool json = false;
    };
    auto options = std::make_shared<Options>();
    CLI::App* verb = app.add_subcommand("info", "say what is in an archive");
    verb->footer("Example: rf info take.rfa --json");
    verb->add_option("archive", options->archive, "take.rfa")->required();
    verb->add_flag("--json", options->json, "print the manifest and the targets as JSON");
    verb->callback([options, &exit_code] {
        const auto status = run(options->archive, options->json);
        if (status) return;
        fmt::print(stderr, "rf info: {}\n", status.error().message);
        exit_code = 1;
    });
}

}  // namespace ols

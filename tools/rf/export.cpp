// SPDX-License-Identifier: MIT
// rf export: the lamp images of a target as ordinary pictures with an .lp file, and a contact sheet of them.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <memory>

#include "archive/archive.hpp"
#include "archive_option.hpp"
#include "contact_sheet.hpp"
#include "image/exr.hpp"
#include "image/outputs.hpp"
#include "image/png.hpp"
#include "image/tone.hpp"
#include "image/whole_file.hpp"
#include "lamp_images.hpp"
#include "program.hpp"
#include "target_choice.hpp"
#include "verbs.hpp"

namespace ols {

namespace {

namespace fs = std::filesystem;

struct Options {
    ArchiveOption archive;
    std::string output, format = "exr", contact_sheet;
    TargetOptions targets;
    double exposure_ev = 0;
    bool json = false;
};

// 8-bit sRGB without a tone curve, so that what reads the PNG gets linear values back; beyond 0 .. 1 it is clipped.
std::vector<uint8_t> srgb8(const Image& rgb, double exposure_ev) {
    const float gain = float(std::exp2(exposure_ev));
    std::vector<uint8_t> out;
    out.reserve(rgb.data.size());
    for (const float v : rgb.data) {
        const float shown = std::isnan(v) ? 0 : std::clamp(v * gain, 0.0f, 1.0f);
        out.push_back(uint8_t(std::lround(255 * srgb_encode(shown))));
    }
    return out;
}

Status write_lamp(const fs::path& path, const Image& rgb, const TakeInfo& info, const Options& options) {
    if (options.format == "png")
        return write_png(path.string(), rgb.width, rgb.height, srgb8(rgb, options.exposure_ev));
    Image exposed = rgb;
    for (float& v : exposed.data) v *= float(std::exp2(options.exposure_ev));
    return write_exr(path.string(), exposed, ExrType::half_float, {{"colorInteropID", info.color_interop_id}});
}

// What is made of one target.
struct Export {
    const ArchiveReader& archive;
    const TargetEntry& entry;
    const Options& options;
    std::string folder = folder_of_target(options.output, entry, options.targets);
    std::string sheet = file_of_target(options.contact_sheet, entry, options.targets);
    std::vector<LightPosition> written = {};  // names of pictures
    ContactSheet::Picture picture = {};       // the contact sheet's

    Status write() {
        if (folder.empty()) return write_to("");
        return make_whole_folder(folder, [this](const std::string& temporary) { return write_to(temporary); });
    }

    // Pictures go to that folder; nowhere if it is empty.
    Status write_to(const std::string& pictures) {
        const auto target = options.archive.open_target(archive, entry);
        if (!target) return target.error();
        const auto& lights = archive.info().lights;
        ContactSheet contact(lights, target->head().width, target->head().height);
        const auto visited =
            for_each_lamp_image(*target, int(lights.size()), [&](int lamp, const Image& rgb) -> Status {
                if (!sheet.empty()) contact.add(lamp, rgb);
                if (pictures.empty()) return Done{};
                const std::string name = lamp_layer(lamp, int(lights.size())) + "." + options.format;
                written.push_back({name, lights[lamp].direction});
                return write_lamp(fs::path(pictures) / name, rgb, archive.info(), options);
            });
        if (!visited) return visited;
        if (!pictures.empty())
            if (auto s = write_lp((fs::path(pictures) / "lights.lp").string(), written); !s) return s;
        return sheet.empty() ? Status(Done{}) : write_sheet(contact);
    }

    Status write_sheet(const ContactSheet& contact) {
        const auto title = fmt::format("{}   camera {}   target {}   {} lamps, from the top down; front in the middle",
                                       fs::path(options.archive.path).lexically_normal().filename().string(),
                                       entry.camera, entry.index, archive.info().lights.size());
        picture = contact.picture(title, options.exposure_ev);
        return write_png(sheet, picture.width, picture.height, picture.rgb8);
    }

    void print() const {
        if (!sheet.empty())
            fmt::print("{}: {} x {}, values times {:.4g}, then {}\n", sheet, picture.width, picture.height,
                       picture.gain, tone_curve_text);
        if (!folder.empty()) fmt::print("{}: {} pictures and lights.lp\n", folder, written.size());
    }

    nlohmann::json report() const {
        nlohmann::json report = {{"camera", entry.camera}, {"target", entry.index}};
        if (!folder.empty()) report["output"] = folder, report["pictures"] = written.size();
        if (!sheet.empty()) report["contact_sheet"] = sheet, report["contact_sheet_gain"] = picture.gain;
        return report;
    }
};

Status check_places(const Options& options, const std::vector<TargetEntry>& targets) {
    Outputs outputs{.inputs = {options.archive.path}};
    for (const auto& entry : targets) {
        outputs.png.push_back(file_of_target(options.contact_sheet, entry, options.targets));
        outputs.folders.push_back(folder_of_target(options.output, entry, options.targets));
    }
    return check_outputs(outputs);
}

Status run(const Options& options) {
    if (options.output.empty() && options.contact_sheet.empty())
        return fail("nothing to do: give a folder with -o, or --contact-sheet");
    const auto archive = options.archive.open("rf export");
    if (!archive) return archive.error();
    const auto targets = choose_targets(*archive, options.archive.path, options.targets);
    if (!targets) return targets.error();
    if (const auto writable = check_places(options, targets->finished); !writable) return writable;
    if (const auto warning = targets->warning(); !warning.empty()) fmt::print(stderr, "rf export: {}\n", warning);
    nlohmann::json report = {{"archive", options.archive.path}, {"missing_targets", targets->missing_json()}};
    for (const auto& entry : targets->finished) {
        Export exporting{*archive, entry, options};
        if (const auto done = exporting.write(); !done) return done;
        report["targets"].push_back(exporting.report());
        if (!options.json) exporting.print();
    }
    if (options.json) print_json(report);
    return Done{};
}

}  // namespace

void add_export_verb(CLI::App& app, int& exit_code) {
    auto options = std::make_shared<Options>();
    CLI::App* verb = app.add_subcommand("export", "write a target's lamp images as pictures, or a contact sheet");
    verb->footer(
        "Example: rf export take.rfa -o lamps --contact-sheet sheet.png\n"
        "         rf export performance.rfa --target all -o lamps     # lamps_000000, lamps_000001 ...\n"
        "Pictures are R G B: mosaics are demosaiced. EXR is scene-linear half float; PNG is 8-bit sRGB of the linear "
        "values times 2^EV, clipped to 0..1. lights.lp lists the pictures by name.");
    options->archive.add_to(*verb);
    verb->add_option("-o,--output", options->output, "folder to make");
    verb->add_option("--format", options->format, "exr or png")->check(CLI::IsMember({"exr", "png"}));
    options->targets.add_to(*verb);
    verb->add_option("--exposure", options->exposure_ev, "stops to brighten by")->type_name("EV");
    verb->add_option("--contact-sheet", options->contact_sheet,
                     "PNG of all lamp images, cut to the subject, placed as the lamps hang");
    verb->add_flag("--json", options->json, "print a JSON report");
    verb->callback([options, &exit_code] {
        const auto status = run(*options);
        if (status) return;
        fmt::print(stderr, "rf export: {}\n", status.error().message);
        exit_code = 1;
    });
}

}  // namespace ols

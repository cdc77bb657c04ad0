// SPDX-License-Identifier: MIT
// rf export: the lamp images of a target as ordinary pictures with an .lp file, and a contact sheet of them.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <memory>

#include "archive/archive.hpp"
#include "contact_sheet.hpp"
#include "image/exr.hpp"
#include "image/png.hpp"
#include "image/tone.hpp"
#include "lamp_images.hpp"
#include "verbs.hpp"

namespace ols {

namespace {

namespace fs = std::filesystem;

struct Options {
    std::string archive, output, format = "exr", contact_sheet;
    int64_t target = -1;  // -1: the first finished one
    uint32_t camera = 0;
    double exposure_ev = 0;
};

Result<TargetEntry> chosen_target(const ArchiveReader& archive, const Options& options) {
    for (const auto& entry : archive.targets())
        if (!entry.file.empty() && entry.camera == options.camera &&
            (options.target < 0 || entry.index == uint64_t(options.target)))
            return entry;
    return fail(fmt::format("'{}' has no such finished target of camera {}: rf info lists what there is",
                            options.archive, options.camera));
}

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

// Pictures go to a directory under a temporary name, which gets its own when all is there.
struct Export {
    const ArchiveReader& archive;
    const Options& options;
    fs::path unfinished;                      // empty: no pictures are asked for
    std::vector<LightPosition> written = {};  // names of pictures

    Status write(const TargetEntry& entry) {
        const auto head = archive.read_head(entry.camera, entry.index);
        if (!head) return head.error();
        const auto& lights = archive.info().lights;
        ContactSheet sheet(lights, head->width, head->height);
        const auto visited = for_each_lamp_image(archive, entry, [&](int lamp, const Image& rgb) -> Status {
            if (!options.contact_sheet.empty()) sheet.add(lamp, rgb);
            if (unfinished.empty()) return Done{};
            const std::string name = lamp_layer(lamp, int(lights.size())) + "." + options.format;
            written.push_back({name, lights[lamp].direction});
            return write_lamp(unfinished / name, rgb, archive.info(), options);
        });
        if (!visited) return visited;
        if (!unfinished.empty())
            if (auto s = write_lp((unfinished / "lights.lp").string(), written); !s) return s;
        return options.contact_sheet.empty() ? Status(Done{}) : write_sheet(sheet, entry);
    }

    Status write_sheet(const ContactSheet& sheet, const TargetEntry& entry) {
        const auto title = fmt::format("{}   camera {}   target {}   {} lamps, from the top down; front in the middle",
                                       fs::path(options.archive).lexically_normal().filename().string(), entry.camera,
                                       entry.index, archive.info().lights.size());
        const auto picture = sheet.picture(title, options.exposure_ev);
        if (auto s = write_png(options.contact_sheet, picture.width, picture.height, picture.rgb8); !s) return s;
        fmt::print("{}: {} x {}, values times {:.4g}, then {}\n", options.contact_sheet, picture.width, picture.height,
                   picture.gain, tone_curve_text);
        return Done{};
    }
};

Status run(const Options& options) {
    if (options.output.empty() && options.contact_sheet.empty())
        return fail("nothing to do: give a directory with -o, or --contact-sheet");
    const auto archive = ArchiveReader::open(options.archive);
    if (!archive) return archive.error();
    const auto entry = chosen_target(*archive, options);
    if (!entry) return entry.error();

    fs::path directory = fs::path(options.output).lexically_normal(), unfinished;
    std::error_code error;
    if (!options.output.empty()) {
        if (!directory.has_filename()) directory = directory.parent_path();
        if (fs::exists(directory, error)) return fail("'" + directory.string() + "' exists: choose a new directory");
        unfinished = directory.string() + ".part";
        fs::remove_all(unfinished, error);
        if (!fs::create_directory(unfinished, error))
            return fail("cannot make '" + unfinished.string() + "': " + error.message());
    }
    Export exporting{*archive, options, unfinished};
    Status done = exporting.write(*entry);
    if (unfinished.empty()) return done;
    if (done) {
        fs::rename(unfinished, directory, error);
        if (error) done = fail("cannot make '" + directory.string() + "': " + error.message());
    }
    if (!done) fs::remove_all(unfinished, error);
    if (done) fmt::print("{}: {} pictures and lights.lp\n", directory.string(), exporting.written.size());
    return done;
}

}  // namespace

void add_export_verb(CLI::App& app, int& exit_code) {
    auto options = std::make_shared<Options>();
    CLI::App* verb = app.add_subcommand("export", "write a target's lamp images as pictures, or a contact sheet");
    verb->footer(
        "Example: rf export take.rfa -o lamps --contact-sheet sheet.png\n"
        "Pictures are R G B: mosaics are demosaiced. EXR is scene-linear half float; PNG is 8-bit sRGB of the linear "
        "values times 2^EV, clipped to 0..1. lights.lp lists the pictures by name.");
    verb->add_option("archive", options->archive, "take.rfa")->required();
    verb->add_option("-o,--output", options->output, "directory to make");
    verb->add_option("--format", options->format, "exr or png")->check(CLI::IsMember({"exr", "png"}));
    verb->add_option("--target", options->target, "number of the target (default: the first finished one)")
        ->check(CLI::NonNegativeNumber)
        ->type_name("N");
    verb->add_option("--camera", options->camera, "camera of the target")->type_name("N");
    verb->add_option("--exposure", options->exposure_ev, "stops to brighten by")->type_name("EV");
    verb->add_option("--contact-sheet", options->contact_sheet,
                     "PNG of all lamp images, cut to the subject, placed as the lamps hang");
    verb->callback([options, &exit_code] {
        const auto status = run(*options);
        if (status) return;
        fmt::print(stderr, "rf export: {}\n", status.error().message);
        exit_code = 1;
    });
}

}  // namespace ols

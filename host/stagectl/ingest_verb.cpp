// SPDX-License-Identifier: MIT
// stagectl ingest: a folder of photographs and an .lp file become an archive.
#include "photographs/ingest.hpp"

#include <fmt/format.h>
#include <unistd.h>

#include <map>
#include <memory>
#include <nlohmann/json.hpp>

#include "program.hpp"
#include "stagectl/verbs.hpp"

namespace ols {

namespace {

struct Options {
    IngestOptions ingest;
    bool json = false;
};

void show_progress(int done, int total) {
    std::fprintf(stderr, "\rreading pictures %d/%d%s", done, total, done == total ? "\n" : "");
}

Status run(Options& options) {
    if (isatty(STDERR_FILENO)) options.ingest.progress = show_progress;
    const auto report = ingest(options.ingest);
    if (!report) return report.error();
    if (options.json) {
        print_json({{"output", options.ingest.output},
                    {"lamps", report->lamps},
                    {"width", report->width},
                    {"height", report->height},
                    {"color", report->cfa == Cfa::rgb},
                    {"mosaic", is_mosaic(report->cfa)},
                    {"said", report->said},
                    {"unused", report->unused}});
        return Done{};
    }
    for (const auto& text : report->said) fmt::print(stderr, "{}\n", text);
    fmt::print("{}: {} lamps, {} x {}, {}\n", options.ingest.output, report->lamps, report->width, report->height,
               is_mosaic(report->cfa)    ? "mosaic"
               : report->cfa == Cfa::rgb ? "RGB"
                                         : "grey");
    if (!report->unused.empty())
        fmt::print("{} pictures of the folder are not in the .lp file and were not used, '{}' the first\n",
                   report->unused.size(), report->unused.front());
    return Done{};
}

}  // namespace

void add_ingest_verb(CLI::App& app, int& exit_code) {
    auto options = std::make_shared<Options>();
    IngestOptions& ingest = options->ingest;
    CLI::App* verb = app.add_subcommand("ingest", "make an archive from photographs, one a lamp, and an .lp file");
    verb->footer(
        "Example: stagectl ingest photos/ --lights photos/lights.lp -o take.rfa\n"
        "PNG, JPEG, TIFF, BMP, TGA, WebP, HEIC, AVIF, PNM, OpenEXR, Radiance and camera RAW, all of one size. Values "
        "are stored as "
        "linear light, full scale 1. What is converted, assumed or left out is said. On any error nothing is written.");
    verb->add_option("folder", ingest.directory, "folder of the pictures")->required();
    verb->add_option("--lights", ingest.lights, ".lp file: the count, then `picture x y z` a line, in any order")
        ->required();
    verb->add_option("-o,--output", ingest.output, "archive to make (take.rfa)")->required();
    verb->add_option("--mask", ingest.mask, "picture that is white, 1 or opaque where the subject is");
    verb->add_option(
        "--intensities", ingest.intensities,
        "text file: how bright each light was (one number or R G B a line); its picture is divided by that");
    const std::map<std::string, Transfer> transfers = {{"srgb", Transfer::srgb}, {"linear", Transfer::linear}};
    verb->add_option("--transfer", ingest.picture.transfer,
                     "how values are coded (default: as the file says, else integers srgb, floats linear)")
        ->transform(CLI::CheckedTransformer(transfers).description(""))
        ->type_name("srgb|linear");
    verb->add_option("--full-scale", ingest.picture.full_scale,
                     "value that is 1 (default: the largest of the file's bits; 4095 for 12 bits in 16)")
        ->check(CLI::Range(1e-6, 1e12));
    const std::map<std::string, RawUse> raw_uses = {{"mosaic", RawUse::mosaic}, {"rgb", RawUse::rgb}};
    verb->add_option("--raw", ingest.picture.raw,
                     "take camera RAW as the sensor's mosaic, or demosaiced to linear R G B")
        ->transform(CLI::CheckedTransformer(raw_uses).description(""))
        ->type_name("mosaic|rgb");
    verb->add_option("--page", ingest.picture.page, "page of files with several, from 1")->check(CLI::Range(1, 10000));
    const std::map<std::string, bool> orientations = {{"apply", true}, {"ignore", false}};
    verb->add_option("--orientation", ingest.picture.turn,
                     "turn and mirror pictures as they say (default), or take them as they lie")
        ->transform(CLI::CheckedTransformer(orientations).description(""))
        ->type_name("apply|ignore");
    verb->add_flag_callback(
        "--float", [&ingest] { ingest.sample_type = SampleType::single_float; }, "32-bit samples, not 16-bit halves");
    verb->add_flag_callback(
        "--zips", [&ingest] { ingest.compression = Compression::zips; }, "compress without loss");
    verb->add_option("--production", ingest.production, "slate: production");
    verb->add_option("--scene", ingest.scene, "slate: scene");
    verb->add_option("--take", ingest.take, "slate: take");
    verb->add_option("--notes", ingest.notes, "slate: notes");
    verb->add_flag("--overwrite", ingest.overwrite, "replace an archive of this name");
    verb->add_flag("--json", options->json, "print a JSON report");
    verb->callback([options, &exit_code] {
        const auto status = run(*options);
        if (status) return;
        fmt::print(stderr, "stagectl ingest: {}\n", status.error().message);
        exit_code = 1;
    });
}

}  // namespace ols

// SPDX-License-Identifier: MIT
// stagectl-ingest, which `stagectl ingest` becomes: a folder of photographs and an .lp file, or a recording and its sequence, become an
// archive. The libraries that read pictures take longer to load than most verbs of stagectl to run.
#include "photographs/ingest.hpp"

#include <fmt/format.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <map>
#include <nlohmann/json.hpp>

#include "image/freed_planes.hpp"
#include "ingest/recording_verb.hpp"
#include "program.hpp"

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

void add_options(CLI::App& app, Options& options) {
    IngestOptions& ingest = options.ingest;
    app.footer(
        "Example: stagectl ingest photos/ --lights photos/lights.lp -o take.rfa\n"
        "PNG, JPEG, TIFF, BMP, TGA, WebP, HEIC, AVIF, PNM, OpenEXR, Radiance and camera RAW, all of one size. Values "
        "are stored as "
        "linear light, full scale 1. What is converted, assumed or left out is said. On any error nothing is written.");
    app.add_option("folder", ingest.directory, "folder of the pictures")->required();
    app.add_option("--lights", ingest.lights, ".lp file: the count, then `picture x y z` a line, in any order")
        ->required();
    app.add_option("-o,--output", ingest.output, "archive to make (take.rfa)")->required();
    app.add_option("--mask", ingest.mask, "picture that is white, 1 or opaque where the subject is");
    app.add_option("--intensities", ingest.intensities,
                   "text file: how bright each light was (one number or R G B a line); its picture is divided by that");
    const std::map<std::string, Transfer> transfers = {{"srgb", Transfer::srgb}, {"linear", Transfer::linear}};
    app.add_option("--transfer", ingest.picture.transfer,
                   "how values are coded (default: as the file says, else integers srgb, floats linear)")
        ->transform(CLI::CheckedTransformer(transfers).description(""))
        ->type_name("srgb|linear");
    app.add_option("--full-scale", ingest.picture.full_scale,
                   "value that is 1 (default: the largest of the file's bits; 4095 for 12 bits in 16)")
        ->check(CLI::Range(1e-6, 1e12));
    const std::map<std::string, RawUse> raw_uses = {{"mosaic", RawUse::mosaic}, {"rgb", RawUse::rgb}};
    app.add_option("--raw", ingest.picture.raw, "take camera RAW as the sensor's mosaic, or demosaiced to linear R G B")
        ->transform(CLI::CheckedTransformer(raw_uses).description(""))
        ->type_name("mosaic|rgb");
    app.add_option("--page", ingest.picture.page, "page of files with several, from 1")->check(CLI::Range(1, 10000));
    const std::map<std::string, bool> orientations = {{"apply", true}, {"ignore", false}};
    app.add_option("--orientation", ingest.picture.turn,
                   "turn and mirror pictures as they say (default), or take them as they lie")
        ->transform(CLI::CheckedTransformer(orientations).description(""))
        ->type_name("apply|ignore");
    app.add_flag_callback(
        "--float", [&ingest] { ingest.sample_type = SampleType::single_float; }, "32-bit samples, not 16-bit halves");
    app.add_flag_callback(
        "--zips", [&ingest] { ingest.compression = Compression::zips; }, "compress without loss");
    app.add_option("--production", ingest.production, "slate: production");
    app.add_option("--scene", ingest.scene, "slate: scene");
    app.add_option("--take", ingest.take, "slate: take");
    app.add_option("--notes", ingest.notes, "slate: notes");
    app.add_flag("--overwrite", ingest.overwrite, "replace an archive of this name");
    app.add_flag("--json", options.json, "print a JSON report");
}

}  // namespace

}  // namespace ols

int main(int argc, char** argv) {
    ols::keep_freed_planes();  // pictures are of one size
    int exit_code = 0;
    CLI::App recordings;
    recordings.name("stagectl ingest");
    ols::add_recording_options(recordings, exit_code);
    if (ols::is_recording(argc, argv)) return ols::run_program(recordings, argc, argv, exit_code);
    CLI::App app{
        "make an archive from photographs, one a lamp, and an .lp file; or from a recording (--sequence, below)"};
    app.name("stagectl ingest");
    ols::Options options;
    ols::add_options(app, options);
    app.footer(app.get_footer() + "\n\n" + recordings.help());
    app.callback([&] {
        const auto status = ols::run(options);
        if (status) return;
        fmt::print(stderr, "stagectl ingest: {}\n", status.error().message);
        exit_code = 1;
    });
    return ols::run_program(app, argc, argv, exit_code);
}

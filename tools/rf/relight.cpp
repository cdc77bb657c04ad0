// SPDX-License-Identifier: MIT
// rf relight: the subject of an archive under an environment map and point lights.
#include "relight/relight.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <memory>

#include "archive/archive.hpp"
#include "archive_option.hpp"
#include "image/demosaic.hpp"
#include "image/exr.hpp"
#include "image/outputs.hpp"
#include "image/png.hpp"
#include "image/tone.hpp"
#include "lighting.hpp"
#include "mask_counts.hpp"
#include "program.hpp"
#include "shutter.hpp"
#include "target_choice.hpp"
#include "verbs.hpp"

namespace ols {

namespace {

struct Options {
    ArchiveOption archive;
    std::string output, png;
    TargetOptions targets;
    LightingOptions lighting;
    ShutterOptions shutter;
    int threads = 0;
    bool single_float = false, json = false;
};

struct RelitTarget {
    Image image;  // R G B A, premultiplied; alpha is 0 outside the take's mask
    MaskCounts masked;
    size_t left_out_samples = 0;
    std::vector<int> missing_lamps;
};

Image with_alpha(const Image& rgb, const std::vector<uint32_t>& mask) {
    Image rgba(rgb.width, rgb.height, 4);
    for (size_t i = 0; i < mask.size(); ++i) {
        if (mask[i] & mask_outside) continue;
        std::copy_n(&rgb.data[i * 3], 3, &rgba.data[i * 4]);
        rgba.data[i * 4 + 3] = 1;
    }
    return rgba;
}

// Reads the target in strips, so that takes of any size can be relit.
Result<RelitTarget> relight_target(const TargetReader& target, const std::string& file, const LampWeights& weights,
                                   int threads) {
    const Target& head = target.head();
    RelitTarget relit;
    relit.missing_lamps = head.missing_lamps;
    Image sum;
    std::vector<uint32_t> mask;
    const int rows = target.strip_rows();
    for (int y = 0; y < head.height; y += rows) {
        const Box box = {0, y, head.width, std::min(rows, head.height - y)};
        const auto strip = target.read_box(box);
        if (!strip) return strip.error();
        auto lit = relight({box.width, box.height, strip->cfa, strip->lamps}, weights, threads);
        if (!lit) return fail(fmt::format("'{}': {}", file, lit.error().message));
        if (sum.data.empty()) sum = Image(head.width, head.height, lit->image.channels);
        std::copy(lit->image.data.begin(), lit->image.data.end(),
                  sum.data.begin() + std::ptrdiff_t(y) * head.width * sum.channels);
        mask.insert(mask.end(), strip->mask.begin(), strip->mask.end());
        for (size_t samples : lit->left_out_samples) relit.left_out_samples += samples;
    }
    mask.resize(size_t(head.width) * head.height);
    relit.masked.add(mask);
    relit.image = with_alpha(as_rgb(sum, head.cfa), mask);
    return relit;
}

// Half floats end at 65504; what is brighter is written as that.
size_t values_beyond_half(const Image& image) {
    constexpr float largest_half = 65504;
    return size_t(
        std::count_if(image.data.begin(), image.data.end(), [](float v) { return std::abs(v) > largest_half; }));
}

std::map<std::string, std::string> header_attributes(const TakeInfo& info, const Options& options) {
    std::map<std::string, std::string> attributes = {
        {"colorInteropID", info.color_interop_id},
        {"production", info.production},
        {"scene", info.scene},
        {"take", info.take},
        {"relit.valueUnit", info.value_unit},
        {"relit.environment", std::filesystem::path(options.lighting.environment).filename().string()},
        {"relit.rotateDegrees", fmt::format("{}", options.lighting.rotate_deg)},
        {"relit.exposureEV", fmt::format("{}", options.lighting.exposure_ev)}};
    if (options.shutter.is_open()) attributes.merge(options.shutter.header_attributes());
    return attributes;
}

void warn(const RelitTarget& relit, const std::string& file, double light_missing, size_t clamped_values) {
    for (const auto& warning : relit.masked.warnings()) fmt::print(stderr, "rf relight: {}: {}\n", file, warning);
    if (!relit.missing_lamps.empty())
        fmt::print(stderr, "rf relight: {}: {} lamps are missing, and with them {:.2f} % of the light\n", file,
                   relit.missing_lamps.size(), 100 * light_missing);
    if (relit.left_out_samples > 0)
        fmt::print(stderr, "rf relight: {}: {} samples are NaN or Inf and were left out\n", file,
                   relit.left_out_samples);
    if (clamped_values > 0)
        fmt::print(stderr,
                   "rf relight: {}: {} values are beyond 65504, the largest half: lower --exposure or add --float\n",
                   file, clamped_values);
}

Result<nlohmann::json> relight_and_write(const ArchiveReader& archive, const TargetEntry& entry,
                                         const Lighting& lighting, const Options& options) {
    const auto target = options.archive.open_target(archive, entry);
    if (!target) return target.error();
    auto relit = relight_target(*target, entry.file, lighting.weights, options.threads);
    if (!relit) return relit.error();
    nlohmann::json shutter;
    if (options.shutter.is_open()) {
        auto blurred = through_shutter(*target, entry.file, archive.info().frame_rate_hz, relit->image, options.shutter,
                                       options.threads);
        if (!blurred) return blurred.error();
        for (const auto& warning : shutter_warnings(*blurred))
            fmt::print(stderr, "rf relight: {}: {}\n", entry.file, warning);
        shutter = shutter_report(options.shutter, *blurred);
        relit->image = std::move(blurred->image);
    }
    const double light_missing = share_of_light(lighting.weights, relit->missing_lamps);
    const size_t clamped_values = options.single_float ? 0 : values_beyond_half(relit->image);
    warn(*relit, entry.file, light_missing, clamped_values);
    const auto output = file_of_target(options.output, entry, options.targets);
    const auto png = file_of_target(options.png, entry, options.targets);
    const auto written =
        write_exr(output, relit->image, options.single_float ? ExrType::single_float : ExrType::half_float,
                  header_attributes(archive.info(), options));
    if (!written) return written.error();
    if (!png.empty()) {
        const auto shown = write_png_preview(png, relit->image);
        if (!shown) return shown.error();
    }
    return nlohmann::json{{"camera", entry.camera},
                          {"target", entry.index},
                          {"output", output},
                          {"png", png},
                          {"missing_lamps", relit->missing_lamps},
                          {"missing_light", light_missing},
                          {"left_out_samples", relit->left_out_samples},
                          {"clamped_values", clamped_values},
                          {"shutter", shutter},
                          {"masked_pixels", relit->masked.report()}};
}

Status check_files(const Options& options, const std::vector<TargetEntry>& targets) {
    Outputs outputs{.inputs = {options.archive.path, options.lighting.environment}};
    for (const auto& entry : targets) {
        outputs.exr.push_back(file_of_target(options.output, entry, options.targets));
        outputs.png.push_back(file_of_target(options.png, entry, options.targets));
    }
    return check_outputs(outputs);
}

Status run(const Options& options) {
    const auto archive = options.archive.open("rf relight");
    if (!archive) return archive.error();
    const auto cells = cells_of_lights(archive->info().lights);
    if (!cells) return fail("'" + options.archive.path + "': " + cells.error().message);
    const auto targets = choose_targets(*archive, options.archive.path, options.targets);
    if (!targets) return targets.error();
    if (const auto writable = check_files(options, targets->finished); !writable) return writable;
    if (options.shutter.is_open())
        if (const auto known = check_motion_known(*archive, options.archive.path, targets->finished); !known)
            return known;
    const auto lighting = make_lighting(options.lighting, *cells);
    if (!lighting) return lighting.error();
    for (const auto& warning : lighting->warnings) fmt::print(stderr, "rf relight: {}\n", warning);
    if (const auto warning = targets->warning(); !warning.empty()) fmt::print(stderr, "rf relight: {}\n", warning);
    nlohmann::json report = lighting->report;
    report["archive"] = options.archive.path;
    report["lamps"] = cells->size();
    report["missing_targets"] = targets->missing_json();
    for (const auto& entry : targets->finished) {
        const auto done = relight_and_write(*archive, entry, *lighting, options);
        if (!done) return done.error();
        report["targets"].push_back(*done);
        if (!options.json) fmt::print("{}\n", (*done)["output"].get<std::string>());
    }
    if (options.json) print_json(report);
    return Done{};
}

}  // namespace

void add_relight_verb(CLI::App& app, int& exit_code) {
    auto options = std::make_shared<Options>();
    CLI::App* verb = app.add_subcommand("relight", "show a take's subject under other light");
    verb->footer(
        fmt::format("Example: rf relight take.rfa --env sunset.exr --rotate 90 -o relit.exr --png relit.png\n"
                    "The OpenEXR file is scene-linear; a white surface under radiance 1 from everywhere is 1.\n"
                    "The PNG's tone curve: {}.",
                    tone_curve_text));
    options->archive.add_to(*verb);
    options->lighting.add_to(*verb);
    options->shutter.add_to(*verb);
    options->targets.add_to(*verb);
    verb->add_option("-o,--output", options->output, "OpenEXR file to write (.exr; R G B A)")->required();
    verb->add_option("--png", options->png, "8-bit preview to write (.png)");
    verb->add_flag("--float", options->single_float, "32-bit samples instead of 16-bit halves");
    verb->add_option("--threads", options->threads, "0: one a core; the result is the same for any number")
        ->check(CLI::Range(0, 1024));
    verb->add_flag("--json", options->json, "print a JSON report");
    verb->callback([options, &exit_code] {
        const auto status = run(*options);
        if (status) return;
        fmt::print(stderr, "rf relight: {}\n", status.error().message);
        exit_code = 1;
    });
}

}  // namespace ols

// SPDX-License-Identifier: MIT
// stagectl basis report: what a basis is worth for a camera and a stage.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>
#include <numeric>

#include "image/outputs.hpp"
#include "program.hpp"
#include "stage/basis_figures.hpp"
#include "stage/camera_presets.hpp"
#include "stage/flicker.hpp"
#include "stagectl/basis_plot.hpp"
#include "stagectl/lost_slots.hpp"
#include "stagectl/sequence_options.hpp"
#include "stagectl/session.hpp"
#include "stagectl/verbs.hpp"

namespace ols {

namespace {

struct Options {
    SequenceOptions sequence;
    std::string stage, camera, plot;
    GreyChart chart;
    bool json = false;
};

constexpr double lux_of_counts_per_us = 420;  // the light for which stage.toml states a camera's counts_per_us

// A preset's noise on the stage's camera, or the first camera of a file.
Result<CameraConfig> open_camera_config(const std::string& name, const StageConfig& stage) {
    if (name.empty()) return stage.cameras[0];
    if (name.ends_with(".toml")) {
        auto file = read_stage(name);
        if (!file.ok()) return file.error();
        return file->cameras[0];
    }
    const auto preset = find_camera_preset(name);
    if (!preset.ok()) return fail(preset.error().message + ", or a FILE.toml with a [[camera]]");
    CameraConfig camera = stage.cameras[0];
    camera.bits = preset->bits;
    camera.white = double((1 << preset->bits) - 1);
    camera.noise = preset->noise;
    return camera;
}

struct Report {
    Sequence sequence;
    BasisFigures figures;
    FlickerPeak whole;
    Flicker flicker;  // of the basis's light alone
    double noise_mean = 0, noise_worst = 0;
    // Of the lamps that it lights.
    double strobe_lowest_hz = 0, dark_longest_ms = 0, duty_mean = 0, cycle_modulation_mean = 0;
};

// Tracking lights all lamps, evenly, and would hide how the basis does.
Sequence without_tracking(Sequence sequence) {
    for (Slot& slot : sequence.slots)
        if (slot.kind == SlotKind::tracking) std::fill(slot.lit.begin(), slot.lit.end(), uint8_t(0));
    return sequence;
}

void summarize(Report& report) {
    const auto& gain = report.figures.noise_gain;
    report.noise_mean = std::accumulate(gain.begin(), gain.end(), 0.0) / double(gain.size());
    report.noise_worst = *std::max_element(gain.begin(), gain.end());
    const int lamps = report.sequence.basis.lamps;
    int lit = 0;
    for (int i = 0; i < lamps; ++i) {
        const LampLight& lamp = report.flicker.lamps[size_t(i)];
        if (lamp.duty == 0) continue;
        report.strobe_lowest_hz = lit++ ? std::min(report.strobe_lowest_hz, lamp.strobe_hz) : lamp.strobe_hz;
        report.dark_longest_ms = std::max(report.dark_longest_ms, lamp.longest_dark_us * 1e-3);
        report.duty_mean += lamp.duty;
        report.cycle_modulation_mean += lamp.cycle_modulation;
    }
    report.duty_mean /= lit;
    report.cycle_modulation_mean /= lit;
}

Result<Report> make_report(const Options& options) {
    auto stage = options.stage.empty() ? Result<StageConfig>(default_stage()) : read_stage(options.stage);
    if (!stage.ok()) return stage.error();
    auto camera = open_camera_config(options.camera, *stage);
    if (!camera.ok()) return camera.error();
    camera->counts_per_us *= options.chart.lamp_lux / lux_of_counts_per_us;
    stage->cameras = {*camera};
    const auto config = open_sequence(options.sequence);
    if (!config.ok()) return config.error();
    auto sequence = compile_sequence(*config, *stage);
    if (!sequence.ok()) return sequence.error();
    if (!sequence->is_capture()) return fail(sequence->basis.name + " is played, not inverted: choose a capture basis");
    Report report;
    report.sequence = std::move(*sequence);
    report.figures = measure_basis(report.sequence, *stage, *camera, options.chart);
    report.whole = measure_flicker(report.sequence).whole;
    report.flicker = measure_flicker(without_tracking(report.sequence));
    summarize(report);
    return report;
}

nlohmann::json to_json(const Report& report, const GreyChart& chart) {
    const Basis& basis = report.sequence.basis;
    const BasisFigures& figures = report.figures;
    const auto facing = size_t(figures.facing_image());
    const auto snr_json = [&](const std::vector<double>& snr) {
        return nlohmann::json{{"facing", snr[facing]}, {"mean", figures.mean_snr(snr)}, {"images", snr}};
    };
    return {
        {"basis", basis.name},
        {"rows", basis.rows},
        {"lamps", basis.lamps},
        {"images", basis.images()},
        {"rank", figures.matrix.rank},
        {"condition", figures.matrix.condition},
        {"singular_values", figures.matrix.singular_values},
        {"is_estimate", basis.is_estimate},
        {"noise_gain", {{"mean", report.noise_mean}, {"worst", report.noise_worst}, {"images", figures.noise_gain}}},
        {"chart", {{"reflectance", chart.reflectance}, {"shadow", chart.shadow}, {"lamp_lux", chart.lamp_lux}}},
        {"chart_counts", figures.chart_counts},
        {"snr_chart", snr_json(figures.chart_snr)},
        {"snr_shadow", snr_json(figures.shadow_snr)},
        {"bias", figures.bias},
        {"exposure_us", report.sequence.config.basis_exposure_us},
        {"white_share", figures.white_share},
        {"lux", {{"peak", figures.lux_peak}, {"mean", figures.lux_mean}}},
        {"lamps_lit", {{"mean", figures.lamps_lit_mean}, {"most", figures.lamps_lit_max}}},
        {"slots", report.sequence.slots.size()},
        {"cycle_ms", double(report.sequence.cycle_ticks()) / double(ticks_per_us) * 1e-3},
        {"strobe_lowest_hz", report.strobe_lowest_hz},
        {"longest_dark_ms", report.dark_longest_ms},
        {"duty_mean", report.duty_mean},
        {"cycle_modulation_mean", report.cycle_modulation_mean},
        {"lost_slots", lost_slots_json(report.sequence)},
        {"flicker_whole", {{"hz", report.whole.hz}, {"modulation", report.whole.modulation}}}};
}

void print_report(const Report& report, const GreyChart& chart) {
    const Basis& basis = report.sequence.basis;
    const BasisFigures& figures = report.figures;
    const auto facing = size_t(figures.facing_image());
    const double cycle_ms = double(report.sequence.cycle_ticks()) / double(ticks_per_us) * 1e-3;
    fmt::print("{}: {} rows over {} lamps give {} images{}\n", basis.name, basis.rows, basis.lamps, basis.images(),
               basis.is_estimate ? ", an ESTIMATE: fewer independent rows than lamps" : "");
    fmt::print("matrix       rank {}, condition number {:.4g}\n", figures.matrix.rank, figures.matrix.condition);
    fmt::print("noise gain   mean {:.4g}, worst {:.4g} (variance for additive noise; a single lamp's image has 1)\n",
               report.noise_mean, report.noise_worst);
    fmt::print("SNR, chart   {:.1f} facing, {:.1f} mean (reflectance {:g} facing the camera; {:.0f} counts facing)\n",
               figures.chart_snr[facing], figures.mean_snr(figures.chart_snr), chart.reflectance,
               figures.chart_counts[facing]);
    fmt::print(
        "SNR, shadow  {:.2f} facing, {:.2f} mean ({:g} % of an image's light there, the other lamps as before)\n",
        figures.shadow_snr[facing], figures.mean_snr(figures.shadow_snr), chart.shadow * 100);
    if (figures.bias > 1e-9)
        fmt::print("bias         {:.1f} % of the chart's signal, on top of noise\n", figures.bias * 100);
    fmt::print("exposure     {:g} us; a white card reaches {:.0f} % of saturation in the brightest row{}\n",
               report.sequence.config.basis_exposure_us, figures.white_share * 100,
               figures.white_share > 1 ? ": it SATURATES, shorten the exposure" : "");
    fmt::print(
        "light        {:.1f} lamps a row, at most {:.1f}; {:.0f} lux facing the camera on average, {:.0f} while lit\n",
        figures.lamps_lit_mean, figures.lamps_lit_max, figures.lux_mean, figures.lux_peak);
    fmt::print("cycle        {} slots, {:.1f} ms\n", report.sequence.slots.size(), cycle_ms);
    fmt::print(
        "strobe       the basis flashes a lamp {:.0f} times a second or more, lights it {:.2f} % of the time, leaves "
        "it dark for "
        "up to {:.1f} ms; {:.0f} % of its light comes and goes at {:.1f} Hz, once a cycle\n",
        report.strobe_lowest_hz, report.duty_mean * 100, report.dark_longest_ms, report.cycle_modulation_mean * 100,
        1e3 / cycle_ms);
    fmt::print("flicker      {:.1f} % of all light at {:.1f} Hz\n", report.whole.modulation * 100, report.whole.hz);
    fmt::print("lost slots   {}\n", describe_lost_slots(report.sequence));
}

Result<int> run(const Options& options) {
    const Status writable =
        check_outputs({.inputs = {options.sequence.path, options.sequence.basis, options.stage, options.camera},
                       .files = {options.plot}});
    if (!writable.ok()) return writable.error();
    const auto report = make_report(options);
    if (!report.ok()) return report.error();
    if (!options.plot.empty())
        if (const Status status = plot_basis(options.plot, report->sequence, report->figures, report->flicker);
            !status.ok())
            return status.error();
    if (options.json)
        print_json(to_json(*report, options.chart));
    else
        print_report(*report, options.chart);
    return 0;
}

}  // namespace

void add_basis_report_verb(CLI::App& basis, int& exit_code) {
    auto options = std::make_shared<Options>();
    CLI::App* verb = basis.add_subcommand("report", "rank, noise, light and strobe of a basis on a stage");
    verb->footer(
        "Example: stagectl basis report s159 --camera phantom_v7.1 --plot s159.png\n"
        "The grey chart is a card at the centre that faces the camera; lamps light it by the cosine. See "
        "docs/bases.md.");
    verb->add_option("basis", options->sequence.basis, "of `stagectl basis list`, or a FILE.csv")->required();
    verb->add_option("--sequence", options->sequence.path, "sequence.toml, for frame rate, groups and tracking");
    verb->add_option("--exposure-us", options->sequence.exposure_us,
                     "of the basis slots; else as long as a white card stays below saturation")
        ->check(CLI::Range(1.0, 1e6));
    verb->add_option("--stage", options->stage, "stage.toml; without it, the default stage");
    verb->add_option(
        "--camera", options->camera,
        "FILE.toml with a [[camera]], or a preset: phantom_v7.1, canon_d30, qimaging_qicam; else the stage's");
    verb->add_option("--lux", options->chart.lamp_lux,
                     "light of one lamp at the centre; 420 is what the camera's counts_per_us is stated for")
        ->check(CLI::Range(1e-3, 1e9));
    verb->add_option("--reflectance", options->chart.reflectance, "of the chart; 0.24 is average skin")
        ->check(CLI::Range(1e-6, 1.0));
    verb->add_option("--shadow", options->chart.shadow, "share of its lamps' light that an image has in deep shadow")
        ->check(CLI::Range(1e-6, 1.0));
    verb->add_flag("--json", options->json, "print as JSON, with figures for each image");
    verb->add_option("--plot", options->plot, "PNG to draw (by gnuplot)");
    verb->callback([options, &exit_code] { exit_code = report_errors([&] { return run(*options); }); });
}

}  // namespace ols

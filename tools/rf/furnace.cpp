// SPDX-License-Identifier: MIT
// rf furnace: the white furnace test of a set of lamps, through an archive as any take goes.
#include <fmt/format.h>
#include <unistd.h>

#include <cerrno>
#include <cmath>
#include <cstring>
#include <filesystem>
#include <memory>
#include <nlohmann/json.hpp>
#include <numbers>

#include "archive/archive.hpp"
#include "lighting.hpp"
#include "program.hpp"
#include "relight/relight.hpp"
#include "verbs.hpp"

namespace ols {

namespace {

constexpr double pi = std::numbers::pi;
constexpr int chart_width = 128, chart_height = 128;

// A white Lambertian sphere unrolled: each pixel is a patch with its own normal, all of equal area (a Fibonacci spiral),
// so that the mean over the chart's pixels is the mean over the sphere.
std::vector<Vec3> chart_normals() {
    constexpr int count = chart_width * chart_height;
    std::vector<Vec3> normals;
    for (int k = 0; k < count; ++k) {
        const double y = 1 - (2 * k + 1.0) / count, r = std::sqrt(1 - y * y), azimuth = k * pi * (3 - std::sqrt(5.0));
        normals.push_back({r * std::sin(azimuth), y, r * std::cos(azimuth)});
    }
    return normals;
}

// The chart's reflectance functions: r = max(0, n.l), since E on a facing surface is 1 and L = n.l / pi.
Target chart_target(const std::vector<Vec3>& normals, const SphereCells& cells) {
    Target target;
    target.width = chart_width;
    target.height = chart_height;
    target.mask.assign(normals.size(), 0);
    for (Vec3 lamp : cells.directions()) {
        auto& plane = target.lamps.emplace_back();
        for (Vec3 n : normals) plane.push_back(float(std::max(0.0, dot(n, lamp))));
    }
    return target;
}

// Writes the chart to an archive in `path` and reads it back, as any subject's reflectance would come.
Result<Target> through_archive(const std::string& path, const Target& chart, const std::vector<LightPosition>& lights) {
    TakeInfo info;
    info.value_unit = "reflectance";
    info.lights = lights;
    auto writer = ArchiveWriter::create(path, info);
    if (!writer) return writer.error();
    const auto written = writer->write_target(chart);
    if (!written) return written.error();
    const auto finished = writer->finish();
    if (!finished) return finished.error();
    const auto reader = ArchiveReader::open(path);
    if (!reader) return reader.error();
    return reader->read_target(0, 0);
}

struct Furnace {
    double mean = 0;             // over all normals; 1 is white
    double worst_deviation = 0;  // of a normal from the closed-form sum, relative
    Vec3 worst_normal;
    double darkest = 1e9, brightest = 0;  // what lamps in place of a uniform sky make of single normals
};

Furnace measure(const Image& relit, const std::vector<Vec3>& normals, const SphereCells& cells) {
    Furnace furnace;
    for (size_t i = 0; i < normals.size(); ++i) {
        double closed_form = 0;
        for (int lamp = 0; lamp < cells.size(); ++lamp)
            closed_form += cells.solid_angle(lamp) / pi * std::max(0.0, dot(normals[i], cells.directions()[lamp]));
        const double shown = relit.data[i * size_t(relit.channels)];
        furnace.mean += shown / double(normals.size());
        furnace.darkest = std::min(furnace.darkest, shown);
        furnace.brightest = std::max(furnace.brightest, shown);
        // Normals that no lamp reaches have no relative error.
        const double deviation = closed_form > 0 ? std::abs(shown / closed_form - 1) : std::abs(shown);
        if (deviation > furnace.worst_deviation) furnace.worst_deviation = deviation, furnace.worst_normal = normals[i];
    }
    return furnace;
}

Environment white_sky() {
    Image map(256, 128, 3);
    std::fill(map.data.begin(), map.data.end(), 1.0f);
    return make_environment(map, EnvConvention::openexr);
}

Result<nlohmann::json> run(const std::string& lights_file) {
    std::vector<LightPosition> lights;
    if (lights_file.empty()) {
        for (Vec3 d : stage_lamp_directions()) lights.push_back({fmt::format("lamp_{:03}", lights.size()), d});
    } else {
        auto read = read_lp(lights_file);
        if (!read) return read.error();
        lights = *read;
    }
    const auto cells = cells_of_lights(lights);
    if (!cells) return cells.error();
    const auto normals = chart_normals();
    std::error_code error;
    std::string folder = (std::filesystem::temp_directory_path(error) / "rf-furnace-XXXXXX").string();
    if (mkdtemp(folder.data()) == nullptr)
        return fail("cannot make '" + folder + "': " + std::strerror(errno) + ": set TMPDIR to a folder with space");
    const auto target = through_archive(folder + "/chart.rfa", chart_target(normals, *cells), lights);
    std::filesystem::remove_all(folder, error);
    if (!target) return target.error();
    const auto relit = relight({target->width, target->height, target->cfa, target->lamps},
                               integrate_environment(white_sky(), *cells));
    if (!relit) return relit.error();
    const Furnace f = measure(relit->image, normals, *cells);
    double total = 0, widest = 0;
    for (int lamp = 0; lamp < cells->size(); ++lamp) {
        total += cells->solid_angle(lamp);
        widest = std::max(widest, cells->reach(lamp));
    }
    return nlohmann::json{{"white_furnace_error", std::abs(f.mean - 1)},
                          {"mean", f.mean},
                          {"worst_normal_deviation", f.worst_deviation},
                          {"worst_normal", {f.worst_normal.x, f.worst_normal.y, f.worst_normal.z}},
                          {"darkest_normal", f.darkest},
                          {"brightest_normal", f.brightest},
                          {"normals", normals.size()},
                          {"lamps", cells->size()},
                          {"solid_angle_sr", total},
                          {"widest_cell_reach_deg", widest * 180 / pi}};
}

void print_report(const nlohmann::json& report) {
    const auto figure = [&](const char* key) { return report[key].get<double>(); };
    fmt::print("mean            {:.7f} over {} normals under {} lamps: {:.2g} off white\n", figure("mean"),
               report["normals"].get<int>(), report["lamps"].get<int>(), figure("white_furnace_error"));
    fmt::print("worst normal    {:.2g} off the closed form, relative\n", figure("worst_normal_deviation"));
    fmt::print("normals         {:.4f} to {:.4f}\n", figure("darkest_normal"), figure("brightest_normal"));
    fmt::print("cells           {:.6f} sr in all; the widest reaches {:.1f} degrees from its lamp\n",
               figure("solid_angle_sr"), figure("widest_cell_reach_deg"));
}

}  // namespace

void add_furnace_verb(CLI::App& app, int& exit_code) {
    struct Options {
        std::string lights;
        bool json = false;
    };
    auto options = std::make_shared<Options>();
    CLI::App* verb = app.add_subcommand("furnace", "white furnace test: a white sphere under radiance 1 must show 1");
    verb->footer(
        "Example: rf furnace --lights lights.lp\n"
        "Prints the mean over all normals, the normal that is farthest from the closed-form sum over the lamps'\n"
        "exact cells, and the darkest and brightest normals, which tell how far lamps stand in for a uniform sky.");
    verb->add_option("--lights", options->lights, "light positions (.lp); the stage's 156 lamps without");
    verb->add_flag("--json", options->json, "print JSON");
    verb->callback([options, &exit_code] {
        const auto report = run(options->lights);
        if (report) {
            options->json ? print_json(*report) : print_report(*report);
            return;
        }
        fmt::print(stderr, "rf furnace: {}\n", report.error().message);
        exit_code = 1;
    });
}

}  // namespace ols

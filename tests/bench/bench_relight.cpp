// SPDX-License-Identifier: MIT
// Relighting: the weights that lamps get from an environment, and the weighted sum of OLAT images.
// links: ols_relight ols_bench_openblas
#include <cblas.h>

#include <cmath>
#include <numbers>
#include <random>

#include "bench.hpp"
#include "openblas_kernel.hpp"
#include "relight/relight.hpp"

using namespace ols;

namespace {

// The usual resampling: each texel's light, by its solid angle, goes to the lamp nearest to its middle.
LampWeights nearest_lamps(const Environment& map, const SphereCells& cells) {
    LampWeights weights;
    weights.irradiance.resize(size_t(cells.size()));
    const int width = map.radiance.width, height = map.radiance.height;
    int lamp = 0;
    for (int y = 0; y < height; ++y)
        for (int x = 0; x < width; ++x) {
            const EnvPatch texel{double(x) / width, (x + 1.0) / width, double(y) / height, (y + 1.0) / height};
            lamp = cells.nearest(env_direction(map.convention, (x + 0.5) / width, (y + 0.5) / height), lamp);
            const double angle = env_solid_angle(map.convention, texel);
            for (int c = 0; c < 3; ++c) weights.irradiance[size_t(lamp)][size_t(c)] += angle * map.radiance.at(x, y, c);
        }
    return weights;
}

// Under radiance 1 everywhere a lamp's weight is the solid angle of its cell, which is known in closed form.
void measure_borders(Bench& bench) {
    const int width = bench.full() ? 1024 : 64;
    Image white(width, width / 2, 3);
    white.data.assign(white.data.size(), 1);
    const Environment map = make_environment(white, EnvConvention::openexr);
    auto directions = stage_lamp_directions();
    if (!bench.full()) directions.resize(4);  // borders are what takes time
    const auto cells = *SphereCells::make(directions);
    LampWeights weights;
    const auto error = [&] {
        double squares = 0;
        for (int i = 0; i < cells.size(); ++i)
            squares += std::pow(weights.irradiance[size_t(i)][1] / cells.solid_angle(i) - 1, 2);
        return 100 * std::sqrt(squares / cells.size());
    };
    std::vector<Setting> settings = {{"nearest lamp", [&] { weights = nearest_lamps(map, cells); }, error}};
    for (const auto& [name, tolerance] : {std::pair{"1e-2", 1e-2}, {"3e-3", 3e-3}, {"1e-3", 1e-3}, {"1e-4", 1e-4}})
        settings.push_back(
            {name, [&, tolerance] { weights = integrate_environment(map, cells, {.border_tolerance_rad = tolerance}); },
             error});
    bench.measure({.name = "border tolerance, rad",
                   .set_by = "`EnvironmentOptions::border_tolerance_rad`",
                   .error_unit = "% of a weight rms",
                   .peer = "nearest lamp",
                   .default_setting = "1e-3",
                   .settings = settings});
}

constexpr int lamp_count = 156;

struct Take {
    int width, height;
    std::vector<Plane> planes;
    LampWeights weights;
    std::vector<double> truth;  // of channel 0, in double precision
};

Take monochrome_take(int width, int height) {
    Take take{width, height, {}, {}, std::vector<double>(size_t(width) * size_t(height))};
    std::mt19937 random(3);
    std::uniform_real_distribution<float> value(0, 1);
    for (int i = 0; i < lamp_count; ++i) {
        const double weight = value(random) * 0.08;
        take.weights.irradiance.push_back({weight, weight, weight});
        take.planes.emplace_back(take.truth.size());
        for (size_t p = 0; p < take.truth.size(); ++p) {
            take.planes.back()[p] = value(random);
            take.truth[p] += double(take.planes.back()[p]) * weight / std::numbers::pi;
        }
    }
    return take;
}

void measure_sums(Bench& bench) {
    const Take take = bench.full() ? monochrome_take(640, 480) : monochrome_take(32, 24);
    const size_t samples = take.truth.size();
    Image relit;
    const auto error_of = [&](const float* image, size_t step) {
        double squares = 0, truth = 0;
        for (size_t p = 0; p < samples; ++p) {
            squares += std::pow(image[p * step] - take.truth[p], 2);
            truth += take.truth[p] * take.truth[p];
        }
        return std::sqrt(squares / truth);
    };
    // Lamp by lamp in one block, which sgemm needs; three columns of weights, as a relit monochrome image has three colours.
    std::vector<float> block, columns(3 * size_t(lamp_count)), product(3 * samples);
    for (const auto& plane : take.planes) block.insert(block.end(), plane.begin(), plane.end());
    for (size_t i = 0; i < size_t(lamp_count); ++i)
        for (size_t c = 0; c < 3; ++c)
            columns[c * lamp_count + i] = float(take.weights.irradiance[i][c] / std::numbers::pi);
    const auto sgemm = [&](int threads) {
        openblas_set_num_threads(threads);
        cblas_sgemm(CblasRowMajor, CblasNoTrans, CblasNoTrans, 3, int(samples), lamp_count, 1, columns.data(),
                    lamp_count, block.data(), int(samples), 0, product.data(), int(samples));
    };
    std::vector<Setting> settings = {{.name = "OpenBLAS sgemm",
                                      .run = [&] { sgemm(1); },
                                      .error = [&] { return error_of(product.data(), 1); },
                                      .detail = openblas_kernel_note()}};
    for (const int threads : {1, 2})
        settings.push_back(
            {threads == 1 ? "1 thread" : "2 threads",
             [&, threads] {
                 relit = relight({take.width, take.height, Cfa::none, take.planes}, take.weights, threads)->image;
             },
             [&] { return error_of(relit.data.data(), 3); }, threads});
    bench.measure({.name = "threads",
                   .set_by = "`rf relight --threads`; 0, the default, is one a core",
                   .error_unit = "of the signal rms",
                   .peer = "OpenBLAS sgemm",
                   .default_setting = "2 threads",
                   .why_off_front =
                       "its sums keep the order of the lamps, so that a picture has the same bits for any number of "
                       "threads, and it leaves out samples that are not finite; a library's product promises neither.",
                   .settings = settings});
}

}  // namespace

int main(int argc, char** argv) {
    choose_openblas_kernel(argc, argv, {.rows = 3, .columns = 640 * 480, .inner = lamp_count});
    Bench bench(
        argc, argv,
        {.name = "relight",
         .truth =
             "Weights: under radiance 1 everywhere (a map of 1024 x 512) a lamp's weight is the solid angle of its "
             "spherical Voronoi cell, in closed form. Sums: 156 random monochrome OLAT images of 640 x 480, lit in "
             "three "
             "colours, against sums in double precision.",
         .advice =
             "The default border tolerance is below what any map resolves; take 1e-2 for previews while a light turns. "
             "Pictures are the same bits for any number of threads, so use them all."});
    measure_borders(bench);
    measure_sums(bench);
    return bench.finish();
}

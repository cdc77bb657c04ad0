// SPDX-License-Identifier: MIT
// Relighting against sums in double precision, and a white sphere in a white furnace.
// links: ols_relight
#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <limits>
#include <numbers>
#include <random>

#include "image/demosaic.hpp"
#include "relight/relight.hpp"

namespace ols {
namespace {

constexpr double pi = std::numbers::pi;

struct Scene {
    int width, height;
    Cfa cfa;
    std::vector<Plane> planes;
    LampWeights weights;

    OlatImages olat() const { return {width, height, cfa, planes}; }
};

// Random samples, some negative as after black subtraction, and random coloured weights.
Scene random_scene(int width, int height, int lamps, Cfa cfa) {
    std::mt19937 generator(5);
    std::uniform_real_distribution<float> sample(-0.05f, 1), weight(0, 2);
    Scene scene{width, height, cfa, {}, {}};
    scene.planes.resize(size_t(lamps) * (cfa == Cfa::rgb ? 3 : 1));
    for (auto& plane : scene.planes)
        for (int i = 0; i < width * height; ++i) plane.push_back(sample(generator));
    for (int i = 0; i < lamps; ++i)
        scene.weights.irradiance.push_back({weight(generator), weight(generator), weight(generator)});
    return scene;
}

double expected(const Scene& scene, int x, int y, int channel) {
    const bool mosaic = scene.cfa != Cfa::none && scene.cfa != Cfa::rgb;
    const int color = mosaic ? cfa_color(scene.cfa, x, y) : channel;
    double sum = 0;
    for (size_t i = 0; i < scene.weights.irradiance.size(); ++i) {
        const auto& plane = scene.cfa == Cfa::rgb ? scene.planes[i * 3 + channel] : scene.planes[i];
        sum += scene.weights.irradiance[i][color] / pi * plane[size_t(y) * scene.width + x];
    }
    return sum;
}

TEST(Relight, every_layout_is_the_weighted_sum_in_double_precision) {
    for (Cfa cfa : {Cfa::none, Cfa::rgb, Cfa::rggb, Cfa::bggr, Cfa::grbg, Cfa::gbrg}) {
        const auto scene = random_scene(37, 23, 19, cfa);
        const auto relit = relight(scene.olat(), scene.weights);
        ASSERT_TRUE(relit.ok());
        for (int y = 0; y < scene.height; ++y)
            for (int x = 0; x < scene.width; ++x)
                for (int c = 0; c < relit->image.channels; ++c)
                    ASSERT_NEAR(relit->image.at(x, y, c), expected(scene, x, y, c), 2e-5) << x << "," << y << "," << c;
    }
}

TEST(Relight, the_number_of_threads_does_not_change_a_bit) {
    for (Cfa cfa : {Cfa::rgb, Cfa::grbg}) {
        const auto scene = random_scene(101, 67, 40, cfa);
        const auto one = relight(scene.olat(), scene.weights, 1);
        for (int threads : {2, 3, 8}) {
            const auto many = relight(scene.olat(), scene.weights, threads);
            EXPECT_EQ(std::memcmp(one->image.data.data(), many->image.data.data(), one->image.data.size() * 4), 0);
        }
    }
}

TEST(Relight, a_mosaic_relit_and_demosaiced_is_the_colour_image_of_a_smooth_subject) {
    const int size = 24;
    Scene colour{size, size, Cfa::rgb, {}, {}}, mosaic{size, size, Cfa::grbg, {}, {}};
    for (int lamp = 0; lamp < 4; ++lamp) {
        Plane planes[3], raw;
        for (int i = 0; i < size * size; ++i) {
            const int x = i % size, y = i / size;
            for (int c = 0; c < 3; ++c) planes[c].push_back(0.2f + 0.01f * float(lamp * x + y));
            raw.push_back(planes[cfa_color(mosaic.cfa, x, y)].back());
        }
        for (auto& plane : planes) colour.planes.push_back(plane);
        mosaic.planes.push_back(raw);
        const double grey = 1 + lamp;
        colour.weights.irradiance.push_back({grey, grey, grey});
        mosaic.weights.irradiance.push_back({grey, grey, grey});
    }
    const auto a = relight(colour.olat(), colour.weights), b = relight(mosaic.olat(), mosaic.weights);
    const Image demosaiced = demosaic(b->image, mosaic.cfa);
    for (int y = 2; y < size - 2; ++y)
        for (int x = 2; x < size - 2; ++x)
            for (int c = 0; c < 3; ++c) EXPECT_NEAR(demosaiced.at(x, y, c), a->image.at(x, y, c), 1e-4);
}

TEST(Relight, samples_that_are_no_numbers_are_left_out_and_counted_for_their_lamp) {
    for (Cfa cfa : {Cfa::rgb, Cfa::none, Cfa::rggb}) {
        auto scene = random_scene(16, 8, 5, cfa);
        const int per_lamp = scene.olat().planes_per_lamp();
        auto without = scene;
        scene.planes[3 * per_lamp][21] = std::numeric_limits<float>::quiet_NaN();
        scene.planes[1 * per_lamp][7] = std::numeric_limits<float>::infinity();
        without.planes[3 * per_lamp][21] = without.planes[1 * per_lamp][7] = 0;
        const auto relit = relight(scene.olat(), scene.weights);
        EXPECT_EQ(relit->left_out_samples, (std::vector<size_t>{0, 1, 0, 1, 0}));
        EXPECT_EQ(relit->image.data, relight(without.olat(), without.weights)->image.data);
    }
}

// A white Lambertian sphere seen from +z, half in view: r = max(0, n.l). The furnace's closed form is the same sum with
// the exact solid angles of the cells.
TEST(Relight, a_white_sphere_in_a_white_furnace_meets_the_closed_form_at_every_normal) {
    const int size = 96;
    const auto cells = *SphereCells::make(stage_lamp_directions());
    std::vector<Vec3> normals;
    for (int i = 0; i < size * size; ++i) {
        const double x = (i % size + 0.5) / size * 2 - 1, y = 1 - (i / size + 0.5) / size * 2, r2 = x * x + y * y;
        normals.push_back(r2 < 1 ? Vec3{x, y, std::sqrt(1 - r2)} : Vec3{});
    }
    std::vector<Plane> planes(cells.size());
    for (int lamp = 0; lamp < cells.size(); ++lamp)
        for (Vec3 n : normals) planes[lamp].push_back(float(std::max(0.0, dot(n, cells.directions()[lamp]))));
    Image furnace(64, 32, 3);
    for (float& v : furnace.data) v = 1;
    const auto weights = integrate_environment(make_environment(furnace, EnvConvention::openexr), cells);
    const auto relit = relight({size, size, Cfa::none, planes}, weights);
    ASSERT_TRUE(relit.ok());
    double worst = 0;
    for (int i = 0; i < size * size; ++i) {
        if (length(normals[i]) == 0) continue;
        double closed_form = 0;
        for (int lamp = 0; lamp < cells.size(); ++lamp)
            closed_form += cells.solid_angle(lamp) / pi * std::max(0.0, dot(normals[i], cells.directions()[lamp]));
        worst = std::max(worst, std::abs(relit->image.data[size_t(i) * 3] / closed_form - 1));
    }
    EXPECT_LT(worst, 0.001);
    EXPECT_GT(worst, 0);
}

TEST(Relight, wrong_counts_and_sizes_are_refused) {
    auto scene = random_scene(8, 8, 4, Cfa::none);
    scene.weights.irradiance.pop_back();
    EXPECT_NE(relight(scene.olat(), scene.weights).error().message.find("of 4 lamps and weights for 3"),
              std::string::npos);
    auto short_plane = random_scene(8, 8, 4, Cfa::none);
    short_plane.planes[2].pop_back();
    EXPECT_NE(relight(short_plane.olat(), short_plane.weights).error().message.find("plane 2 has 63"),
              std::string::npos);
    const auto thin = random_scene(1, 8, 4, Cfa::rggb);
    EXPECT_FALSE(relight(thin.olat(), thin.weights).ok());
    EXPECT_FALSE(relight({8, 8, Cfa::none, {}}, {}).ok());
}

}  // namespace
}  // namespace ols

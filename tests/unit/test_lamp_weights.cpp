// SPDX-License-Identifier: MIT
// Environment integration against closed forms, hand-made tables of directions, and conservation of energy.
// links: ols_relight
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <numbers>
#include <set>

#include "relight/lamp_weights.hpp"

namespace ols {
namespace {

constexpr double pi = std::numbers::pi;

SphereCells stage_cells() {
    return *SphereCells::make(stage_lamp_directions());
}

Image constant_map(int width, int height, float value) {
    Image map(width, height, 3);
    for (float& v : map.data) v = value;
    return map;
}

// All black but for one texel, the one that holds (u, v).
Environment one_bright_texel(int width, int height, double u, double v, EnvConvention convention) {
    Image map(width, height, 3);
    const int x = std::min(int(u * width), width - 1), y = std::min(int(v * height), height - 1);
    map.at(x, y, 0) = 1;
    map.at(x, y, 1) = 2;
    map.at(x, y, 2) = 4;
    return make_environment(map, convention);
}

double total(const LampWeights& weights, int channel = 0) {
    double sum = 0;
    for (const Rgb& w : weights.irradiance) sum += w[channel];
    return sum;
}

std::set<int> lit_lamps(const LampWeights& weights) {
    std::set<int> lit;
    for (size_t i = 0; i < weights.irradiance.size(); ++i)
        if (weights.irradiance[i][0] > 0) lit.insert(int(i));
    return lit;
}

std::set<int> nearest_lamps(const SphereCells& cells, Vec3 d, double slack_rad) {
    double best = pi;
    for (Vec3 lamp : cells.directions()) best = std::min(best, std::acos(dot(lamp, normalized(d))));
    std::set<int> nearest;
    for (int i = 0; i < cells.size(); ++i)
        if (std::acos(dot(cells.directions()[i], normalized(d))) <= best + slack_rad) nearest.insert(i);
    return nearest;
}

// The eight compass points of a latitude-longitude map, by hand from the convention: the left border is behind the
// subject (-Z), +X is a quarter in, the middle is the camera's side (+Z), -X three quarters in.
struct CompassPoint {
    double u;
    double x, z;
};
constexpr CompassPoint compass[] = {
    {0.000, 0, -1}, {0.125, 1, -1}, {0.250, 1, 0},   {0.375, 1, 1},   {0.500, 0, 1},
    {0.625, -1, 1}, {0.750, -1, 0}, {0.875, -1, -1}, {0.9999, 0, -1},
};

TEST(LampWeights, radiance_one_gives_each_lamp_the_solid_angle_of_its_cell) {
    const auto cells = stage_cells();
    const auto weights =
        integrate_environment(make_environment(constant_map(256, 128, 1), EnvConvention::openexr), cells);
    for (int i = 0; i < cells.size(); ++i)
        EXPECT_NEAR(weights.irradiance[i][1] / cells.solid_angle(i), 1, 3e-4) << "lamp " << i;
    EXPECT_NEAR(total(weights), 4 * pi, 1e-10);
}

TEST(LampWeights, energy_is_conserved_for_maps_of_any_size_and_lamps_of_any_layout) {
    const std::vector<std::vector<Vec3>> layouts = {
        stage_lamp_directions(), {{0, 1, 0}}, {{0, 1, 0}, {0, -1, 0}}, {{1, 1, 0}, {0, 1, 1}, {-1, 1, 0}, {0, 1, -1}}};
    for (const auto& lamps : layouts) {
        const auto cells = *SphereCells::make(lamps);
        for (auto [width, height] : {std::pair{1, 1}, {2, 1}, {7, 3}, {64, 32}}) {
            const auto map = make_environment(constant_map(width, height, 0.5), EnvConvention::openexr);
            EXPECT_NEAR(total(integrate_environment(map, cells, {.border_tolerance_rad = 5e-3})), 2 * pi, 1e-9)
                << lamps.size() << " lamps, " << width << " x " << height;
        }
    }
}

TEST(LampWeights, a_coarse_constant_map_is_split_to_the_cells_borders) {
    const auto cells = *SphereCells::make({{1, 0, 0}, {-1, 0, 0}, {0, 1, 0}, {0, -1, 0}, {0, 0, 1}, {0, 0, -1}});
    const auto weights = integrate_environment(make_environment(constant_map(1, 1, 1), EnvConvention::openexr), cells);
    for (const Rgb& w : weights.irradiance) EXPECT_NEAR(w[0], 4 * pi / 6, 1e-3);
}

TEST(LampWeights, an_angular_probe_of_radiance_one_is_a_white_furnace_too) {
    const auto weights =
        integrate_environment(make_environment(constant_map(128, 128, 1), EnvConvention::angular), stage_cells());
    EXPECT_NEAR(total(weights), 4 * pi, 4 * pi * 1e-5);
}

TEST(LampWeights, a_bright_texel_lights_the_side_it_is_on) {
    const auto cells = stage_cells();
    const int width = 360, height = 180;
    const double texel = 2 * pi / width;
    for (auto [v, elevation] : {std::pair{0.25, 1.0}, {0.5, 0.0}, {0.75, -1.0}}) {
        for (const auto& [u, x, z] : compass) {
            const double y = elevation * std::hypot(x, z);
            const auto weights =
                integrate_environment(one_bright_texel(width, height, u, v, EnvConvention::openexr), cells);
            const auto allowed = nearest_lamps(cells, {x, y, z}, 2 * texel);
            for (int lamp : lit_lamps(weights)) EXPECT_TRUE(allowed.contains(lamp)) << x << " " << y << " " << z;
            EXPECT_GT(total(weights), 0);
        }
    }
}

TEST(LampWeights, a_bright_texel_at_a_pole_lights_top_or_bottom) {
    const auto cells = stage_cells();
    for (double u : {0.0, 0.3, 0.7}) {
        const auto top = integrate_environment(one_bright_texel(256, 128, u, 0, EnvConvention::openexr), cells);
        EXPECT_EQ(lit_lamps(top), std::set<int>{0});
        // The nadir has no lamp: the light goes to the lowest ring, whose cells have grown over the hole.
        const auto bottom = integrate_environment(one_bright_texel(256, 128, u, 1, EnvConvention::openexr), cells);
        for (int lamp : lit_lamps(bottom)) EXPECT_LT(cells.directions()[lamp].y, -0.7);
        EXPECT_GT(total(bottom), 0);
    }
}

TEST(LampWeights, a_mirrored_map_swaps_left_and_right_only) {
    const auto cells = stage_cells();
    for (const auto& [u, x, z] : compass) {
        const auto weights = integrate_environment(one_bright_texel(360, 180, u, 0.5, EnvConvention::mirrored), cells);
        const auto allowed = nearest_lamps(cells, {-x, 0, z}, 0.02);
        for (int lamp : lit_lamps(weights)) EXPECT_TRUE(allowed.contains(lamp)) << u;
    }
}

TEST(LampWeights, an_angular_probe_looks_along_minus_z_with_x_to_the_right) {
    const auto cells = stage_cells();
    const struct {
        double u, v;
        Vec3 direction;
    } table[] = {{0.50, 0.50, {0, 0, -1}}, {0.75, 0.50, {1, 0, 0}}, {0.25, 0.50, {-1, 0, 0}}, {0.50, 0.25, {0, 1, 0}},
                 {0.98, 0.50, {0, 0, 1}},  {0.50, 0.98, {0, 0, 1}}, {0.625, 0.5, {1, 0, -1}}, {0.5, 0.375, {0, 1, -1}}};
    for (const auto& [u, v, direction] : table) {
        const auto weights = integrate_environment(one_bright_texel(512, 512, u, v, EnvConvention::angular), cells);
        const auto allowed = nearest_lamps(cells, direction, 0.15);
        for (int lamp : lit_lamps(weights)) EXPECT_TRUE(allowed.contains(lamp)) << u << " " << v;
    }
}

TEST(LampWeights, rotation_by_a_quarter_turns_light_from_the_camera_to_the_right) {
    const auto cells = stage_cells();
    const auto from_camera = one_bright_texel(360, 180, 0.5, 0.5, EnvConvention::openexr);
    const auto turned = integrate_environment(from_camera, cells, {.rotate_rad = pi / 2});
    const auto allowed = nearest_lamps(cells, {1, 0, 0}, 0.02);
    for (int lamp : lit_lamps(turned)) EXPECT_TRUE(allowed.contains(lamp));
}

TEST(LampWeights, rotation_by_whole_texels_equals_a_shifted_map) {
    const auto cells = stage_cells();
    Image map(36, 18, 3), shifted(36, 18, 3);
    for (int y = 0; y < 18; ++y)
        for (int x = 0; x < 36; ++x)
            for (int c = 0; c < 3; ++c) {
                const float value = float((x * 7 + y * 13 + c * 5) % 11);
                map.at(x, y, c) = value;
                shifted.at((x + 36 - 4) % 36, y, c) = value;  // four columns to the left: towards +X
            }
    const auto a =
        integrate_environment(make_environment(map, EnvConvention::openexr), cells, {.rotate_rad = 40 * pi / 180});
    const auto b = integrate_environment(make_environment(shifted, EnvConvention::openexr), cells);
    for (int i = 0; i < cells.size(); ++i)
        for (int c = 0; c < 3; ++c) EXPECT_NEAR(a.irradiance[i][c], b.irradiance[i][c], 2e-4) << i;
}

TEST(LampWeights, a_small_sun_is_never_missed_wherever_it_stands) {
    const auto cells = stage_cells();
    const auto sun = one_bright_texel(512, 256, 0.3, 0.4, EnvConvention::openexr);
    const double energy = total(integrate_environment(sun, cells));
    EXPECT_GT(energy, 0);
    for (int degrees = 0; degrees < 360; ++degrees) {
        const auto weights = integrate_environment(sun, cells, {.rotate_rad = degrees * pi / 180});
        EXPECT_NEAR(total(weights) / energy, 1, 1e-9) << degrees;
        EXPECT_LE(lit_lamps(weights).size(), 3u) << degrees;
    }
}

TEST(LampWeights, a_sun_on_a_border_is_shared_by_area) {
    // Two lamps left and right; the middle two columns straddle the border between them, here a quarter to one side.
    const auto cells = *SphereCells::make({{1, 0, 0}, {-1, 0, 0}});
    const auto sun = one_bright_texel(64, 32, 0.5, 0.5, EnvConvention::openexr);
    const double texel = 2 * pi / 64;
    const auto weights = integrate_environment(sun, cells, {.rotate_rad = texel / 4, .border_tolerance_rad = 1e-4});
    // The texel spans longitudes -1 to 0 texels; turned by a quarter, -3/4 to 1/4: a quarter of it is on the +X side.
    EXPECT_NEAR(weights.irradiance[0][0] / total(weights), 0.25, 2e-3);
}

TEST(LampWeights, exposure_counts_in_stops_and_colours_stay_apart) {
    const auto cells = stage_cells();
    const auto map = one_bright_texel(64, 32, 0.6, 0.3, EnvConvention::openexr);
    const auto plain = integrate_environment(map, cells),
               brighter = integrate_environment(map, cells, {.exposure_ev = 2});
    EXPECT_NEAR(total(brighter) / total(plain), 4, 1e-12);
    EXPECT_NEAR(total(plain, 2) / total(plain, 0), 4, 1e-12);
}

TEST(LampWeights, negative_and_non_finite_texels_are_clamped_and_counted) {
    Image map = constant_map(4, 2, 1);
    map.at(0, 0, 0) = -3;
    map.at(1, 0, 1) = std::numeric_limits<float>::quiet_NaN();
    map.at(2, 1, 2) = std::numeric_limits<float>::infinity();
    const auto environment = make_environment(map, EnvConvention::openexr);
    EXPECT_EQ(environment.clamped_negative, 1u);
    EXPECT_EQ(environment.clamped_non_finite, 2u);
    const auto weights = integrate_environment(environment, stage_cells());
    // Every texel of a map of two rows has 4 pi / 8.
    for (int c = 0; c < 3; ++c) EXPECT_NEAR(total(weights, c), 4 * pi * 7 / 8, 1e-9);
}

TEST(LampWeights, a_point_light_of_colour_one_gives_back_its_lamp) {
    const auto cells = stage_cells();
    LampWeights weights{std::vector<Rgb>(cells.size(), Rgb{})};
    const int lamp = add_point_light({cells.directions()[37] * 5, {1, 0.5, 0}}, cells, weights);
    EXPECT_EQ(lamp, 37);
    EXPECT_NEAR(weights.irradiance[37][0] / pi, 1, 1e-12);
    EXPECT_NEAR(weights.irradiance[37][1] / pi, 0.5, 1e-12);
    EXPECT_EQ(lit_lamps(weights), std::set<int>{37});
}

TEST(LampWeights, the_share_of_some_lamps_is_theirs_over_all) {
    const LampWeights weights{{{1, 2, 3}, {0, 0, 6}, {4, 4, 4}}};
    EXPECT_DOUBLE_EQ(share_of_light(weights, {0, 2}), 18.0 / 24);
    EXPECT_EQ(share_of_light(weights, {}), 0);
    EXPECT_EQ(share_of_light({{Rgb{}, Rgb{}}}, {1}), 0);
}

TEST(LampWeights, a_white_furnace_is_white_on_average_over_all_normals) {
    const auto cells = stage_cells();
    const auto weights =
        integrate_environment(make_environment(constant_map(128, 64, 1), EnvConvention::openexr), cells);
    constexpr int count = 20000;  // normals on a Fibonacci spiral
    double sum = 0;
    for (int k = 0; k < count; ++k) {
        const double y = 1 - (2 * k + 1.0) / count, r = std::sqrt(1 - y * y), a = k * pi * (3 - std::sqrt(5.0));
        double shown = 0;
        for (int i = 0; i < cells.size(); ++i)
            shown += weights.irradiance[i][0] / pi *
                     std::max(0.0, dot(cells.directions()[i], {r * std::cos(a), y, r * std::sin(a)}));
        sum += shown;
    }
    EXPECT_NEAR(sum / count, 1, 0.002);
}

}  // namespace
}  // namespace ols

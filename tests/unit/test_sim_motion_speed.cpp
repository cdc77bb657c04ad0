// SPDX-License-Identifier: MIT
// What the knobs for speed cost in truth: shadows on a lattice and merged samples, against none of it.
// links: ols_stagesim
#include <gtest/gtest.h>

#include <cmath>

#include "render/renderer.hpp"
#include "sim_scenes.hpp"

using namespace ols;

namespace {

const std::vector<Vec3> three_lamps = {{0.6, 0.5, 0.6}, {-0.8, 0.1, 0.6}, {0.1, -0.9, 0.3}};

// A large ball whose neighbours throw shadows on it and on the wall behind.
Scene shadowed_scene() {
    Scene scene;
    scene.samples = 1;
    add_sphere(scene, {0, 0, 0}, 0.12, matte(0.6f));
    add_sphere(scene, {0.11, 0.09, 0.11}, 0.04, matte(0.6f));
    add_sphere(scene, {-0.16, 0.02, 0.05}, 0.03, matte(0.6f));
    add_quad(scene, {0, 0, -0.15}, {0, 0, 1}, {0, 1, 0}, 1, matte(0.5f));
    return scene;
}

struct Picture {
    Image image;
    uint64_t rays = 0;
};

Picture render(const Scene& scene, const StageConfig& stage) {
    Renderer renderer({scene, stage, stage.cameras[0], false}, {});
    Picture picture{renderer.light(std::vector<Float3>(stage.lamps.size(), {1, 1, 1}), 0), 0};
    for (const auto& row : renderer.effects().rows())
        if (row.name == "shadows") picture.rays = row.evaluations;
    return picture;
}

double relative_rms(const Image& a, const Image& truth) {
    double error = 0, sum = 0;
    for (size_t i = 0; i < truth.data.size(); ++i) {
        error += std::pow(a.data[i] - truth.data[i], 2);
        sum += std::pow(truth.data[i], 2);
    }
    return std::sqrt(error / sum);
}

}  // namespace

TEST(ShadowLattice, casts_a_fraction_of_the_rays_and_is_the_same_where_shadows_are_larger_than_its_step) {
    Scene scene = shadowed_scene();
    const StageConfig stage = small_stage(three_lamps, 320, 240);
    const Picture exact = render(scene, stage);
    for (const int step : {3, 5}) {
        scene.shadow_step_px = step;
        const Picture lattice = render(scene, stage);
        EXPECT_LT(double(lattice.rays), 0.45 * double(exact.rays)) << step;
        // A shadow's corner that reaches into a cell between its four corners is missed.
        size_t differing = 0;
        for (size_t i = 0; i < exact.image.data.size(); ++i) differing += lattice.image.data[i] != exact.image.data[i];
        EXPECT_LT(double(differing), 5e-4 * double(exact.image.data.size())) << step;
        EXPECT_LT(relative_rms(lattice.image, exact.image), 0.01) << step;
    }
}

TEST(ShadowLattice, misses_the_shadow_of_a_thread_thinner_than_its_step) {
    Scene scene;
    scene.samples = 1;
    add_quad(scene, {0, 0, 0}, {0, 0, 1}, {0, 1, 0}, 1, matte(0.5f));
    // Beads of 1 mm, half a pixel, high above a wall: their shadows fall where the lamp puts them, aside of themselves.
    for (int i = 0; i < 40; ++i) add_sphere(scene, {0.2 + 0.0015 * i, 0.011 * (i % 7), 0.3}, 0.001, matte(0.5f));
    const StageConfig stage = small_stage({normalized(Vec3{0.7, 0, 0.7})}, 320, 240);
    const Picture exact = render(scene, stage);
    scene.shadow_step_px = 5;
    const Picture lattice = render(scene, stage);
    int missed = 0, shadowed = 0;
    for (size_t i = 0; i < exact.image.data.size(); i += 3) {
        shadowed += exact.image.data[i] == 0;
        missed += exact.image.data[i] == 0 && lattice.image.data[i] > 0;
    }
    ASSERT_GT(shadowed, 10);
    EXPECT_GT(missed, shadowed / 2);
}

// A textured scene of 4 samples: merging shades a quarter of the points and must stay far closer to the truth of 4
// than one sample is.
TEST(MergedSamples, shade_a_quarter_of_the_points_and_keep_the_picture) {
    Scene scene = shadowed_scene();
    scene.materials[0].type = MaterialType::hair;
    scene.materials[3].type = MaterialType::skin;
    const StageConfig stage = small_stage(three_lamps, 160, 120);
    const Image one = render(scene, stage).image;
    scene.samples = 4;
    const Picture truth = render(scene, stage);
    scene.merges_samples = true;
    const Picture merged = render(scene, stage);
    EXPECT_LT(double(merged.rays), 0.32 * double(truth.rays));
    EXPECT_LT(relative_rms(merged.image, truth.image), 0.25 * relative_rms(one, truth.image));
}

// Pores and creases finer than a pixel: the mean of their light, not the light of their mean.
TEST(MergedSamples, of_fine_relief_give_its_mean_light) {
    Scene scene;
    Material skin = matte(0.5f);
    skin.type = MaterialType::skin;
    add_quad(scene, {}, {0, 0, 1}, {0, 1, 0}, 0.4, skin);
    const StageConfig stage = small_stage({normalized(Vec3{0.6, 0.5, 0.6})}, 64, 48);
    scene.samples = 1;
    const Image one = render(scene, stage).image;
    scene.samples = 16;
    const Image truth = render(scene, stage).image;
    scene.merges_samples = true;
    EXPECT_LT(relative_rms(render(scene, stage).image, truth), 0.05 * relative_rms(one, truth));
}

// A ball whose pixels are so wide that the mean of a pixel's points lies under the surface.
TEST(MergedSamples, of_a_bulge_do_not_lie_in_its_own_shadow) {
    Scene scene;
    add_sphere(scene, {}, 0.05, matte(0.6f));
    scene.objects[0].is_convex = false;
    const StageConfig stage = small_stage({{0, 0, 1}}, 64, 48);
    const Image truth = render(scene, stage).image;
    scene.merges_samples = true;
    EXPECT_LT(relative_rms(render(scene, stage).image, truth), 0.01);
}

TEST(MergedSamples, do_not_mix_what_stands_behind_with_what_stands_before) {
    // A card's border runs through the pixels: half card, half wall in shadow-free light.
    Scene scene;
    add_quad(scene, {0.0007, 0, 0.2}, {0, 0, 1}, {0, 1, 0}, 0.1, matte(0.8f));
    add_quad(scene, {0, 0, -0.2}, {0, 0, 1}, {0, 1, 0}, 1, matte(0.05f));
    const StageConfig stage = small_stage({{0, 0, 1}}, 64, 48);
    const Image truth = render(scene, stage).image;
    scene.merges_samples = true;
    const Image merged = render(scene, stage).image;
    // Where the card's shadow ends on the wall, the middle of a pixel's samples stands for all: a wall's brightness, 0.035,
    // is the most that this may cost. A mixture of card and wall would be 0.2 off.
    for (size_t i = 0; i < truth.data.size(); ++i) ASSERT_NEAR(merged.data[i], truth.data[i], 0.035) << i;
}

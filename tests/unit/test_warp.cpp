// SPDX-License-Identifier: MIT
// The warp of integer counts against bilinear interpolation in double precision, on every SIMD path.
// links: ols_develop
#include "develop/warp.hpp"

#include <gtest/gtest.h>
#include <hwy/targets.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <functional>
#include <random>

#include "demultiplex/masked_sample.hpp"
#include "stage/lamps.hpp"

using namespace ols;

namespace {

constexpr int16_t masked = masked_sample<int16_t>;

struct Scene {
    int width, height;
    std::vector<int16_t> counts;
    FlowField base, step;
    float fraction = 0.3f;
    int largest = 4095;
    float tolerance_steps = 0;
    int step_px = 1;  // of the grid

    Scene(int w, int h, int most = 4095)
        : width(w), height(h), counts(size_t(w) * size_t(h)), base(w, h), step(w, h), largest(most) {
        std::mt19937 random(5);
        for (auto& c : counts) c = int16_t(int(random() % unsigned(2 * most + 1)) - most);
    }
    // By x, y; shared out among base and step, of which either is a line only where `is_smooth`.
    void set_motion(const std::function<Vec3(int, int)>& at, bool is_smooth = false) {
        for (int y = 0; y < height; ++y)
            for (int x = 0; x < width; ++x) {
                const Vec3 d = at(x, y);
                const size_t p = size_t(y) * size_t(width) + size_t(x);
                step.u[p] = is_smooth ? 1 : float(x % 3) - 1;
                step.v[p] = float(y % 2);
                base.u[p] = float(d.x) - fraction * step.u[p];
                base.v[p] = float(d.y) - fraction * step.v[p];
            }
    }
    std::vector<int16_t> warped() const {
        std::vector<int16_t> out(counts.size());
        warp_counts({counts.data(), grid(), size_t(width), largest}, motion(), fraction, out.data(), size_t(width));
        return out;
    }
    SampleGrid grid() const { return {width, height, step_px}; }
    GroupMotion motion() const { return {base, step, grid(), tolerance_steps}; }
    // By definition, among the samples of the same colour; NaN where it must be masked.
    double truth(int x, int y) const {
        const size_t p = size_t(y) * size_t(width) + size_t(x);
        const int color_x = x % step_px, color_y = y % step_px;
        const int columns = (width - color_x + step_px - 1) / step_px,
                  rows = (height - color_y + step_px - 1) / step_px;
        const auto vector = [&](float from, float change) {
            return from / float(step_px) + fraction * (change / float(step_px));
        };
        const double px = float(x / step_px) + vector(base.u[p], step.u[p]),
                     py = float(y / step_px) + vector(base.v[p], step.v[p]);
        if (!(px >= 0 && py >= 0 && px <= columns - 1 && py <= rows - 1)) return NAN;
        const int ix = int(px), iy = int(py);
        double sum = 0;
        for (const int dy : {0, 1})
            for (const int dx : {0, 1}) {
                const double weight = (dx ? px - ix : 1 - (px - ix)) * (dy ? py - iy : 1 - (py - iy));
                if (weight == 0) continue;
                const int16_t c = counts[size_t((iy + dy) * step_px + color_y) * size_t(width) +
                                         size_t((ix + dx) * step_px + color_x)];
                if (c == masked) return NAN;
                sum += weight * c;
            }
        return sum;
    }
    void expect_true(double tolerance, int margin = 0) const {
        const auto out = warped();
        for (int y = margin; y < height - margin; ++y)
            for (int x = margin; x < width - margin; ++x) {
                const double wanted = truth(x, y);
                const int16_t got = out[size_t(y) * size_t(width) + size_t(x)];
                if (std::isnan(wanted))
                    ASSERT_EQ(got, masked) << x << " " << y;
                else
                    ASSERT_NEAR(got, wanted, tolerance) << x << " " << y;
            }
    }
};

// A weight is off by 2^-16 at most, and by 2^-15 where it would be 1. With two more bits, the three interpolations round
// by half a unit of 1/4 count each and may add 8190 2^-15 for the weights; the result rounds by half a count.
constexpr double tolerance_12_bits = 0.5 + 3 * 0.125 + 3 * 8190 / 65536.0;
constexpr double tolerance_14_bits = 0.5 + 3 * 0.5 + 3 * 32766 / 65536.0;

class Warp : public testing::TestWithParam<int64_t> {
  protected:
    Warp() { hwy::SetSupportedTargetsForTest(GetParam()); }
    ~Warp() override { hwy::SetSupportedTargetsForTest(0); }
};
INSTANTIATE_TEST_SUITE_P(, Warp, testing::ValuesIn(hwy::SupportedAndGeneratedTargets()),
                         [](const auto& target) { return hwy::TargetName(target.param); });

TEST_P(Warp, smooth_motion_is_bilinear_interpolation) {
    Scene scene(83, 41);
    scene.set_motion([](int x, int y) { return Vec3{2.3 + 0.02 * y, -1.4 + 0.03 * x, 0}; });
    scene.expect_true(tolerance_12_bits);
}

TEST_P(Warp, wild_motion_is_bilinear_interpolation_too) {
    Scene scene(64, 48);
    std::mt19937 random(3);
    std::uniform_real_distribution<double> any(-40, 40);
    scene.set_motion([&](int, int) { return Vec3{any(random), any(random), 0}; });
    scene.expect_true(tolerance_12_bits);
}

// On lines a position is off by 2^-10 steps and the tolerance; the image has a slope of 100 counts a pixel at most.
TEST_P(Warp, motion_on_lines_is_bilinear_interpolation_of_positions_nearby) {
    Scene scene(176, 41);
    for (int p = 0; p < 176 * 41; ++p)
        scene.counts[size_t(p)] = int16_t(2000 * std::sin(p % 176 * 0.03) + 1000 * std::cos(p / 176 * 0.04));
    scene.set_motion([](int x, int y) { return Vec3{2.3 + 0.02 * y + 0.3 * x, -1.4 + 0.03 * x, 0}; }, true);
    scene.tolerance_steps = 0.02f;
    EXPECT_EQ(scene.motion().linear_share(), 1);
    scene.expect_true(tolerance_12_bits + 100 * (0.02 + 1 / 1024.0), 2);
}

TEST_P(Warp, an_edge_of_motion_within_a_run_keeps_its_own_vectors) {
    Scene scene(96, 20);
    scene.set_motion([](int x, int) { return Vec3{x < 43 ? 0.25 : 3.5, 0.5, 0}; }, true);
    scene.tolerance_steps = 0.02f;
    const double share = scene.motion().linear_share();
    EXPECT_GT(share, 0);
    EXPECT_LT(share, 1);
    for (auto& count : scene.counts) count = int16_t(1000 + count % 8);
    scene.expect_true(tolerance_12_bits + 16 * (0.02 + 1 / 1024.0));
}

TEST_P(Warp, planes_narrower_than_a_register_work) {
    for (const int width : {1, 2, 7, 8, 15, 16, 17, 31, 33}) {
        Scene scene(width, 5);
        scene.set_motion([](int, int) { return Vec3{0.6, 0.25, 0}; });
        scene.expect_true(tolerance_12_bits);
    }
}

TEST_P(Warp, counts_of_14_bits_do_not_overflow) {
    Scene scene(40, 9, 16383);
    scene.set_motion([](int x, int) { return Vec3{0.5, x * 0.01, 0}; });
    scene.expect_true(tolerance_14_bits);
}

TEST_P(Warp, no_motion_changes_nothing_and_spreads_no_mask) {
    Scene scene(50, 20);
    for (size_t p = 0; p < scene.counts.size(); p += 11) scene.counts[p] = masked;
    scene.fraction = 0;
    EXPECT_EQ(scene.warped(), scene.counts);
}

TEST_P(Warp, a_masked_count_masks_what_it_has_a_part_in) {
    Scene scene(40, 30);
    for (size_t p = 5; p < scene.counts.size(); p += 97) scene.counts[p] = masked;
    scene.set_motion([](int x, int y) { return Vec3{0.3 + 0.01 * y, 0.2 + 0.01 * x, 0}; });
    scene.expect_true(tolerance_12_bits);
}

TEST_P(Warp, a_plane_that_holds_its_edges_shows_them_beyond) {
    Scene scene(41, 19);
    scene.set_motion([](int x, int y) { return Vec3{x < 20 ? -30.25 : 30.25, y < 9 ? -25.5 : 25.5, 0}; });
    std::vector<int16_t> out(scene.counts.size());
    warp_counts({scene.counts.data(), scene.grid(), 41, 4095, true}, scene.motion(), scene.fraction, out.data(), 41);
    std::vector<float> floats(scene.counts.begin(), scene.counts.end()), seen(floats.size());
    warp_samples({floats.data(), scene.grid(), 41, true}, scene.motion(), scene.fraction, {0, 19}, seen.data(), 41);
    for (int y = 0; y < 19; ++y)
        for (int x = 0; x < 41; ++x) {
            const int16_t corner = scene.counts[size_t(y < 9 ? 0 : 18) * 41 + (x < 20 ? 0 : 40)];
            const size_t p = size_t(y) * 41 + size_t(x);
            ASSERT_EQ(out[p], corner) << x << " " << y;
            ASSERT_EQ(seen[p], float(corner)) << x << " " << y;
        }
}

// What leads out is read from the margin instead; there lines are followed in coarser units.
TEST_P(Warp, a_margin_changes_a_count_by_no_more_than_a_lines_rounding) {
    constexpr int margin = 16, width = 96, height = 40;
    Scene scene(width, height);
    scene.step_px = 2;
    scene.tolerance_steps = 0.02f;
    for (int p = 0; p < width * height; ++p)
        scene.counts[size_t(p)] = int16_t(40 * (p % width) + 20 * (p / width) - 2000);
    scene.set_motion([](int x, int y) { return Vec3{x * 0.01 - 9.37, y * 0.02 - 7.21, 0}; }, true);
    EXPECT_EQ(scene.motion().linear_share(), 1);
    constexpr size_t pitch = width + 2 * margin;
    std::vector<int16_t> wide(pitch * (height + 2 * margin));
    const auto held = [](int at, int size) { return at < 0 ? at & 1 : at >= size ? size - 2 + (at & 1) : at; };
    for (int y = -margin; y < height + margin; ++y)
        for (int x = -margin; x < width + margin; ++x)
            wide[size_t(y + margin) * pitch + size_t(x + margin)] =
                scene.counts[size_t(held(y, height)) * width + size_t(held(x, width))];
    std::vector<int16_t> without(scene.counts.size()), with(scene.counts.size());
    warp_counts({scene.counts.data(), scene.grid(), width, 4095, true}, scene.motion(), scene.fraction, without.data(),
                width);
    warp_counts({&wide[margin * pitch + margin], scene.grid(), pitch, 4095, true, margin}, scene.motion(),
                scene.fraction, with.data(), width);
    for (size_t p = 0; p < with.size(); ++p) ASSERT_NEAR(with[p], without[p], 1) << p;
}

// Runs on lines, without a rounding of positions: eighths.
TEST_P(Warp, counts_of_14_bits_on_lines_do_not_overflow) {
    Scene scene(160, 24, 16383);
    scene.fraction = 0.5f;
    scene.set_motion([](int x, int y) { return Vec3{(x + y) / 8.0 - 12, x / 16.0 - 3, 0}; }, true);
    scene.tolerance_steps = 0.02f;
    EXPECT_EQ(scene.motion().linear_share(), 1);
    scene.expect_true(tolerance_14_bits);
}

TEST_P(Warp, no_motion_on_lines_changes_nothing_and_spreads_no_mask) {
    for (const int step : {1, 2}) {
        Scene scene(83, 20);
        scene.step_px = step;
        for (size_t p = 0; p < scene.counts.size(); p += 11) scene.counts[p] = masked;
        scene.tolerance_steps = 0.02f;
        EXPECT_EQ(scene.warped(), scene.counts);
    }
}

TEST_P(Warp, flow_that_is_no_number_masks) {
    Scene scene(32, 4);
    scene.base.u[3] = NAN;
    scene.base.v[70] = INFINITY;
    const auto out = scene.warped();
    EXPECT_EQ(out[3], masked);
    EXPECT_EQ(out[70], masked);
}

// In a mosaic each colour is interpolated among its own samples, by lines, by vectors of its own, and at odd sizes.
TEST_P(Warp, colors_of_a_mosaic_do_not_mix) {
    for (const auto& [width, height] : {std::pair{96, 40}, {83, 41}, {20, 6}, {17, 3}, {5, 4}, {1, 1}}) {
        Scene scene(width, height);
        scene.step_px = 2;
        for (size_t p = 5; p < scene.counts.size(); p += 97) scene.counts[p] = masked;
        scene.set_motion([](int x, int y) { return Vec3{4.3 + 0.02 * y + 0.01 * x, -2.9 + 0.03 * x, 0}; });
        scene.expect_true(tolerance_12_bits);
    }
}

// Colours that differ by far more than a mean of two of them would allow.
TEST_P(Warp, lines_in_a_mosaic_show_every_color_as_it_was) {
    Scene scene(160, 40);
    scene.step_px = 2;
    for (int p = 0; p < 160 * 40; ++p) {
        const int x = p % 160, y = p / 160;
        scene.counts[size_t(p)] = int16_t(1000 * (x % 2 + 2 * (y % 2)) + 3 * x);
    }
    scene.set_motion([](int x, int y) { return Vec3{2.6 + 0.02 * y + 0.03 * x, -1.4 + 0.05 * x, 0}; }, true);
    scene.tolerance_steps = 0.02f;
    EXPECT_EQ(scene.motion().linear_share(), 1);
    scene.expect_true(tolerance_12_bits + 6 * (0.02 + 1 / 1024.0), 4);
}

TEST(WarpPaths, give_the_same_bits) {
    Scene scene(97, 33);
    scene.set_motion([](int x, int y) { return Vec3{std::sin(x * 0.3) * 6, std::cos(y * 0.2) * 4, 0}; });
    std::vector<std::vector<int16_t>> results;
    for (const int64_t target : hwy::SupportedAndGeneratedTargets()) {
        hwy::SetSupportedTargetsForTest(target);
        results.push_back(scene.warped());
    }
    hwy::SetSupportedTargetsForTest(0);
    for (const auto& result : results) EXPECT_EQ(result, results[0]);
}

TEST_P(Warp, rows_by_themselves_are_the_rows_of_the_whole_plane) {
    Scene scene(97, 33);
    scene.set_motion([](int x, int y) { return Vec3{std::sin(x * 0.3) * 6, std::cos(y * 0.2) * 4, 0}; }, true);
    scene.tolerance_steps = 0.02f;
    const auto whole = scene.warped();
    const GroupMotion motion = scene.motion();
    const CountPlane source{scene.counts.data(), scene.grid(), 97};
    std::vector<int16_t> rows(whole.size());
    for (int y = 0; y < 33; y += 7)
        warp_counts(source, motion, scene.fraction, {y, std::min(7, 33 - y)}, &rows[size_t(y) * 97], 97);
    EXPECT_EQ(rows, whole);
}

// Samples that no camera quantised.
std::vector<float> warped_samples(const Scene& scene, const std::vector<float>& samples) {
    std::vector<float> out(samples.size());
    const SamplePlane source{samples.data(), scene.grid(), size_t(scene.width)};
    const GroupMotion motion = scene.motion();
    const int half = scene.height / 2;
    warp_samples(source, motion, scene.fraction, {0, half}, out.data(), size_t(scene.width));
    warp_samples(source, motion, scene.fraction, {half, scene.height - half}, &out[size_t(half * scene.width)],
                 size_t(scene.width));
    return out;
}

TEST(SampleWarp, is_bilinear_interpolation_without_rounding) {
    Scene scene(83, 41);
    scene.set_motion([](int x, int y) { return Vec3{2.3 + 0.02 * y, -1.4 + 0.03 * x, 0}; });
    for (size_t p = 0; p < scene.counts.size(); p += 31) scene.counts[p] = masked;
    std::vector<float> samples;
    for (const int16_t count : scene.counts) samples.push_back(count == masked ? NAN : float(count));
    const auto out = warped_samples(scene, samples);
    for (int y = 0; y < 41; ++y)
        for (int x = 0; x < 83; ++x) {
            const double wanted = scene.truth(x, y);
            const float got = out[size_t(y * 83 + x)];
            ASSERT_EQ(std::isnan(got), std::isnan(wanted)) << x << " " << y;
            if (!std::isnan(wanted)) {
                ASSERT_NEAR(got, wanted, 4095 * 4e-7) << x << " " << y;
            }
        }
}

TEST(SampleWarp, without_motion_returns_the_bits_of_its_input) {
    Scene scene(40, 9);
    scene.fraction = 0.7f;
    std::vector<float> samples(360);
    std::mt19937 random(8);
    for (float& s : samples) s = std::ldexp(float(random()), -40) - 0.25f;
    samples[3] = -0.0f, samples[7] = NAN, samples[8] = 1e-41f, samples[359] = -3e38f;
    const auto out = warped_samples(scene, samples);
    for (size_t p = 0; p < samples.size(); ++p) {
        if (p == 7) continue;
        ASSERT_EQ(std::bit_cast<uint32_t>(out[p]), std::bit_cast<uint32_t>(samples[p])) << p;
    }
    EXPECT_TRUE(std::isnan(out[7]));
}

TEST(SampleWarp, infinite_samples_and_flow_that_is_no_number_become_masked) {
    Scene scene(32, 4);
    std::vector<float> samples(128, 1);
    samples[40] = INFINITY;
    scene.base.u[3] = NAN;
    scene.base.v[70] = -INFINITY;
    const auto out = warped_samples(scene, samples);
    for (size_t p = 0; p < out.size(); ++p) EXPECT_EQ(std::isnan(out[p]), p == 3 || p == 40 || p == 70) << p;
}

// Runs that lie on lines, that slip, and that do neither, each beside each.
TEST(WarpPaths, give_the_same_bits_where_runs_of_all_kinds_meet) {
    Scene scene(206, 60);
    std::mt19937 random(9);
    scene.set_motion(
        [&](int x, int y) {
            const int kind = (x / 16 * 7 + y * 5) % 11;
            const double rough = kind < 3 ? double(random() % 100) / 50 : 0;
            return Vec3{0.7 + 0.02 * x + rough + (kind == 5 ? 1e3 : 0),
                        -0.3 + 0.05 * x - (kind == 7 ? 0.4 * (x % 8) : 0), 0};
        },
        true);
    for (size_t p = 0; p < scene.counts.size(); p += 53) scene.counts[p] = masked;
    scene.tolerance_steps = 0.02f;
    std::vector<std::vector<int16_t>> results;
    for (const int64_t target : hwy::SupportedAndGeneratedTargets()) {
        hwy::SetSupportedTargetsForTest(target);
        results.push_back(scene.warped());
        hwy::SetSupportedTargetsForTest(0);
    }
    ASSERT_GT(results.size(), 1u);
    for (const auto& result : results) EXPECT_EQ(result, results[0]);
}

TEST_P(Warp, lines_that_slip_a_row_or_a_column_mask_what_masked_counts_have_a_part_in) {
    Scene scene(160, 40);
    for (auto& count : scene.counts) count = 1000;
    for (size_t p = 5; p < scene.counts.size(); p += 97) scene.counts[p] = masked;
    scene.fraction = 0.5f;
    // Eighths, so that lines are exact and some positions whole.
    scene.set_motion([](int x, int y) { return Vec3{(x + y) / 8.0 - 12, x / 16.0 - 3, 0}; }, true);
    scene.tolerance_steps = 0.02f;
    EXPECT_EQ(scene.motion().linear_share(), 1);
    scene.expect_true(tolerance_12_bits);
}

// What a frame's motion must be: the fields enlarged by OpenCV, in steps of the grid.
void expect_vectors_of_enlarged(const FlowField& base, const FlowField& step, const SampleGrid& grid,
                                double tolerance) {
    const FlowField large_base = resized(base, grid.width, grid.height);
    const FlowField large_step = resized(step, grid.width, grid.height);
    const GroupMotion motion(base, step, grid, 1e-6f);
    const size_t width = size_t(grid.width);
    std::vector<float> u(width), v(width);
    for (int row = 0; row < grid.height; ++row) {
        motion.vectors(row, 0.25f, u.data(), v.data());
        for (size_t k = 0; k < width; ++k) {
            const size_t at = size_t(row) * width + k;
            const float wanted_u = large_base.u[at] + 0.25f * large_step.u[at],
                        wanted_v = large_base.v[at] + 0.25f * large_step.v[at];
            ASSERT_NEAR(u[k], wanted_u / float(grid.step), tolerance) << k << " " << row;
            ASSERT_NEAR(v[k], wanted_v / float(grid.step), tolerance) << k << " " << row;
        }
    }
}

FlowField wavy(int width, int height) {
    FlowField flow(width, height);
    for (size_t p = 0; p < flow.size(); ++p) {
        flow.u[p] = float(std::sin(double(p) * 0.7) * 3);
        flow.v[p] = float(std::cos(double(p) * 1.3) * 2);
    }
    return flow;
}

TEST(GroupMotionOfLowResolution, is_bilinear_in_between_for_frames_and_mosaics) {
    for (const int lower : {1, 2, 4})
        for (const SampleGrid& grid : {SampleGrid{104, 48}, SampleGrid{104, 48, 2}, SampleGrid{8, 4, 2}}) {
            const FlowField base = wavy(grid.width / lower, grid.height / lower);
            expect_vectors_of_enlarged(base, resized(base, base.width, base.height), grid, 1e-4);
        }
}

TEST(GroupMotionOfLowResolution, is_enlarged_first_where_frames_are_no_multiple) {
    expect_vectors_of_enlarged(wavy(34, 17), wavy(34, 17), {67, 33}, 1e-4);
    expect_vectors_of_enlarged(wavy(33, 17), wavy(33, 17), {67, 33, 2}, 1e-4);
}

// What breaks it: a motion edge finer than the field is smeared over a field's pixel.
TEST(GroupMotionOfLowResolution, smears_an_edge_over_a_pixel_of_the_field) {
    FlowField base(16, 4);
    for (size_t p = 0; p < base.size(); ++p) base.u[p] = p % 16 < 8 ? 0 : 4;
    const GroupMotion motion(base, FlowField(16, 4), {32, 8});
    std::vector<float> u(32), v(32);
    motion.vectors(3, 0, u.data(), v.data());
    EXPECT_EQ(u[14], 0);
    EXPECT_EQ(u[15], 2);
    EXPECT_EQ(u[16], 6);
    EXPECT_EQ(u[17], 8);
}

// By definition, for each pixel; fields with but one row or column included.
TEST(Concatenation, is_the_sum_of_a_vector_and_the_bilinear_one_where_it_leads) {
    for (const auto& [width, height] : {std::pair{37, 11}, {4, 1}, {1, 5}, {2, 2}, {1, 1}}) {
        FlowField a = wavy(width, height);
        FlowField b = wavy(width, height);
        std::reverse(b.u.begin(), b.u.end());
        a.u[0] = 1e6f, a.v.back() = -1e6f;
        const FlowField sum = concatenated(a, b), seen = seen_from_target(a, b);
        for (int y = 0; y < height; ++y)
            for (int x = 0; x < width; ++x) {
                const size_t p = size_t(y) * size_t(width) + size_t(x);
                const double px = std::clamp(double(float(x) + a.u[p]), 0.0, width - 1.0);
                const double py = std::clamp(double(float(y) + a.v[p]), 0.0, height - 1.0);
                const auto bilinear = [&, width = width, height = height](const std::vector<float>& plane) {
                    double value = 0;
                    for (int j = 0; j < height; ++j)
                        for (int i = 0; i < width; ++i)
                            value += std::max(0.0, 1 - std::abs(px - i)) * std::max(0.0, 1 - std::abs(py - j)) *
                                     double(plane[size_t(j) * size_t(width) + size_t(i)]);
                    return value;
                };
                ASSERT_NEAR(seen.u[p], bilinear(b.u), 1e-4);
                ASSERT_NEAR(seen.v[p], bilinear(b.v), 1e-4);
                ASSERT_FLOAT_EQ(sum.u[p], a.u[p] + seen.u[p]);
                ASSERT_FLOAT_EQ(sum.v[p], a.v[p] + seen.v[p]);
            }
    }
}

TEST(Concatenation, of_a_vector_that_is_no_number_is_none) {
    FlowField a(8, 2);
    a.u[5] = NAN;
    const FlowField sum = concatenated(a, wavy(8, 2));
    EXPECT_TRUE(std::isnan(sum.u[5]));
    EXPECT_FALSE(std::isnan(sum.u[4]));
}

// Rotation about a point, twice: concatenation is the rotation by both angles.
TEST(Concatenation, of_two_rotations_is_their_rotation) {
    const auto rotation = [](double angle) {
        FlowField flow(64, 64);
        for (int y = 0; y < 64; ++y)
            for (int x = 0; x < 64; ++x) {
                const double dx = x - 31.5, dy = y - 31.5;
                flow.u[size_t(y * 64 + x)] = float(dx * std::cos(angle) - dy * std::sin(angle) - dx);
                flow.v[size_t(y * 64 + x)] = float(dx * std::sin(angle) + dy * std::cos(angle) - dy);
            }
        return flow;
    };
    const FlowField sum = concatenated(rotation(0.1), rotation(0.05)), truth = rotation(0.15);
    for (int y = 16; y < 48; ++y)
        for (int x = 16; x < 48; ++x) {
            ASSERT_NEAR(sum.u[size_t(y * 64 + x)], truth.u[size_t(y * 64 + x)], 1e-4);
            ASSERT_NEAR(sum.v[size_t(y * 64 + x)], truth.v[size_t(y * 64 + x)], 1e-4);
        }
}

}  // namespace

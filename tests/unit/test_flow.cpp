// SPDX-License-Identifier: MIT
// Every flow method against motions known in closed form; what keeps and what breaks it.
// links: ols_flow
#include <gtest/gtest.h>

#include <hwy/highway.h>
#include <opencv2/core.hpp>

#include "flow/flow.hpp"
#include "flow_scenes.hpp"

using namespace ols;
using namespace ols::scenes;

namespace {

constexpr int width = 224, height = 160;

FlowField flow_of(const FlowScene& scene, const std::string& method) {
    Result<FlowOptions> options = flow_method(method);
    EXPECT_TRUE(options);
    Result<FlowField> flow = estimate_flow(scene.from, scene.to, *options);
    EXPECT_TRUE(flow) << flow.error().message;
    return *flow;
}

FlowScene moving_plane(const Motion& motion, unsigned seed = 11) {
    return plane_scene("plane", width, height, value_noise(seed, 6), motion);
}

Motion shift(double x, double y) {
    return similarity(0, 1, x, y, 0, 0);
}

FlowScene disc_before_plane() {
    return layers_scene("layers", width, height, value_noise(21, 5), shift(5, 2), value_noise(22, 5), shift(-1, 0), 45);
}

bool same_bits(const FlowField& a, const FlowField& b) {
    return a.u == b.u && a.v == b.v;
}

}  // namespace

class FlowMethod : public testing::TestWithParam<std::string> {
  protected:
    // What a method is held to on clean scenes, in pixels: those that end at half resolution or take 8 bits know less.
    double bound() const {
        const bool halved = GetParam() == "brox-quick" || GetParam().ends_with("-half");
        return halved || GetParam().starts_with("dis") ? 0.25 : 0.05;
    }
};

TEST_P(FlowMethod, follows_a_shift) {
    EXPECT_LT(endpoint_error(flow_of(moving_plane(shift(3.3, -1.7)), GetParam()), moving_plane(shift(3.3, -1.7))),
              bound());
}

TEST_P(FlowMethod, follows_a_rotation) {
    const FlowScene scene = moving_plane(similarity(2, 1, 0.4, 0, width / 2.0, height / 2.0));
    EXPECT_LT(endpoint_error(flow_of(scene, GetParam()), scene), bound());
}

TEST_P(FlowMethod, follows_a_zoom) {
    const FlowScene scene = moving_plane(similarity(0, 1.03, 0, 0.3, width / 2.0, height / 2.0));
    EXPECT_LT(endpoint_error(flow_of(scene, GetParam()), scene), bound());
}

TEST_P(FlowMethod, keeps_apart_a_disc_and_the_plane_behind_it) {
    const FlowScene scene = disc_before_plane();
    const FlowField flow = flow_of(scene, GetParam());
    EXPECT_LT(endpoint_error(flow, scene), 0.6);  // mixing the layers would cost pixels around the disc's rim
    const size_t in_disc = size_t(height / 2) * width + width / 2, behind = size_t(20) * width + 20;
    EXPECT_NEAR(flow.u[in_disc], 5, 0.3);
    EXPECT_NEAR(flow.u[behind], -1, 0.3);
}

TEST_P(FlowMethod, sees_a_still_image_still) {
    const FlowScene scene = moving_plane(shift(0, 0));
    const FlowField flow = flow_of(scene, GetParam());
    for (const float v : flow.u) ASSERT_EQ(v, 0);
    for (const float v : flow.v) ASSERT_EQ(v, 0);
}

TEST_P(FlowMethod, gives_the_same_bits_twice_and_for_any_thread_count) {
    const FlowScene scene = noisy(disc_before_plane());
    cv::setNumThreads(1);
    const FlowField alone = flow_of(scene, GetParam());
    cv::setNumThreads(4);
    EXPECT_TRUE(same_bits(alone, flow_of(scene, GetParam())));
    EXPECT_TRUE(same_bits(alone, flow_of(scene, GetParam())));
}

TEST_P(FlowMethod, does_not_mind_unequal_exposure) {
    FlowScene scene = moving_plane(shift(2.4, 1.2));
    for (float& v : scene.to.data) v = 1.4f * v + 30;
    EXPECT_LT(endpoint_error(flow_of(scene, GetParam()), scene), bound());
}

TEST_P(FlowMethod, begins_with_the_flow_that_it_is_given) {
    // 8 pixels a period cannot tell 5 from -3; a beginning near 5 can. Some methods stay where they begin.
    FlowScene scene = plane_scene(
        "periodic", width, height,
        [](double x, double y) { return 0.5 + 0.25 * (std::sin(x * M_PI / 4) + std::sin(y * M_PI / 4)); }, shift(5, 0));
    FlowField near(width, height);
    std::fill(near.u.begin(), near.u.end(), 4.8f);
    const Result<FlowField> led = estimate_flow(scene.from, scene.to, *flow_method(GetParam()), &near);
    ASSERT_TRUE(led);
    EXPECT_LT(endpoint_error(*led, scene, 24), 0.3);
}

INSTANTIATE_TEST_SUITE_P(Methods, FlowMethod, testing::ValuesIn(flow_method_names()), [](const auto& info) {
    std::string name = info.param;
    std::replace(name.begin(), name.end(), '-', '_');
    return name;
});

TEST(Flow, our_methods_err_far_less_than_dis_medium_on_clean_scenes) {
    double dis = 0, robust = 0, brox = 0;
    for (const FlowScene& scene :
         {moving_plane(shift(2.7, 4.1), 31), moving_plane(similarity(1, 1.01, 1, 1, 60, 60), 32),
          ball_scene("ball", width, height, value_noise(33, 5), 1)}) {
        dis += endpoint_error(flow_of(scene, "dis-medium"), scene);
        robust += endpoint_error(flow_of(scene, "robust"), scene);
        brox += endpoint_error(flow_of(scene, "brox"), scene);
    }
    EXPECT_LT(robust, 0.6 * dis);
    EXPECT_LT(brox, 0.6 * dis);
}

TEST(Flow, gives_the_same_bits_on_every_vector_path) {
    const FlowScene scene = disc_before_plane();
    for (const std::string method : {"robust", "brox"}) {
        const FlowField best = flow_of(scene, method);
        for (const int64_t target : hwy::SupportedAndGeneratedTargets()) {
            hwy::SetSupportedTargetsForTest(target);
            EXPECT_TRUE(same_bits(best, flow_of(scene, method))) << method << " " << hwy::TargetName(target);
            hwy::SetSupportedTargetsForTest(0);
        }
    }
}

TEST(Flow, finds_a_jump_of_sixty_pixels_where_texture_is_coarse_too) {
    const FlowScene scene = plane_scene("jump", 480, 320, value_noise(41, 5, 6), shift(60, 12));
    for (const std::string method : {"dis-medium", "robust", "brox"})
        EXPECT_LT(endpoint_error(flow_of(scene, method), scene, 70), 0.5) << method;
}

TEST(Flow, loses_a_jump_where_all_texture_is_finer_than_it) {
    // The coarse levels see nothing, and the finest takes the nearest likeness: no method that goes from coarse to fine can.
    const FlowScene scene = plane_scene("fine jump", 224, 160, value_noise(42, 3, 1), shift(30, 0));
    EXPECT_GT(endpoint_error(flow_of(scene, "brox"), scene, 40), 5);
}

TEST(Flow, a_hint_leads_where_a_jump_is_lost_and_fades_with_distance) {
    const FlowScene scene = plane_scene("fine jump", width, height, value_noise(42, 3, 1), shift(30, 0));
    const size_t near = size_t(height / 2) * width + width / 2, far = size_t(10) * width + 10;
    EXPECT_GT(std::abs(flow_of(scene, "brox").u[near] - 30), 5);
    BroxFlowOptions options;
    options.hints = {{float(width) / 2, float(height) / 2, 30, 0}};
    options.hint = 1000;
    options.hint_radius = 12;
    const Result<FlowField> hinted = estimate_flow(scene.from, scene.to, {.method = options});
    ASSERT_TRUE(hinted);
    EXPECT_NEAR(hinted->u[near], 30, 0.3);
    EXPECT_GT(std::abs(hinted->u[far] - 30), 5);
}

TEST(Flow, a_given_flow_is_kept_where_it_fits_and_mended_where_it_does_not) {
    const FlowScene scene = moving_plane(shift(2, 0), 51);
    FlowField given(width, height);
    for (int y = 0; y < height; ++y)
        for (int x = 0; x < width; ++x) given.u[size_t(y) * width + size_t(x)] = x < width / 2 ? 2.03f : 0.5f;
    BroxFlowOptions options;
    options.keep = 1;
    const Result<FlowField> refined = estimate_flow(scene.from, scene.to, {.method = options}, &given);
    const Result<FlowField> free = estimate_flow(scene.from, scene.to, {.method = BroxFlowOptions{}}, &given);
    ASSERT_TRUE(refined);
    ASSERT_TRUE(free);
    const size_t fits = size_t(height / 2) * width + width / 4, misfits = size_t(height / 2) * width + 3 * width / 4;
    EXPECT_NEAR(refined->u[fits], 2.03, 0.01);
    EXPECT_GT(refined->u[fits], free->u[fits] + 0.01);
    EXPECT_NEAR(refined->u[misfits], 2, 0.3);
}

TEST(Flow, refinements_mend_a_flow_that_is_nearly_right) {
    const FlowScene scene = moving_plane(similarity(1, 1.01, 7, -4, width / 2.0, height / 2.0), 71);
    FlowField near = scene.truth;
    for (float& u : near.u) u += 0.6f;
    const double before = endpoint_error(near, scene);
    for (const std::string& name : flow_refinement_names()) {
        const Result<FlowField> mended = estimate_flow(scene.from, scene.to, *flow_method(name), &near);
        ASSERT_TRUE(mended) << name;
        EXPECT_LT(endpoint_error(*mended, scene), name == "refine-variational" ? 0.6 * before : before / 4) << name;
    }
}

TEST(Flow, a_refinement_does_not_find_what_is_pixels_away) {
    const FlowScene scene = moving_plane(shift(12, 0), 72);
    const FlowField none(width, height);
    const Result<FlowField> lost = estimate_flow(scene.from, scene.to, *flow_method("refine"), &none);
    ASSERT_TRUE(lost);
    EXPECT_GT(endpoint_error(*lost, scene), 6);
}

TEST(Flow, a_given_flow_is_returned_where_an_image_shows_nothing) {
    const FlowField given = moving_plane(shift(2, 1)).truth;
    const Result<FlowField> kept =
        estimate_flow(moving_plane(shift(2, 1)).from, Image(width, height, 1), *flow_method("refine"), &given);
    ASSERT_TRUE(kept);
    EXPECT_TRUE(same_bits(*kept, given));
}

TEST(Flow, says_what_is_wrong_with_its_input) {
    const Image good(64, 64, 1);
    FlowField broken(64, 64);
    broken.u[5] = NAN;
    const auto message = [](const Result<FlowField>& result) {
        return result ? std::string() : result.error().message;
    };
    EXPECT_NE(message(estimate_flow(good, Image(64, 64, 3))).find("one channel"), std::string::npos);
    EXPECT_NE(message(estimate_flow(good, Image(64, 60, 1))).find("same size"), std::string::npos);
    EXPECT_NE(message(estimate_flow(Image(8, 8, 1), Image(8, 8, 1))).find("16"), std::string::npos);
    EXPECT_NE(message(estimate_flow(Image(), Image())).find("one channel"), std::string::npos);
    EXPECT_NE(message(estimate_flow(good, good, {}, &broken)).find("no numbers"), std::string::npos);
    const FlowField small(32, 32);
    EXPECT_NE(message(estimate_flow(good, good, {}, &small)).find("resize"), std::string::npos);
    EXPECT_NE(message(estimate_flow(good, good, {.method = BroxFlowOptions{.ratio = 1}})).find("ratio"),
              std::string::npos);
    EXPECT_NE(message(estimate_flow(good, good, {.method = RobustFlowOptions{.sweeps = 0}})).find("sweeps"),
              std::string::npos);
    EXPECT_NE(message(estimate_flow(good, good, {.method = BroxFlowOptions{.initial_octaves = -1}})).find("octaves"),
              std::string::npos);
    EXPECT_NE(message(estimate_flow(good, good, {.method = DisFlowOptions{.search = false}})).find("nothing"),
              std::string::npos);
    EXPECT_NE(flow_method("fastest").error().message.find("dis-medium"), std::string::npos);
}

TEST(Confidence, is_one_where_the_way_back_ends_where_it_began) {
    FlowField forward(40, 30), backward(40, 30);
    std::fill(forward.u.begin(), forward.u.end(), 3.0f);
    std::fill(backward.u.begin(), backward.u.end(), -3.0f);
    const std::vector<float> c = confidence(forward, backward);
    EXPECT_EQ(c[10 * 40 + 10], 1);
    EXPECT_EQ(c[10 * 40 + 38], 0);  // leads outside
}

TEST(Confidence, is_a_half_where_the_miss_is_what_is_allowed) {
    FlowField forward(40, 30), backward(40, 30);
    std::fill(forward.u.begin(), forward.u.end(), 10.0f);
    std::fill(backward.u.begin(), backward.u.end(), -10.0f + 0.7f);
    EXPECT_NEAR(confidence(forward, backward)[10 * 40 + 10], 0.5, 0.01);  // 0.5 + 0.01 (10 + 9.3) = 0.69
}

TEST(Confidence, is_zero_where_a_flow_is_no_number) {
    FlowField forward(40, 30), backward(40, 30);
    forward.u[5] = NAN;
    backward.v[7] = INFINITY;
    const std::vector<float> c = confidence(forward, backward);
    EXPECT_EQ(c[5], 0);
    EXPECT_EQ(c[7], 0);
    EXPECT_EQ(c[20], 1);
}

TEST(Confidence, tells_what_the_disc_covers_from_what_stays_in_view) {
    const FlowScene scene = disc_before_plane();
    const FlowOptions options = *flow_method("brox");
    const FlowField forward = *estimate_flow(scene.from, scene.to, options),
                    backward = *estimate_flow(scene.to, scene.from, options);
    const std::vector<float> c = confidence(forward, backward);
    double seen = 0, seen_count = 0, covered = 0, covered_count = 0;
    for (int y = 8; y < height - 8; ++y)
        for (int x = 8; x < width - 8; ++x) {
            const size_t at = size_t(y) * width + size_t(x);
            if (scene.scored[at])
                seen += c[at] > 0.5, seen_count++;
            else
                covered += c[at] > 0.5, covered_count++;
        }
    EXPECT_GT(seen / seen_count, 0.97);
    EXPECT_LT(covered / covered_count, 0.5);
}

// SPDX-License-Identifier: MIT
// What the alignment benchmark measures with: its recordings, its score, its true paths.
// links: ols_bench_motion
#include <gtest/gtest.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <fstream>

#include "align_limit.hpp"
#include "align_score.hpp"
#include "develop/tracking_image.hpp"

using namespace ols;

namespace {

// A ball that moves sideways, small and quick to render.
class MotionRecording : public testing::Test {
  protected:
    MotionRecording() : folder_(std::filesystem::temp_directory_path() / ("recording" + std::to_string(getpid()))) {
        std::filesystem::create_directories(folder_);
        plan_.scene = folder_ / "ball.toml";
        std::ofstream(plan_.scene) << "samples = 1\n"
                                      "[[material]]\nname = \"grey\"\nalbedo = [0.5, 0.5, 0.5]\n"
                                      "[[object]]\nname = \"ball\"\nsphere = { radius_m = 0.12 }\nmaterial = \"grey\"\n"
                                      "[[object.motion]]\ntime_us = 0\ntranslation_m = [-0.1, 0, 0]\n"
                                      "[[object.motion]]\ntime_us = 500000\ntranslation_m = [0.1, 0, 0]\n";
        plan_.basis = "single";
        plan_.width = 48, plan_.height = 36;
    }
    ~MotionRecording() override { std::filesystem::remove_all(folder_); }

    std::filesystem::path file(const std::string& ending) const {
        for (const auto& entry : std::filesystem::directory_iterator(folder_ / "kept"))
            if (entry.path().extension() == ending) return entry.path();
        return {};
    }

    static constexpr double cycle_ticks = 180 * 57870;
    std::filesystem::path folder_;
    RecordingPlan plan_;
};

}  // namespace

TEST_F(MotionRecording, has_every_slot_that_its_targets_need_and_tracking_frames_on_both_sides) {
    plan_.targets = 2;
    const auto recording = record(plan_, "");
    ASSERT_TRUE(recording) << recording.error().message;
    ASSERT_EQ(recording->targets.size(), 2u);
    for (const TargetFrames& frames : recording->targets) {
        EXPECT_TRUE(frames.basis.lost.empty());
        for (const auto& choice : frames.basis.choices) EXPECT_TRUE(!choice.is_stand_in && choice.across.has_value());
        uint64_t first = frames.frames.front()->tick, last = first;
        for (const auto* list : {&frames.frames, &frames.across})
            for (const auto& frame : *list) first = std::min(first, frame->tick), last = std::max(last, frame->tick);
        EXPECT_LE(frames.tracking.front().frame->tick, first);
        EXPECT_GE(frames.tracking.back().frame->tick, last);
    }
    EXPECT_NEAR(recording->target_us(1) - recording->target_us(0), 90 * 57870 * 0.008, 1e-6);
}

TEST_F(MotionRecording, comes_back_from_its_folder_and_is_rendered_anew_when_the_file_is_cut) {
    const auto first = record(plan_, folder_ / "kept");
    ASSERT_TRUE(first) << first.error().message;
    const auto path = file(".u16");
    const auto samples = [&] {
        const auto again = record(plan_, folder_ / "kept");
        return again->targets[0].frames[7]->samples;
    };
    EXPECT_EQ(samples(), first->targets[0].frames[7]->samples);
    {
        std::fstream changed(path, std::ios::in | std::ios::out | std::ios::binary);
        for (uint64_t i = 0; i < std::filesystem::file_size(path); ++i) changed.put('\x01');
    }
    EXPECT_EQ(samples()[0], std::byte{1});
    std::filesystem::resize_file(path, 1000);
    EXPECT_EQ(samples(), first->targets[0].frames[7]->samples);
}

TEST_F(MotionRecording, of_another_scene_is_another_file) {
    ASSERT_TRUE(record(plan_, folder_ / "kept"));
    const auto path = file(".u16");
    std::filesystem::remove(path);
    std::ofstream(plan_.scene, std::ios::app) << "[[object.motion]]\ntime_us = 600000\n";
    ASSERT_TRUE(record(plan_, folder_ / "kept"));
    EXPECT_NE(file(".u16"), path);
}

TEST_F(MotionRecording, frozen_shows_each_lamp_as_the_truth_but_for_the_noise) {
    plan_.is_frozen = true;
    const auto recording = record(plan_, "");
    const auto lamps = true_lamps(*recording, plan_, "");
    ASSERT_TRUE(recording && lamps);
    const Sequence& sequence = recording->sequence;
    double squares = 0, expected = 0, count = 0;
    for (size_t i = 0; i < recording->targets[0].frames.size(); ++i) {
        const Frame& frame = *recording->targets[0].frames[i];
        const int row = sequence.slots[size_t(recording->targets[0].basis.choices[i].slot)].row;
        const auto* counts = reinterpret_cast<const uint16_t*>(frame.samples.data());
        for (size_t p = 0; p < (*lamps)[0].size(); ++p) {
            const double exact = double((*lamps)[size_t(row)][p]) * double(recording->calibration.flat.data[p]) *
                                 frame.exposure_ticks * 0.008;
            squares += std::pow(counts[p] - double(frame.black) - exact, 2), ++count;
            expected += std::pow(2.68 + 0.492 * std::sqrt(exact), 2) + 1 / 12.0;
        }
    }
    EXPECT_NEAR(squares / expected, 1, 0.02) << count;
}

TEST_F(MotionRecording, scores_a_constant_offset_as_its_closed_form_says) {
    const auto recording = record(plan_, "");
    const auto lamps = true_lamps(*recording, plan_, "");
    const TrueTarget truth(*recording, *lamps);
    Target target;
    target.cfa = recording->camera().cfa;
    for (const auto& lamp : *lamps) target.lamps.emplace_back(lamp.begin(), lamp.end());
    EXPECT_TRUE(std::isinf(truth.psnr_db(target)) || truth.psnr_db(target) > 120);
    constexpr float offset = 0.01f;
    for (auto& lamp : target.lamps)
        for (float& v : lamp) v += offset;
    double expected = 0, expected_percent = 0;
    for (size_t l = 0; l < lightings().size(); ++l) {
        double weights = 0;
        for (const LightPosition& lamp : recording->stage.lamps) weights += lightings()[l].weight(lamp.direction);
        EXPECT_GT(weights, 0);
        expected += 20 * std::log10(truth.peak(l) / (double(offset) * weights)) / double(lightings().size());
        expected_percent += 100 * double(offset) * weights / truth.peak(l) / double(lightings().size());
    }
    EXPECT_NEAR(truth.psnr_db(target), expected, 0.01);
    std::vector<unsigned char> one(truth.subject().size());
    one[one.size() / 2] = 1;
    EXPECT_NEAR(truth.relit_percent(target, one), expected_percent, 1e-3);
    for (auto& lamp : target.lamps) lamp[0] += 1;
    EXPECT_NEAR(truth.relit_percent(target, one), expected_percent, 1e-3) << "another pixel";
    std::vector<float> peaks;
    for (auto lamp : *lamps) {
        std::ranges::sort(lamp);
        peaks.push_back(lamp[size_t(0.999 * double(lamp.size() - 1))]);
    }
    EXPECT_NEAR(truth.images_percent(target, one), 100 * double(offset) / double(std::ranges::max(peaks)), 1e-3);
}

// The ball moves by 0.4 m/s; its front is 1.48 m from the camera.
TEST_F(MotionRecording, true_path_leads_to_where_the_ball_is_and_is_finite_beside_it) {
    const auto recording = record(plan_, "");
    const MotionPath path = true_path(*recording, 0);
    ASSERT_EQ(path.size(), 21u);
    const CameraConfig& camera = recording->camera();
    const double pixels_a_metre =
        camera.height / 2.0 / (1.48 * std::tan(camera.vertical_fov_deg / 2 * 3.14159265358979323846 / 180));
    for (size_t k = 0; k < path.size(); ++k) {
        EXPECT_EQ(path[k].is_instant, k == 10);
        const double seconds = (path[k].tick - path[10].tick) / 125e6;
        const size_t middle = size_t(camera.height / 2) * size_t(camera.width) + size_t(camera.width / 2 - 1);
        EXPECT_NEAR(path[k].flow.u[middle], 0.4 * seconds * pixels_a_metre, 0.02);
        for (size_t p = 0; p < path[k].flow.size(); ++p)
            ASSERT_TRUE(std::isfinite(path[k].flow.u[p]) && std::isfinite(path[k].flow.v[p]));
        EXPECT_NEAR(path[k].flow.u[0], 0.4 * seconds * pixels_a_metre, 0.2) << "beside the ball";
    }
}

TEST_F(MotionRecording, path_error_is_that_of_half_a_cycle_to_either_side_where_the_subject_stays_visible) {
    const auto recording = record(plan_, "");
    const MotionPath truth = true_path(*recording, 0);
    MotionPath found = truth;
    std::vector<unsigned char> subject(truth[0].flow.size());
    for (size_t p = 0; p < subject.size(); ++p) subject[p] = truth[0].confidence[p] > 0;
    for (size_t p = 0; p < subject.size(); ++p) {
        for (const size_t k : {5, 15}) found[k].flow.u[p] += 3, found[k].flow.v[p] += 4;
        for (const size_t k : {4, 6, 14, 16}) found[k].flow.u[p] += 100;
        if (!subject[p]) found[5].flow.u[p] += 1000;
    }
    const PathError error = path_error(&found, truth, Knots::half_a_cycle, cycle_ticks, subject);
    EXPECT_NEAR(error.mean, 5, 1e-4);
    EXPECT_NEAR(error.percentile_95, 5, 1e-4);
    EXPECT_EQ(path_error(&found, truth, Knots::nearest, cycle_ticks, subject).mean, 0);
}

// Its front moves as far in a cycle as 0.4 m/s leads in five groups of 18 slots on either side; its rim is farther away.
TEST_F(MotionRecording, motion_of_a_cycle_is_that_of_the_ball_and_without_a_flow_half_of_it_is_the_error) {
    const auto recording = record(plan_, "");
    const MotionPath truth = true_path(*recording, 0);
    std::vector<unsigned char> ball(truth[0].flow.size());
    for (size_t p = 0; p < ball.size(); ++p) ball[p] = truth[0].confidence[p] > 0 && truth.back().confidence[p] > 0;
    const CameraConfig& camera = recording->camera();
    const double cycle_m = 0.4 * 180 * 57870 * 8e-9;
    const auto pixels = [&](double away_m) {
        return cycle_m * camera.height / 2.0 / (away_m * std::tan(camera.vertical_fov_deg / 2 * M_PI / 180));
    };
    const CycleMotion motion = cycle_motion(truth, cycle_ticks, ball);
    EXPECT_NEAR(motion.most_px, pixels(1.48), 0.02);
    EXPECT_LT(motion.mean_px, pixels(1.48));
    EXPECT_GT(motion.mean_px, pixels(1.60));
    EXPECT_NEAR(path_error(nullptr, truth, Knots::half_a_cycle, cycle_ticks, ball).mean, motion.mean_px / 2, 0.01);
    EXPECT_EQ(moving_pixels(truth, ball), ball) << "all of it moves by more than a quarter of a pixel";
    MotionPath still = truth;
    for (MotionKnot& knot : still) {
        knot.flow = FlowField(knot.flow.width, knot.flow.height);
        knot.confidence.assign(ball.size(), 1.0f);
    }
    still[2].confidence[ball.size() / 2] = 0;
    std::vector<unsigned char> hidden(ball.size());
    hidden[ball.size() / 2] = ball[ball.size() / 2];
    EXPECT_EQ(moving_pixels(still, ball), hidden);
}

TEST_F(MotionRecording, path_that_is_found_is_that_of_all_tracking_frames) {
    const auto recording = record(plan_, "");
    const MotionQuality quality = *motion_quality("standard");
    const auto path = found_path(*recording, 0, quality);
    ASSERT_TRUE(path) << path.error().message;
    TrackingFlows flows(quality.flow);
    const TargetFrames& frames = recording->targets[0];
    const CameraCalibration& calibration = recording->calibration;
    for (const auto& [number, frame] : frames.tracking)
        ASSERT_TRUE(flows
                        .add(middle_tick(*frame), tracking_image(*frame, calibration.black, calibration.flat),
                             tracking_noise(*frame, calibration.black, calibration.flat, recording->camera().noise))
                        .ok());
    const auto expected = flows.path(MotionDeveloper::instant_of(frames, recording->sequence),
                                     MotionDeveloper::reach_of(frames, true), MotionDeveloper::reach_of(frames, false));
    ASSERT_TRUE(expected && expected->size() == path->size());
    for (size_t k = 0; k < path->size(); ++k) {
        EXPECT_EQ((*path)[k].tick, (*expected)[k].tick);
        EXPECT_EQ((*path)[k].flow.u, (*expected)[k].flow.u);
        EXPECT_EQ((*path)[k].confidence, (*expected)[k].confidence);
    }
}

TEST(FlowAt, is_in_a_line_between_two_knots) {
    MotionPath path;
    for (const double tick : {-3e6, 0.0, 2e6})
        path.push_back({tick, FlowField(16, 16), std::vector<float>(256, 1.0f), tick == 0});
    std::ranges::fill(path[0].flow.u, -6.0f);
    std::ranges::fill(path[2].flow.v, 8.0f);
    EXPECT_EQ(flow_at(path, -1e6).u[7], -2);
    EXPECT_EQ(flow_at(path, 0).v[7], 0);
    EXPECT_EQ(flow_at(path, 1.5e6).v[7], 6);
    EXPECT_EQ(flow_at(path, 2e6).v[7], 8);
}

TEST_F(MotionRecording, limit_without_a_flow_is_the_error_of_the_frames_as_they_stand) {
    const auto recording = record(plan_, "");
    MotionPath path = true_path(*recording, 0);
    for (MotionKnot& knot : path) knot.flow = FlowField(knot.flow.width, knot.flow.height);
    const AlignLimit limit(*recording, path);
    EXPECT_GT(limit.still_db(AlignLimit::Where::visible), 0);
    EXPECT_NEAR(limit.moved_db(path, AlignLimit::Where::visible, false), limit.still_db(AlignLimit::Where::visible),
                1e-3);
}

// Its rim stays: antialiased, it is interpolated.
TEST_F(MotionRecording, limit_of_a_ball_that_moves_sideways_is_above_no_alignment) {
    std::ifstream file(plan_.scene);
    std::string text((std::istreambuf_iterator<char>(file)), {});
    file.close();
    text.replace(text.find("samples = 1"), 11, "samples = 16");
    std::ofstream(plan_.scene) << text;
    const auto recording = record(plan_, "");
    const MotionPath path = true_path(*recording, 0);
    const AlignLimit limit(*recording, path);
    EXPECT_GT(limit.moved_db(path, AlignLimit::Where::visible, false), limit.still_db(AlignLimit::Where::visible) + 3);
    EXPECT_GT(limit.moved_db(path, AlignLimit::Where::inside, false),
              limit.moved_db(path, AlignLimit::Where::visible, false) + 3)
        << "the rim is left out";
    EXPECT_GT(limit.moved_db(path, AlignLimit::Where::inside, true),
              limit.moved_db(path, AlignLimit::Where::inside, false) + 3)
        << "its light changes nearly evenly";
}

TEST_F(MotionRecording, of_a_scene_that_is_not_there_is_an_error_that_names_it) {
    plan_.scene = folder_ / "none.toml";
    const auto recording = record(plan_, "");
    ASSERT_FALSE(recording);
    EXPECT_NE(recording.error().message.find("none.toml"), std::string::npos);
}

TEST_F(MotionRecording, that_cannot_be_kept_is_an_error_that_names_the_file) {
    std::ofstream(folder_ / "file") << "no folder";
    const auto recording = record(plan_, folder_ / "file");
    ASSERT_FALSE(recording);
    EXPECT_NE(recording.error().message.find("ball"), std::string::npos);
}

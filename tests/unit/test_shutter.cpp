// SPDX-License-Identifier: MIT
// What a verb does with --shutter: pictures are blurred by the motion and the frame rate of their archive, and archives without
// motion are refused before anything is written.
// links: ols_rf
#include "rf/shutter.hpp"

#include <gtest/gtest.h>

#include "take_fixture.hpp"

using namespace ols;
using namespace ols::test;

namespace {

constexpr int width = 40, height = 6;

// Everything moves by 12 pixels in a frame of 1/60 s; vectors are such as halves hold.
Target moving_target(uint32_t index) {
    Target target = numbered_target(1, width, height, Cfa::none, index);
    for (const double frames : {-0.5, 0.5}) {
        FlowField flow(width, height);
        flow.u.assign(flow.size(), float(12 * frames));
        target.motion.times_s.push_back(frames / 60);
        target.motion.flows.push_back(flow);
    }
    return target;
}

// R G B A of 1 to 4 in one column.
Image line_at(int x) {
    Image image(width, height, 4);
    for (int y = 0; y < height; ++y)
        for (int c = 0; c < 4; ++c) image.at(x, y, c) = float(c + 1);
    return image;
}

TakeInfo take_at_60_hz() {
    TakeInfo info = take_info(1);
    info.frame_rate_hz = 60;
    return info;
}

}  // namespace

class Shutter : public TakeDirectory {};

TEST_F(Shutter, blurs_by_the_archives_motion_at_its_frame_rate) {
    auto writer = ArchiveWriter::create(path, take_at_60_hz());
    ASSERT_TRUE(writer->write_target(moving_target(0)).ok());
    const auto archive = ArchiveReader::open(path);
    const ShutterOptions options{.angle_deg = 180, .step_px = 0.1};
    const auto blurred =
        through_shutter(*archive->open_target(0, 0), "target", archive->info().frame_rate_hz, line_at(20), options, 1);
    ASSERT_TRUE(blurred.ok()) << blurred.error().message;
    // Half a frame is 6 pixels: 17 to 23.
    for (int c = 0; c < 4; ++c) {
        for (const int x : {18, 20, 22}) EXPECT_NEAR(blurred->image.at(x, 3, c), (c + 1) / 6.0, 0.01);
        EXPECT_EQ(blurred->image.at(15, 3, c), 0);
        EXPECT_EQ(blurred->image.at(25, 3, c), 0);
    }
    EXPECT_TRUE(shutter_warnings(*blurred).empty());
}

TEST_F(Shutter, an_exposure_beyond_the_known_motion_is_told) {
    auto writer = ArchiveWriter::create(path, take_at_60_hz());
    ASSERT_TRUE(writer->write_target(moving_target(0)).ok());
    const auto archive = ArchiveReader::open(path);
    const auto blurred = through_shutter(*archive->open_target(0, 0), "target", archive->info().frame_rate_hz,
                                         line_at(20), {.angle_deg = 720}, 1);
    ASSERT_TRUE(blurred.ok());
    ASSERT_EQ(shutter_warnings(*blurred).size(), 1u);
    EXPECT_NE(shutter_warnings(*blurred)[0].find("8.33 ms beyond"), std::string::npos);
    EXPECT_NEAR(shutter_report({.angle_deg = 720}, *blurred)["extrapolated_ms"].get<double>(), 1000 / 120.0, 1e-9);
}

TEST_F(Shutter, archives_without_motion_are_refused_by_target_with_what_to_do) {
    auto writer = ArchiveWriter::create(path, take_at_60_hz());
    ASSERT_TRUE(writer->write_target(moving_target(0)).ok());
    ASSERT_TRUE(writer->write_target(numbered_target(1, width, height, Cfa::none, 1)).ok());
    const auto archive = ArchiveReader::open(path);
    EXPECT_TRUE(check_motion_known(*archive, path, {archive->targets()[0]}).ok());
    const auto refused = check_motion_known(*archive, path, archive->targets());
    ASSERT_FALSE(refused.ok());
    for (const std::string& words : {path, std::string("target 1"), std::string("stagectl run --fps")})
        EXPECT_NE(refused.error().message.find(words), std::string::npos) << refused.error().message;
}

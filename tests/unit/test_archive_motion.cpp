// SPDX-License-Identifier: MIT
// The motion of a target in its archive: it comes back within what halves hold, costs nothing where nobody asks, and bad
// motion is refused before anything is written.
// links: ols_archive
#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <limits>

#include "archive/archive.hpp"
#include "take_fixture.hpp"

using namespace ols;
using namespace ols::test;

namespace {

// Vectors of both signs that no half holds exactly, largest in the last pixel.
TargetMotion numbered_motion(int width, int height, const std::vector<double>& times_s) {
    TargetMotion motion{times_s, {}};
    for (size_t i = 0; i < times_s.size(); ++i) {
        FlowField flow(width, height);
        for (size_t p = 0; p < flow.size(); ++p) {
            flow.u[p] = float(int(i) + 1) * 0.0137f * float(p % 1000);
            flow.v[p] = -0.3f * flow.u[p] + 1e-3f;
        }
        motion.flows.push_back(std::move(flow));
    }
    return motion;
}

Target moving_target(int width, int height) {
    Target target = numbered_target(2, width, height, Cfa::rggb, 0);
    target.motion = numbered_motion(width, height, {-1 / 60.0, -1 / 120.0, 1 / 120.0, 1 / 60.0});
    return target;
}

// A half has 11 significant bits: rounding moves a value by at most 2^-11 of it, and what is below 2^-14 by 2^-25.
void expect_within_half(const std::vector<float>& back, const std::vector<float>& written) {
    ASSERT_EQ(back.size(), written.size());
    for (size_t p = 0; p < back.size(); ++p)
        ASSERT_LE(std::abs(back[p] - written[p]), std::max(std::abs(written[p]) / 2048, 0x1p-25f)) << p;
}

}  // namespace

class ArchiveMotion : public TakeDirectory {};

TEST_F(ArchiveMotion, comes_back_with_exact_times_and_vectors_within_half_precision) {
    auto writer = ArchiveWriter::create(path, take_info(2));
    const Target target = moving_target(130, 70);
    ASSERT_TRUE(writer->write_target(target).ok());
    ASSERT_TRUE(writer->finish().ok());
    const auto reader = ArchiveReader::open(path);
    const auto motion = reader->read_motion(0, 0);
    ASSERT_TRUE(motion.ok()) << motion.error().message;
    EXPECT_EQ(motion->times_s, target.motion.times_s);
    ASSERT_EQ(motion->flows.size(), 4u);
    for (size_t i = 0; i < 4; ++i) {
        expect_within_half(motion->flows[i].u, target.motion.flows[i].u);
        expect_within_half(motion->flows[i].v, target.motion.flows[i].v);
    }
    EXPECT_EQ(reader->verify().problems, std::vector<std::string>{});
}

TEST_F(ArchiveMotion, is_not_read_with_the_lamps_and_its_times_are_in_the_head) {
    auto writer = ArchiveWriter::create(path, take_info(2));
    const Target target = moving_target(130, 70);
    ASSERT_TRUE(writer->write_target(target).ok());
    const auto reader = ArchiveReader::open(path);
    EXPECT_EQ(reader->read_head(0, 0)->motion.times_s, target.motion.times_s);
    const auto whole = reader->read_target(0, 0);
    EXPECT_TRUE(whole->motion.flows.empty());
    EXPECT_EQ(whole->lamps, target.lamps);
    EXPECT_EQ(whole->variance, target.variance);
}

TEST_F(ArchiveMotion, a_target_without_motion_has_no_such_part_and_says_so_when_asked) {
    auto writer = ArchiveWriter::create(path, take_info(2));
    ASSERT_TRUE(writer->write_target(numbered_target(2, 8, 8, Cfa::none, 0)).ok());
    const auto reader = ArchiveReader::open(path);
    EXPECT_TRUE(reader->read_head(0, 0)->motion.times_s.empty());
    EXPECT_NE(reader->read_motion(0, 0).error().message.find("has no motion"), std::string::npos);
}

TEST_F(ArchiveMotion, what_cannot_be_motion_is_refused_and_nothing_is_written) {
    auto writer = ArchiveWriter::create(path, take_info(2));
    const auto refusal = [&](auto spoil) {
        Target target = moving_target(20, 10);
        spoil(target.motion);
        const auto written = writer->write_target(target);
        EXPECT_FALSE(std::filesystem::exists(path + "/cam0/target_000000.exr.part"));
        return written.ok() ? "written" : written.error().message;
    };
    EXPECT_NE(refusal([](auto& m) { m.times_s[1] = m.times_s[0]; }).find("must ascend"), std::string::npos);
    EXPECT_NE(refusal([](auto& m) { m.times_s[2] = 0; }).find("leave out 0"), std::string::npos);
    EXPECT_NE(refusal([](auto& m) { m.flows.pop_back(); }).find("4 times and 3 flow fields"), std::string::npos);
    EXPECT_NE(refusal([](auto& m) { m.flows[1] = FlowField(10, 20); }).find("10 x 20"), std::string::npos);
    EXPECT_NE(refusal([](auto& m) { m.flows[3].v[41] = std::numeric_limits<float>::quiet_NaN(); }).find("pixel 1, 2"),
              std::string::npos);
    EXPECT_NE(refusal([](auto& m) { m.flows[0].u[3] = 7e4f; }).find("65504"), std::string::npos);
    EXPECT_EQ(refusal([](auto&) {}), "written");
}

// SPDX-License-Identifier: MIT
// The matte of a target in its archive: it comes back to the bit, whole and by boxes, and what is no matte is refused.
// links: ols_archive
#include <gtest/gtest.h>

#include <limits>

#include "archive/archive.hpp"
#include "take_fixture.hpp"

using namespace ols;
using namespace ols::test;

namespace {

Target matted_target(int width, int height, Cfa cfa, uint32_t index = 0) {
    Target target = numbered_target(2, width, height, cfa, index);
    target.matte.frames = 9;
    target.matte.planes.resize(size_t(target.planes()));
    for (int plane = 0; plane < target.planes(); ++plane)
        for (int p = 0; p < width * height; ++p)
            target.matte.planes[size_t(plane)].push_back(0.37f * float(plane + 1) - 1e-4f * float(p % 5000));
    for (int p = 0; p < width * height; ++p) target.matte.variance.push_back(1e-8f * float(1 + p));
    return target;
}

}  // namespace

class ArchiveMatte : public TakeDirectory {};

TEST_F(ArchiveMatte, comes_back_to_the_bit_beside_all_other_parts) {
    auto writer = ArchiveWriter::create(path, take_info(2));
    const Cfa kinds[] = {Cfa::rggb, Cfa::rgb, Cfa::none};
    for (uint32_t index = 0; index < 3; ++index) {
        Target target = matted_target(130, 70, kinds[index], index);
        target.confidence.assign(130 * 70, 0.75f);
        target.motion = {{-0.5}, {FlowField(130, 70)}};
        ASSERT_TRUE(writer->write_target(target).ok());
    }
    ASSERT_TRUE(writer->finish().ok());
    const auto reader = ArchiveReader::open(path);
    for (uint32_t index = 0; index < 3; ++index) {
        const Target target = matted_target(130, 70, kinds[index], index);
        const auto back = reader->read_target(0, index);
        ASSERT_TRUE(back.ok()) << back.error().message;
        EXPECT_EQ(back->matte.frames, 9);
        EXPECT_EQ(back->matte.planes, target.matte.planes);
        EXPECT_EQ(back->matte.variance, target.matte.variance);
        EXPECT_EQ(back->lamps, target.lamps);
        EXPECT_EQ(back->confidence[77], 0.75f);
        EXPECT_TRUE(reader->read_motion(0, index).ok());
        EXPECT_EQ(reader->read_head(0, index)->matte.frames, 9);
    }
    EXPECT_EQ(reader->verify().problems, std::vector<std::string>{});
}

TEST_F(ArchiveMatte, is_cut_to_a_box_like_the_lamps) {
    auto writer = ArchiveWriter::create(path, take_info(2));
    const Target target = matted_target(130, 70, Cfa::rggb);
    ASSERT_TRUE(writer->write_target(target).ok());
    const auto part = ArchiveReader::open(path)->read_box(0, 0, {61, 5, 9, 62});
    ASSERT_TRUE(part.ok()) << part.error().message;
    ASSERT_EQ(part->matte.planes[0].size(), 9u * 62);
    for (size_t y = 0; y < 62; ++y)
        for (size_t x = 0; x < 9; ++x) {
            EXPECT_EQ(part->matte.planes[0][y * 9 + x], target.matte.planes[0][(y + 5) * 130 + x + 61]);
            EXPECT_EQ(part->matte.variance[y * 9 + x], target.matte.variance[(y + 5) * 130 + x + 61]);
        }
}

TEST_F(ArchiveMatte, of_a_target_without_one_is_no_part_and_without_noise_has_no_variance) {
    auto writer = ArchiveWriter::create(path, take_info(2));
    ASSERT_TRUE(writer->write_target(numbered_target(2, 8, 8, Cfa::none, 0)).ok());
    Target clean = matted_target(8, 8, Cfa::none, 1);
    clean.matte.variance.clear();
    ASSERT_TRUE(writer->write_target(clean).ok());
    const auto reader = ArchiveReader::open(path);
    EXPECT_EQ(reader->read_target(0, 0)->matte.frames, 0);
    EXPECT_TRUE(reader->read_target(0, 0)->matte.planes.empty());
    EXPECT_EQ(reader->read_target(0, 1)->matte.planes, clean.matte.planes);
    EXPECT_TRUE(reader->read_target(0, 1)->matte.variance.empty());
}

TEST_F(ArchiveMatte, that_is_none_is_refused_and_nothing_is_written) {
    auto writer = ArchiveWriter::create(path, take_info(2));
    const auto refusal = [&](auto spoil) {
        Target target = matted_target(20, 10, Cfa::rggb);
        spoil(target.matte);
        const auto written = writer->write_target(target);
        EXPECT_FALSE(std::filesystem::exists(path + "/cam0/target_000000.exr.part"));
        return written.ok() ? "written" : written.error().message;
    };
    EXPECT_NE(refusal([](auto& m) { m.planes.clear(); }).find("not of the target's size"), std::string::npos);
    EXPECT_NE(refusal([](auto& m) { m.planes[0].pop_back(); }).find("not of the target's size"), std::string::npos);
    EXPECT_NE(refusal([](auto& m) { m.variance.pop_back(); }).find("not of the target's size"), std::string::npos);
    EXPECT_NE(refusal([](auto& m) { m.planes[0][3] = std::numeric_limits<float>::infinity(); }).find("not finite"),
              std::string::npos);
    EXPECT_NE(refusal([](auto& m) { m.variance[3] = NAN; }).find("not finite"), std::string::npos);
    EXPECT_EQ(refusal([](auto&) {}), "written");
}

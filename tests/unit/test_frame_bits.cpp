// SPDX-License-Identifier: MIT
// A frame's bits: what they tell, what they cannot, and that noise of the stated size never comes twice.
// links: ols_record
#include "record/frame_bits.hpp"

#include <gtest/gtest.h>
#include <xxhash.h>

#include <cmath>
#include <cstring>
#include <numbers>
#include <random>

namespace ols {
namespace {

Frame frame_of(uint32_t width, uint32_t height, const std::vector<uint16_t>& samples, uint32_t padding = 0) {
    Frame frame;
    frame.width = width, frame.height = height;
    frame.pitch_bytes = width * 2 + padding;
    frame.samples.assign(size_t(frame.pitch_bytes) * height, std::byte(padding));
    for (uint32_t y = 0; y < height; ++y)
        std::memcpy(frame.samples.data() + size_t(y) * frame.pitch_bytes, samples.data() + size_t(y) * width,
                    width * 2);
    return frame;
}

CameraConfig camera_of(double read_counts) {
    CameraConfig camera;
    camera.noise.read_counts = read_counts;
    return camera;
}

FrameBits bits_of(const Frame& frame, double read_counts = 2.68) {
    RowHash hash;
    hash.add(frame, frame.height, frame.samples.data());
    return BitsReader(camera_of(read_counts)).read(frame, hash.value());
}
FrameBits bits_of(const std::vector<uint16_t>& samples, double read_counts = 2.68) {
    return bits_of(frame_of(uint32_t(samples.size()), 1, samples), read_counts);
}

TEST(FrameBits, equal_chance_is_the_closed_form_for_much_noise_and_1_for_none) {
    // Rounding to whole counts adds a variance of 1/12 (Sheppard's correction).
    for (const double sigma : {1.0, 2.68, 30.0, 1000.0})
        EXPECT_NEAR(equal_chance(sigma) * 2 * std::sqrt(std::numbers::pi * (sigma * sigma + 1.0 / 12)), 1, 1e-3)
            << sigma;
    EXPECT_EQ(equal_chance(0), 1);
    EXPECT_NEAR(equal_chance(0.05), 1, 1e-12);
    // Mean and edge: P(0) = erf(0.5 / (sigma sqrt 2)); sigma 0.5 has three counts that matter.
    const double at_0 = std::erf(1 / std::sqrt(2.0)), at_1 = (std::erf(3 / std::sqrt(2.0)) - at_0) / 2;
    EXPECT_NEAR(equal_chance(0.5), at_0 * at_0 + 2 * at_1 * at_1, 1e-5);
}

TEST(FrameBits, equal_chance_is_what_drawing_gives) {
    std::mt19937 generator(16);
    std::normal_distribution<double> noise(0, 0.7);
    int equal = 0;
    constexpr int draws = 200'000;
    for (int i = 0; i < draws; ++i) equal += std::lround(noise(generator)) == std::lround(noise(generator));
    EXPECT_NEAR(double(equal) / draws, equal_chance(0.7), 4 * std::sqrt(0.25 / draws));
}

TEST(FrameBits, of_a_frame_that_is_black_or_saturated_throughout_tell_nothing) {
    EXPECT_FALSE(bits_of(std::vector<uint16_t>(64, 0)).tells);
    EXPECT_FALSE(bits_of(std::vector<uint16_t>(64, 4095)).tells);
    EXPECT_TRUE(bits_of(std::vector<uint16_t>(64, 64)).tells) << "a dark slot has the black level's noise";
    std::vector<uint16_t> few(64, 4095);
    std::fill_n(few.begin(), 20, uint16_t(70));
    EXPECT_FALSE(bits_of(few).tells) << "20 samples agree by chance once in 1e19";
    std::fill_n(few.begin(), 30, uint16_t(70));
    EXPECT_TRUE(bits_of(few).tells);
}

TEST(FrameBits, of_a_camera_without_noise_and_of_floats_tell_nothing) {
    EXPECT_FALSE(bits_of(std::vector<uint16_t>(4096, 70), 0).tells);
    EXPECT_FALSE(bits_of(std::vector<uint16_t>(4096, 70), 0.1).tells);
    Frame frame = frame_of(128, 1, std::vector<uint16_t>(128, 70));
    frame.format = PixelFormat::f32;
    frame.width = 64;
    EXPECT_FALSE(bits_of(frame).tells);
}

TEST(FrameBits, depend_on_every_sample_and_on_nothing_between_the_rows) {
    std::vector<uint16_t> samples(19 * 13);
    for (size_t i = 0; i < samples.size(); ++i) samples[i] = uint16_t(100 + i * 37 % 500);
    const uint64_t hash = bits_of(frame_of(19, 13, samples)).hash;
    EXPECT_EQ(hash, XXH3_64bits(samples.data(), samples.size() * 2)) << "as libxxhash has it of all at once";
    for (const uint32_t padding : {2, 26}) EXPECT_EQ(bits_of(frame_of(19, 13, samples, padding)).hash, hash);
    for (size_t i = 0; i < samples.size(); ++i) {
        auto changed = samples;
        ++changed[i];
        EXPECT_NE(bits_of(frame_of(19, 13, changed)).hash, hash) << i;
    }
}

TEST(BitsSeen, names_the_first_with_the_same_bits_and_forgets_the_oldest) {
    BitsSeen seen;
    EXPECT_FALSE(seen.add({7, true}, {0, {1, 100}}));
    EXPECT_FALSE(seen.add({8, true}, {1, {2, 200}}));
    for (const uint64_t arrival : {2, 3}) {
        const auto first = seen.add({7, true}, {arrival, {arrival + 1, 300}});
        ASSERT_TRUE(first);
        EXPECT_EQ(first->arrival, 0u);
        EXPECT_EQ(first->stamp.frame_id, 1u);
    }
    EXPECT_FALSE(seen.add({9, false}, {4, {5, 500}}));
    EXPECT_FALSE(seen.add({9, false}, {5, {6, 600}})) << "bits that tell nothing";
    for (uint64_t i = 0; i < BitsSeen::frames_max - 1; ++i)
        EXPECT_FALSE(seen.add({1000 + i, true}, {6 + i, {7 + i, 0}}));
    EXPECT_FALSE(seen.add({7, true}, {1u << 20, {1u << 20, 0}})) << "forgotten";
    EXPECT_TRUE(seen.add({1000, true}, {1u << 21, {1u << 21, 0}}));
}

}  // namespace
}  // namespace ols

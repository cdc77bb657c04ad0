// SPDX-License-Identifier: MIT
// Unpacking against layouts written down bit by bit, as the standards' own figures do.
// links: ols_image
#include "image/sample_layout.hpp"

#include <gtest/gtest.h>

#include <functional>
#include <random>
#include <sstream>
#include <string>
#include <vector>

namespace ols::test {
namespace {

// A group of samples A, B, C, D as bytes; each byte from its highest bit to its lowest: "B3" is bit 3 of sample B, "-" no bit.
struct Drawn {
    const char* name;
    SampleLayout layout;
    size_t samples;  // in a group
    std::vector<std::string> bytes;
    bool is_whole_group = false;  // an end of a row takes all of it
};

const std::string high_a_10 = "A9 A8 A7 A6 A5 A4 A3 A2", high_b_10 = "B9 B8 B7 B6 B5 B4 B3 B2",
                  high_c_10 = "C9 C8 C7 C6 C5 C4 C3 C2", high_d_10 = "D9 D8 D7 D6 D5 D4 D3 D2",
                  high_a_12 = "A11 A10 A9 A8 A7 A6 A5 A4", high_b_12 = "B11 B10 B9 B8 B7 B6 B5 B4",
                  low_16 = "A7 A6 A5 A4 A3 A2 A1 A0", high_16 = "A15 A14 A13 A12 A11 A10 A9 A8";

const Drawn drawn_layouts[] = {
    {"bytes", {SamplePacking::bytes, 8}, 1, {low_16}},
    // PFNC 2.4, figures of "Mono10", "Mono16": the lowest byte first.
    {"words_10", {SamplePacking::words, 10}, 1, {low_16, "- - - - - - A9 A8"}},
    {"words_16", {SamplePacking::words, 16}, 1, {low_16, high_16}},
    // Values in the highest bits, as V4L2's Y012 and many a DMA engine have them.
    {"words_high_10", {SamplePacking::words_high, 10}, 1, {"A1 A0 - - - - - -", high_a_10}},
    {"words_high_12", {SamplePacking::words_high, 12}, 1, {"A3 A2 A1 A0 - - - -", high_a_12}},
    // V4L2, pixfmt-yuv-luma.rst, Y16_BE.
    {"words_big_16", {SamplePacking::words_big, 16}, 1, {high_16, low_16}},
    {"words_big_12", {SamplePacking::words_big, 12}, 1, {"- - - - A11 A10 A9 A8", low_16}},
    // GigE Vision's Mono12Packed and Mono10Packed, PFNC 2.4 appendix.
    {"gige_12", {SamplePacking::gige_pairs, 12}, 2, {high_a_12, "B3 B2 B1 B0 A3 A2 A1 A0", high_b_12}},
    {"gige_10", {SamplePacking::gige_pairs, 10}, 2, {high_a_10, "- - B1 B0 - - A1 A0", high_b_10}},
    // PFNC 2.4, figures of Mono10p and Mono12p.
    {"p_10",
     {SamplePacking::bits_low, 10},
     4,
     {low_16, "B5 B4 B3 B2 B1 B0 A9 A8", "C3 C2 C1 C0 B9 B8 B7 B6", "D1 D0 C9 C8 C7 C6 C5 C4", high_d_10}},
    {"p_12", {SamplePacking::bits_low, 12}, 2, {low_16, "B3 B2 B1 B0 A11 A10 A9 A8", high_b_12}},
    // V4L2, pixfmt-yuv-luma.rst, Y10BPACK; TIFF 6.0 with FillOrder 1 at 12 bits.
    {"tiff_10",
     {SamplePacking::bits_high, 10},
     4,
     {high_a_10, "A1 A0 B9 B8 B7 B6 B5 B4", "B3 B2 B1 B0 C9 C8 C7 C6", "C5 C4 C3 C2 C1 C0 D9 D8",
      "D7 D6 D5 D4 D3 D2 D1 D0"}},
    {"tiff_12", {SamplePacking::bits_high, 12}, 2, {high_a_12, "A3 A2 A1 A0 B11 B10 B9 B8", "B7 B6 B5 B4 B3 B2 B1 B0"}},
    // V4L2, pixfmt-srggb10p.rst and pixfmt-srggb12p.rst.
    {"mipi_10",
     {SamplePacking::mipi, 10},
     4,
     {high_a_10, high_b_10, high_c_10, high_d_10, "D1 D0 C1 C0 B1 B0 A1 A0"},
     true},
    {"mipi_12", {SamplePacking::mipi, 12}, 2, {high_a_12, high_b_12, "B3 B2 B1 B0 A3 A2 A1 A0"}, true},
};

std::vector<uint16_t> random_samples(size_t count, int bits) {
    static std::mt19937 random(7);
    std::vector<uint16_t> samples(count);
    for (uint16_t& sample : samples) sample = uint16_t(random() & ((1u << bits) - 1));
    return samples;
}

// A row as drawn; bits that belong to nobody are set, so that a reader that takes them is found out. Ends behind the last byte
// that has a bit of the row.
std::vector<std::byte> pack_as_drawn(const Drawn& drawn, const uint16_t* samples, size_t count) {
    std::vector<std::byte> row;
    const bool fills = drawn.layout.packing != SamplePacking::words && drawn.layout.packing != SamplePacking::words_big;
    for (size_t first = 0; first < count; first += drawn.samples)
        for (const std::string& byte : drawn.bytes) {
            std::istringstream bits(byte);
            unsigned value = 0;
            bool is_used = drawn.is_whole_group;
            for (std::string bit; bits >> bit;) {
                const size_t n = first + (bit == "-" ? count : size_t(bit[0] - 'A'));
                is_used |= n < count;
                value = value << 1 | (n < count ? samples[n] >> std::stoi(bit.substr(1)) & 1u : unsigned(fills));
            }
            if (is_used) row.push_back(std::byte(value));
        }
    return row;
}

// A stream of bits of any width, by its definition.
std::vector<std::byte> pack_stream(bool is_low, int bits, const uint16_t* samples, size_t count) {
    std::vector<std::byte> row((count * size_t(bits) + 7) / 8);
    for (size_t k = 0; k < count * size_t(bits); ++k) {
        const int place = int(k % size_t(bits));
        const unsigned bit = samples[k / size_t(bits)] >> (is_low ? place : bits - 1 - place) & 1u;
        row[k / 8] |= std::byte(bit << (is_low ? k % 8 : 7 - k % 8));
    }
    return row;
}

using PackRow = std::function<std::vector<std::byte>(const uint16_t*, size_t)>;

// Rows `gap` bytes apart, no more bytes behind the last one than it takes.
void expect_unpacked(const SampleLayout& layout, const PackRow& pack, size_t width, size_t height, size_t gap) {
    const auto samples = random_samples(width * height, layout.bits);
    std::vector<std::byte> packed;
    size_t row_bytes = 0;
    for (size_t y = 0; y < height; ++y) {
        const auto row = pack(samples.data() + y * width, width);
        row_bytes = row.size() + gap;
        packed.insert(packed.end(), row.begin(), row.end());
        if (y + 1 < height) packed.insert(packed.end(), gap, std::byte{0xa5});
    }
    packed.shrink_to_fit();
    EXPECT_EQ(packed_row_bytes(layout, width), row_bytes - gap) << width;
    std::vector<uint16_t> unpacked(samples.size());
    const Status status = unpack_samples(packed, layout, width, height, row_bytes, unpacked);
    ASSERT_TRUE(status.ok()) << status.error().message;
    EXPECT_EQ(unpacked, samples) << width << " x " << height << ", " << gap << " bytes between rows";
}

std::string error_of(const Status& status) {
    return status.ok() ? "" : status.error().message;
}

}  // namespace

class SampleLayouts : public testing::TestWithParam<Drawn> {
  protected:
    const Drawn& drawn_ = GetParam();
    const PackRow pack_ = [this](const uint16_t* samples, size_t count) {
        return pack_as_drawn(drawn_, samples, count);
    };
};

INSTANTIATE_TEST_SUITE_P(AsDrawn, SampleLayouts, testing::ValuesIn(drawn_layouts),
                         [](const auto& drawn) { return std::string(drawn.param.name); });

TEST_P(SampleLayouts, are_unpacked_for_any_width_and_any_gap_between_rows) {
    for (size_t width = 1; width <= 67; ++width)
        for (const size_t gap : {0, 1, 13}) expect_unpacked(drawn_.layout, pack_, width, 3, gap);
    expect_unpacked(drawn_.layout, pack_, 641, 5, 64);
}

TEST_P(SampleLayouts, rows_that_follow_each_other_without_regard_to_bytes_are_one) {
    for (const size_t width : {1, 3, 7, 21}) {
        const auto samples = random_samples(width * 5, drawn_.layout.bits);
        std::vector<uint16_t> unpacked(samples.size());
        const Status status =
            unpack_samples(pack_(samples.data(), samples.size()), drawn_.layout, width, 5, 0, unpacked);
        ASSERT_TRUE(status.ok()) << error_of(status);
        EXPECT_EQ(unpacked, samples);
    }
}

TEST_P(SampleLayouts, a_picture_that_lacks_one_byte_is_refused) {
    const auto samples = random_samples(21, drawn_.layout.bits);
    auto packed = pack_(samples.data(), 21);
    std::vector<uint16_t> unpacked(21);
    packed.pop_back();
    EXPECT_NE(error_of(unpack_samples(packed, drawn_.layout, 21, 1, 100, unpacked)).find("cut short"),
              std::string::npos);
    EXPECT_NE(error_of(unpack_samples(packed, drawn_.layout, 7, 3, 0, unpacked)).find("cut short"), std::string::npos);
}

TEST(SampleLayout, streams_of_9_to_16_bits_are_unpacked_whatever_byte_a_sample_begins_in) {
    for (const bool is_low : {true, false})
        for (int bits = 8; bits <= 16; ++bits) {
            const SampleLayout layout{is_low ? SamplePacking::bits_low : SamplePacking::bits_high, bits};
            for (size_t width = 1; width <= 35; ++width)
                expect_unpacked(
                    layout,
                    [&](const uint16_t* samples, size_t count) { return pack_stream(is_low, bits, samples, count); },
                    width, 2, width % 3);
        }
}

TEST(SampleLayout, words_beyond_their_bits_stay_what_they_are) {
    const std::vector<std::byte> packed = {std::byte{0xff}, std::byte{0x1f}};
    std::vector<uint16_t> unpacked(1);
    ASSERT_TRUE(unpack_samples(packed, {SamplePacking::words, 12}, 1, 1, 2, unpacked).ok());
    EXPECT_EQ(unpacked[0], 0x1fff) << "above white: it counts as saturated";
}

TEST(SampleLayout, nothing_is_unpacked_into_nothing) {
    EXPECT_TRUE(unpack_samples({}, {SamplePacking::bytes, 8}, 0, 4, 0, {}).ok());
    EXPECT_TRUE(unpack_samples({}, {SamplePacking::bytes, 8}, 4, 0, 4, {}).ok());
}

TEST(SampleLayout, sizes_that_do_not_fit_are_refused_with_figures) {
    const std::vector<std::byte> packed(1000);
    std::vector<uint16_t> room(64);
    const auto error = [&](const SampleLayout& layout, size_t samples, size_t height, size_t row_bytes) {
        return error_of(unpack_samples(packed, layout, samples, height, row_bytes, room));
    };
    const SampleLayout packed_12{SamplePacking::bits_low, 12};
    EXPECT_EQ(error(packed_12, 16, 4, 24), "");
    EXPECT_EQ(error(packed_12, 16, 4, 23), "rows of 16 samples of 12 bits take 24 bytes, and they are 23 bytes apart");
    EXPECT_EQ(error(packed_12, 16, 5, 24), "5 rows of 16 samples do not go into room for 64");
    EXPECT_EQ(error(packed_12, 0, 4, 24), "4 rows of 0 samples do not go into room for 64");
    EXPECT_NE(error(packed_12, 16, 4, 400).find("cut short: 1000 bytes came"), std::string::npos);
    EXPECT_NE(error(packed_12, 16, 4, size_t(1) << 62).find("cut short"), std::string::npos);
    EXPECT_NE(error(packed_12, size_t(1) << 60, (size_t(1) << 4) + 1, 24).find("do not go"), std::string::npos);
}

TEST(SampleLayout, a_packing_that_there_is_not_is_refused) {
    std::vector<std::byte> packed(100);
    std::vector<uint16_t> room(8);
    for (const SampleLayout& layout :
         {SampleLayout{SamplePacking::bytes, 12}, SampleLayout{SamplePacking::mipi, 14},
          SampleLayout{SamplePacking::gige_pairs, 8}, SampleLayout{SamplePacking::words, 17},
          SampleLayout{SamplePacking::bits_low, 0}, SampleLayout{SamplePacking(99), 12}})
        EXPECT_NE(error_of(unpack_samples(packed, layout, 8, 1, 32, room)).find("pixel format"), std::string::npos);
}

}  // namespace ols::test

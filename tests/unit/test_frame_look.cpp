// SPDX-License-Identifier: MIT
// One pass over rows in any portions gives what passes over the whole frame give, and the copy is the samples.
// links: ols_record
#include "record/frame_look.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <random>
#include <tuple>

#include "device/row_copy.hpp"
#include "image/streamed_copy.hpp"

namespace ols {
namespace {

struct Shape {
    uint32_t width, height, padding;
    Cfa cfa;
    PixelFormat format;
};

Frame frame_of(const Shape& shape, uint32_t seed) {
    Frame frame;
    frame.width = shape.width, frame.height = shape.height;
    frame.cfa = shape.cfa, frame.format = shape.format;
    frame.pitch_bytes = uint32_t(row_samples(frame) * sample_bytes(shape.format)) + shape.padding;
    frame.samples.assign(size_t(frame.pitch_bytes) * frame.height, std::byte(0xa5));
    std::mt19937 random(seed);
    for (uint32_t y = 0; y < frame.height; ++y) {
        std::byte* const row = frame.samples.data() + size_t(y) * frame.pitch_bytes;
        for (size_t x = 0; x < row_samples(frame); ++x) {
            // Saturated rows, too: their sums are the largest.
            if (shape.format == PixelFormat::u16)
                reinterpret_cast<uint16_t*>(row)[x] = y % 3 == 0 ? 65535 : uint16_t(random());
            else
                reinterpret_cast<float*>(row)[x] = float(random() % 100000) / 7;
        }
    }
    return frame;
}

// In whole numbers, or in double in the order of the samples.
double block_mean(const Frame& frame, size_t column, size_t row) {
    constexpr size_t grid = FrameSummary::grid;
    const size_t channels = row_samples(frame) / frame.width;
    double sum = 0, count = 0;
    for (size_t y = 0; y < frame.height; ++y) {
        if (y * grid / frame.height != row) continue;
        double of_row = 0;
        for (size_t x = column * frame.width / grid * channels; x < (column + 1) * frame.width / grid * channels; ++x) {
            const std::byte* const at = frame.samples.data() + y * frame.pitch_bytes;
            of_row += frame.format == PixelFormat::u16 ? double(reinterpret_cast<const uint16_t*>(at)[x])
                                                       : double(reinterpret_cast<const float*>(at)[x]);
            ++count;
        }
        sum += of_row;
    }
    return sum / count;
}

const std::vector<Shape> shapes = {
    {640, 48, 0, Cfa::none, PixelFormat::u16},  {643, 37, 6, Cfa::rggb, PixelFormat::u16},
    {8, 8, 2, Cfa::none, PixelFormat::u16},     {129, 61, 0, Cfa::rgb, PixelFormat::u16},
    {16384, 24, 0, Cfa::rgb, PixelFormat::u16}, {77, 19, 4, Cfa::none, PixelFormat::f32},
};

TEST(FrameLook, of_rows_in_any_portions_is_that_of_the_whole_frame) {
    for (const Shape& shape : shapes) {
        const Frame frame = frame_of(shape, shape.width);
        FrameLook whole;
        whole.complete(frame);
        for (const uint32_t portion : {1u, 5u, 8u, 13u, 1000u}) {
            FrameLook look;
            for (uint32_t y = 0; y < frame.height; y += portion)
                look.watch(frame, y, std::min(portion, frame.height - y),
                           frame.samples.data() + size_t(y) * frame.pitch_bytes);
            look.complete(frame);  // nothing is left
            EXPECT_EQ(look.hash(), whole.hash()) << shape.width << " in rows of " << portion;
            const FrameSummary summary = look.sums().summary(64, {});
            for (size_t b = 0; b < summary.blocks.size(); ++b)
                EXPECT_EQ(summary.blocks[b], float(block_mean(frame, b % 8, b / 8) - 64))
                    << shape.width << " block " << b;
        }
    }
}

TEST(FrameLook, of_a_frame_that_was_shown_in_part_is_completed_and_of_another_one_begun_anew) {
    const Frame first = frame_of(shapes[0], 1), second = frame_of(shapes[0], 2);
    FrameLook alone, look;
    alone.complete(second);
    look.watch(first, 0, 30, first.samples.data());
    look.watch(second, 0, 12, second.samples.data());  // a frame that was not handed on is followed by another
    look.complete(second);
    EXPECT_EQ(look.hash(), alone.hash());
    look.complete(first);
    EXPECT_EQ(look.hash(), alone.hash()) << "all rows were seen: whose, who looks must say";
    look.forget();
    look.complete(first);
    EXPECT_NE(look.hash(), alone.hash());
}

TEST(RowCopy, gives_the_frame_every_byte_and_shows_each_row_once) {
    for (const Shape& shape : shapes) {
        const Frame frame = frame_of(shape, 3);
        Frame copy = frame;
        copy.samples = {};
        FrameLook look, whole;
        RowCopy rows;
        for (int time = 0; time < 2; ++time) {
            rows.copy(frame.samples.data(), copy, &look);
            EXPECT_EQ(copy.samples, frame.samples) << shape.width;
        }
        whole.complete(frame);
        EXPECT_EQ(look.hash(), whole.hash()) << shape.width;
        rows.copy(frame.samples.data(), copy, nullptr);
        EXPECT_EQ(copy.samples, frame.samples);
    }
}

TEST(StreamedCopy, is_a_copy_from_and_to_any_place_and_touches_nothing_else) {
    std::vector<std::byte> from(700), to(700);
    for (size_t i = 0; i < from.size(); ++i) from[i] = std::byte(i * 31 + 7);
    for (size_t offset = 0; offset < 66; ++offset)
        for (const size_t bytes : {0u, 1u, 63u, 64u, 65u, 200u, 513u}) {
            std::ranges::fill(to, std::byte(0xee));
            copy_past_caches(from.data() + 3, bytes, to.data() + offset);
            std::vector<std::byte> expected(700, std::byte(0xee));
            std::copy_n(from.begin() + 3, bytes, expected.begin() + ptrdiff_t(offset));
            ASSERT_EQ(to, expected) << bytes << " bytes to " << offset;
        }
}

}  // namespace
}  // namespace ols

// SPDX-License-Identifier: MIT
// Samples above black by colour: against counts by hand and against planes of floats, which hold every count.
// links: ols_capture
#include "capture/color_planes.hpp"

#include <gtest/gtest.h>

#include <cstring>

#include "reflectance/masked_sample.hpp"

using namespace ols;

namespace {

Frame mono_frame(const std::vector<uint16_t>& counts, float white) {
    Frame frame;
    frame.width = uint32_t(counts.size()), frame.height = 1, frame.cfa = Cfa::none, frame.white = white;
    frame.pitch_bytes = uint32_t(counts.size() * sizeof(uint16_t));
    frame.samples.resize(frame.pitch_bytes);
    std::memcpy(frame.samples.data(), counts.data(), frame.samples.size());
    return frame;
}

Image level_black(int width, float level) {
    Image black(width, 1, 1);
    std::ranges::fill(black.data, level);
    return black;
}

template <typename Sample>
ColorPlanes<Sample> planes_of(const Frame& frame, const Image& black) {
    return color_planes(frame, black_planes<Sample>(black, frame.cfa, frame.format));
}

}  // namespace

// What breaks narrowing first: of a sensor that counts on beyond its white, 32768 + 64 is the first to wrap.
TEST(ColorPlanes, clipped_samples_beyond_15_bits_are_largest_and_never_wrap) {
    const std::vector<uint16_t> counts = {64, 4000, 4094, 4095, 16000, 32767, 32831, 32832, 40000, 65535};
    const Frame frame = mono_frame(counts, 4095);
    for (const float level : {64.25f, -3.0f}) {
        const Image black = level_black(int(counts.size()), level);
        ASSERT_TRUE(fits_shorts(frame.format, frame.white, black));
        const auto shorts = planes_of<int16_t>(frame, black);
        const auto floats = planes_of<float>(frame, black);
        ASSERT_EQ(shorts.clipped.size(), 1u);
        for (size_t i = 0; i < counts.size(); ++i) {
            EXPECT_EQ(is_masked(shorts.planes[0].samples[i]), counts[i] >= 4095) << counts[i];
            EXPECT_EQ(float(shorts.clipped[0].samples[i]),
                      std::min(floats.clipped[0].samples[i], float(shorts.largest)))
                << counts[i];
        }
    }
}

TEST(ColorPlanes, without_saturation_nothing_is_masked_or_kept_twice) {
    const auto planes = planes_of<int16_t>(mono_frame({60, 64, 4094}, 4095), level_black(3, 64));
    EXPECT_EQ(planes.planes[0].samples, (std::vector<int16_t>{-4, 0, 4030}));
    EXPECT_FALSE(planes.any_masked);
    EXPECT_TRUE(planes.clipped.empty());
}

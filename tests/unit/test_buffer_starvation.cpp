// SPDX-License-Identifier: MIT
// Gaps between frames, of which some found no buffer and some were lost before: the buffers are counted by hand.
// links: ols_device
#include "device/buffer_starvation.hpp"

#include <gtest/gtest.h>

using namespace ols;

namespace {

constexpr size_t buffers = 8;

class Starvation : public testing::Test {
  protected:
    void SetUp() override { starvation_.start(buffers, 0); }
    void take(int count, uint64_t unplaced) {
        for (int n = 0; n < count; ++n) starvation_.take(unplaced);
    }
    BufferStarvation starvation_;
};

}  // namespace

TEST_F(Starvation, a_gap_is_that_of_the_frames_without_a_buffer_only_behind_all_that_the_buffers_held) {
    take(3, 0);
    EXPECT_FALSE(starvation_.explains_gap());
    // Nobody reads; eight frames fill the buffers, and five more find none. Of the eight the third and the fourth have a gap between them
    // that was there before.
    take(4, 5);
    EXPECT_FALSE(starvation_.explains_gap());
    take(4, 5);  // the eighth, had there been one in somebody's hands, would be behind the gap
    EXPECT_TRUE(starvation_.explains_gap());
    take(1, 5);
    EXPECT_TRUE(starvation_.explains_gap());
    take(1, 5);
    EXPECT_FALSE(starvation_.explains_gap());
}

TEST_F(Starvation, the_frame_that_is_being_read_has_its_buffer_still) {
    take(3, 0);
    take(8, 5);  // seven others were filled when the five came
    EXPECT_TRUE(starvation_.explains_gap());
}

TEST_F(Starvation, a_second_time_without_a_buffer_has_a_gap_of_its_own) {
    take(1, 2);
    take(1, 4);
    take(7, 4);
    EXPECT_TRUE(starvation_.explains_gap());
    take(1, 4);
    EXPECT_TRUE(starvation_.explains_gap());
    take(2, 4);
    EXPECT_FALSE(starvation_.explains_gap());
}

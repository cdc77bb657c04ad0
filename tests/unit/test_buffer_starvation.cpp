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
    // Takes so many whole frames; whether a gap before the last of them was for want of a buffer.
    bool take(int count, uint64_t unplaced) {
        bool is_starved = false;
        for (int n = 0; n < count; ++n) {
            starvation_.take(unplaced);
            is_starved = starvation_.explains_gap();
        }
        return is_starved;
    }
    BufferStarvation starvation_;
};

}  // namespace

TEST_F(Starvation, a_gap_is_that_of_the_frames_without_a_buffer_only_behind_all_that_the_buffers_held) {
    EXPECT_FALSE(take(3, 0));
    // Nobody reads; eight frames fill the buffers, or seven beside one in somebody's hands, and five more find none. A gap that is
    // before these eight was there before.
    EXPECT_FALSE(take(4, 5));
    EXPECT_FALSE(take(3, 5));
    EXPECT_TRUE(take(1, 5));
    EXPECT_TRUE(take(1, 5));
    EXPECT_FALSE(take(1, 5));
}

TEST_F(Starvation, a_frame_of_which_some_packets_found_no_buffer_belongs_to_the_gap) {
    EXPECT_FALSE(take(3, 0));
    EXPECT_FALSE(take(7, 5));
    starvation_.take(5);
    starvation_.take(5);  // two that are not whole
    EXPECT_TRUE(take(1, 5));
    EXPECT_FALSE(take(1, 5));
}

TEST_F(Starvation, a_second_time_without_a_buffer_has_a_gap_of_its_own) {
    EXPECT_FALSE(take(1, 2));
    EXPECT_FALSE(take(1, 4));
    EXPECT_FALSE(take(5, 4));
    for (int gap = 0; gap < 3; ++gap) EXPECT_TRUE(take(1, 4)) << gap;
    EXPECT_FALSE(take(1, 4));
}

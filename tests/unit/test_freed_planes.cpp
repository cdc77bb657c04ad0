// SPDX-License-Identifier: MIT
// Planes that are let go of come again, whichever thread made them, and never more than the bound is kept.
// links: ols_image
#include "image/freed_planes.hpp"

#include <gtest/gtest.h>

#include <cstdint>
#include <set>
#include <thread>

#include "image/plane.hpp"

namespace ols {
namespace {

constexpr size_t bytes = 1 << 20;

TEST(FreedPlanes, are_kept_only_when_they_are_asked_for_and_come_again_for_the_same_size) {
    (void)keep_freed_planes();
    void* const first = take_plane(bytes);
    EXPECT_EQ(uintptr_t(first) % plane_alignment, 0u);
    std::thread([&] { give_back_plane(first, bytes); }).join();
    void* const larger = take_plane(2 * bytes);
    EXPECT_NE(larger, first);
    void* const again = take_plane(bytes);
    EXPECT_EQ(again, first);
    give_back_plane(again, bytes), give_back_plane(larger, 2 * bytes);
}

TEST(FreedPlanes, are_never_lent_twice) {
    (void)keep_freed_planes();
    std::set<void*> lent;
    for (int n = 0; n < 20; ++n) EXPECT_TRUE(lent.insert(take_plane(bytes)).second);
    for (void* plane : lent) give_back_plane(plane, bytes);
    std::set<void*> second;
    for (int n = 0; n < 20; ++n) EXPECT_TRUE(second.insert(take_plane(bytes)).second);
    EXPECT_EQ(second, lent);
    for (void* plane : second) give_back_plane(plane, bytes);
}

TEST(FreedPlanes, beyond_the_bound_go_back) {
    (void)keep_freed_planes();
    constexpr size_t huge = kept_bytes_max / 4;
    std::set<void*> lent;
    for (int n = 0; n < 6; ++n) lent.insert(take_plane(huge));  // never touched: no memory is behind them
    for (void* plane : lent) give_back_plane(plane, huge);
    std::set<void*> again;
    for (int n = 0; n < 6; ++n) again.insert(take_plane(huge));
    EXPECT_EQ(again.size(), 6u);
    for (void* plane : again) give_back_plane(plane, huge);
}

TEST(FreedPlanes, a_plane_of_more_bytes_than_there_are_is_an_exception) {
    EXPECT_THROW((void)PlaneAllocator<float>().allocate(size_t(-1) / 2), std::bad_alloc);
}

}  // namespace
}  // namespace ols

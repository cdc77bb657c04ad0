// SPDX-License-Identifier: MIT
// Planes that are let go of come again, whichever thread made them, and never more than the bound is kept.
// links: ols_image
#include "image/freed_planes.hpp"

#include <gtest/gtest.h>
#include <sys/mman.h>

#include <cstdint>
#include <set>
#include <thread>
#include <vector>

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

TEST(FreedPlanes, of_another_size_go_back_first) {
    (void)keep_freed_planes();
    constexpr size_t others = kept_bytes_max / 3, own = kept_bytes_max / 4;
    std::set<void*> lent;
    for (int n = 0; n < 3; ++n) lent.insert(take_plane(others));
    for (void* plane : lent) give_back_plane(plane, others);
    void* const plane = take_plane(own);
    give_back_plane(plane, own);
    EXPECT_EQ(take_plane(own), plane);
    give_back_plane(plane, own);
}

TEST(FreedPlanes, that_were_made_before_they_were_kept_go_back_to_where_they_came_from) {
    auto* const small = static_cast<char*>(take_plane(plane_bytes_min - 1));  // as those are: from the heap
    small[0] = 1;
    give_back_plane(small, plane_bytes_min);
    void* const next = take_plane(plane_bytes_min);
    EXPECT_NE(next, small);
    give_back_plane(next, plane_bytes_min);
}

TEST(FreedPlanes, do_not_overlap_and_keep_what_is_written_in_them) {
    (void)keep_freed_planes();
    for (const size_t size : {plane_bytes_min, plane_bytes_min + 4, size_t(640 * 480 * 4), size_t(65 << 20)}) {
        constexpr int planes = 60;
        std::vector<unsigned char*> lent;
        for (int n = 0; n < planes; ++n) lent.push_back(static_cast<unsigned char*>(take_plane(size)));
        for (int n = 0; n < planes; ++n) lent[n][0] = lent[n][size / 2] = lent[n][size - 1] = (unsigned char)n;
        for (int n = 0; n < planes; ++n) {
            EXPECT_EQ(uintptr_t(lent[n]) % plane_alignment, 0u);
            ASSERT_TRUE(lent[n][0] == n && lent[n][size / 2] == n && lent[n][size - 1] == n) << size;
        }
        for (unsigned char* plane : lent) give_back_plane(plane, size);
    }
}

TEST(FreedPlanes, that_were_prepared_are_there_page_by_page) {
    (void)keep_freed_planes();
    constexpr size_t size = 3 << 20, count = 7, page = 4096;
    prepare_planes(size, count);
    std::vector<void*> lent;
    for (size_t n = 0; n < count; ++n) {
        lent.push_back(take_plane(size));
        auto* const first = reinterpret_cast<unsigned char*>(uintptr_t(lent.back()) / page * page);
        std::vector<unsigned char> resident((static_cast<unsigned char*>(lent.back()) + size - first + page - 1) /
                                            page);
        ASSERT_EQ(mincore(first, resident.size() * page, resident.data()), 0);
        for (const unsigned char is_there : resident) ASSERT_TRUE(is_there & 1) << n;
    }
    for (void* plane : lent) give_back_plane(plane, size);
}

TEST(FreedPlanes, a_plane_of_more_bytes_than_there_are_is_an_exception) {
    (void)keep_freed_planes();
    EXPECT_THROW((void)PlaneAllocator<float>().allocate(size_t(-1) / 2), std::bad_alloc);
    EXPECT_THROW((void)PlaneAllocator<float>().allocate(size_t(-1) / 4), std::bad_alloc);
}

}  // namespace
}  // namespace ols

// SPDX-License-Identifier: MIT
// links: ols_device
#include "device/library_thread.hpp"

#include <gtest/gtest.h>

#include <atomic>
#include <future>
#include <thread>

namespace ols {
namespace {

const auto never = [] { return false; };
constexpr int surely_ms = 30'000;

}  // namespace

TEST(LibraryThread, calls_are_made_in_order_in_one_thread_and_answered) {
    LibraryThread library;
    std::string made;
    std::thread::id first;
    library.post([&] { made += "a", first = std::this_thread::get_id(); });
    library.post([&] { made += "b"; });
    const auto answer =
        library.run([&] { return made + (first == std::this_thread::get_id() ? "c" : "?"); }, surely_ms, never);
    EXPECT_EQ(answer, "abc");
}

TEST(LibraryThread, a_call_that_hangs_is_not_waited_for_and_keeps_what_it_holds_until_it_ends) {
    const auto held = std::make_shared<int>(7);
    std::promise<void> ending;
    {
        LibraryThread library;
        library.post([held, end = ending.get_future().share()] { end.wait(); });
        EXPECT_FALSE(library.run([] { return 1; }, 20, never).has_value());
        std::atomic<int> looks = 0;
        EXPECT_FALSE(library.run([] { return 2; }, surely_ms, [&] { return ++looks > 2; }).has_value());
        EXPECT_EQ(held.use_count(), 2);
        ending.set_value();
    }
    EXPECT_EQ(held.use_count(), 1) << "its end was waited for";
}

TEST(LibraryThread, one_whose_device_has_gone_is_left_behind_and_keeps_what_it_holds_until_it_ends) {
    const auto held = std::make_shared<int>(7);
    std::promise<void> ending, ended;
    {
        LibraryThread library(1'000'000'000);
        library.post([held, end = ending.get_future().share()] { end.wait(); });
        library.post([&] { ended.set_value(); });
        library.leave_behind();
    }
    EXPECT_EQ(held.use_count(), 2) << "its end was not waited for";
    ending.set_value();
    ended.get_future().wait();
    EXPECT_EQ(held.use_count(), 1);
}

TEST(LibraryThread, ticks_while_nothing_is_asked_and_no_more_once_it_is_taken_back) {
    LibraryThread library;
    std::promise<void> ticked;
    std::atomic<int> ticks = 0;
    library.set_tick(
        [&] {
            if (++ticks == 3) ticked.set_value();
        },
        1);
    ticked.get_future().wait();
    library.set_tick(nullptr, 1);
    (void)library.run([] { return 0; }, surely_ms, never);
    const int then = ticks;
    (void)library.run([] { return std::this_thread::sleep_for(std::chrono::milliseconds(5)), 0; }, surely_ms, never);
    EXPECT_EQ(ticks, then);
}

TEST(LibraryThread, an_exception_of_a_call_is_its_callers) {
    LibraryThread library;
    EXPECT_THROW((void)library.run([]() -> int { throw std::bad_alloc(); }, surely_ms, never), std::bad_alloc);
    EXPECT_EQ(library.run([] { return 3; }, surely_ms, never), 3);
}

}  // namespace ols

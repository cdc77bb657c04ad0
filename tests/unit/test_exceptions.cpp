// SPDX-License-Identifier: MIT
// Exceptions of libraries and of worker threads: each reaches its caller, and the work of the others is done.
// links: ols_image
#include "exceptions.hpp"

#include <gtest/gtest.h>

#include <atomic>
#include <stdexcept>

#include "worker_threads.hpp"

using namespace ols;

TEST(Exceptions, become_errors_that_say_what_was_being_done) {
    const auto says = [](auto&& work) { return guarded("cannot read 'x'", work).error().message; };
    EXPECT_EQ(says([]() -> Status { throw std::runtime_error("no such tile"); }), "cannot read 'x': no such tile");
    EXPECT_EQ(says([]() -> Status { throw std::bad_alloc(); }),
              "cannot read 'x': memory ran out: close other programs, or raise the limit (ulimit -v)");
    EXPECT_EQ(says([]() -> Status { throw 5; }), "cannot read 'x': a library gave up without a reason");
    EXPECT_EQ(says([]() -> Status { return fail("as it is"); }), "as it is");
    EXPECT_EQ(*guarded("", [] { return Result<int>(7); }), 7);
}

TEST(Exceptions, of_any_worker_reach_its_caller_after_all_work_is_done) {
    for (int thrower = 0; thrower < 4; ++thrower) {
        std::atomic<int> next = 0, done = 0;
        try {
            run_workers(4, [&](int worker) {
                if (worker == thrower) throw std::length_error("too long");
                for (; next++ < 1000;) ++done;
            });
            FAIL();
        } catch (const std::length_error& e) {
            EXPECT_STREQ(e.what(), "too long");
        }
        EXPECT_EQ(done, 1000);
    }
}

TEST(Exceptions, of_all_workers_are_one) {
    EXPECT_THROW(run_workers(8, [](int) { throw std::bad_alloc(); }), std::bad_alloc);
}

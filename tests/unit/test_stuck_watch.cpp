// SPDX-License-Identifier: MIT
// What feeds systemd's watchdog: only a stage that works and has no beat for too long is stuck.
// links: ols_daemon
#include "daemon/stuck_watch.hpp"

#include <gtest/gtest.h>

namespace ols {
namespace {

using namespace std::chrono_literals;

TEST(StuckWatch, names_a_stage_that_works_without_a_beat_and_no_other) {
    StuckWatch watch;
    const StuckWatch::Clock::time_point start{};
    const auto look = [&](uint64_t beats, StageActivity activity, std::chrono::seconds at) {
        return watch.look({{"reader", uint64_t(at.count()), StageActivity::works}, {"developer", beats, activity}},
                          start + at, 60s);
    };
    EXPECT_EQ(look(1, StageActivity::works, 0s), "");
    EXPECT_EQ(look(1, StageActivity::works, 60s), "");
    EXPECT_EQ(look(1, StageActivity::works, 61s), "developer");
    EXPECT_EQ(look(2, StageActivity::works, 62s), "");
    EXPECT_EQ(look(2, StageActivity::works, 122s), "");
    EXPECT_EQ(look(2, StageActivity::waits_for_room, 200s), "");
    EXPECT_EQ(look(2, StageActivity::waits_for_input, 300s), "");
    EXPECT_EQ(look(2, StageActivity::works, 360s), "");
    EXPECT_EQ(look(2, StageActivity::works, 361s), "developer");
    EXPECT_EQ(look(2, StageActivity::ended, 900s), "");
}

}  // namespace
}  // namespace ols

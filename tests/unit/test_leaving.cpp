// SPDX-License-Identifier: MIT
// Leaving for the boot loader, on the board without hardware: when it is refused, and that nothing else happens after it.
// links: ols_firmware
#include "link_fixture.hpp"

extern "C" {
#include "link.h"
}

using namespace ols::test;

namespace {

TEST_F(Link, leaves_for_the_boot_loader_once_the_answer_is_out) {
    EXPECT_FALSE(link_is_leaving());
    EXPECT_TRUE(ask(OLS_REBOOT_TO_BOOTLOADER).ok(OLS_REBOOT_TO_BOOTLOADER));
    EXPECT_TRUE(link_is_leaving());
}

TEST_F(Link, does_not_leave_while_armed_or_playing) {
    ASSERT_TRUE(load(program(18), 0).ok(OLS_LOAD_END));
    ASSERT_TRUE(arm().ok(OLS_ARM));
    EXPECT_EQ(ask(OLS_REBOOT_TO_BOOTLOADER).error(), OLS_ERROR_BAD_STATE);
    ASSERT_TRUE(ask(OLS_START).ok(OLS_START));
    EXPECT_EQ(ask(OLS_REBOOT_TO_BOOTLOADER).error(), OLS_ERROR_BAD_STATE);
    EXPECT_FALSE(link_is_leaving());
    ASSERT_TRUE(ask(OLS_STOP).ok(OLS_STOP));
    EXPECT_TRUE(ask(OLS_REBOOT_TO_BOOTLOADER).ok(OLS_REBOOT_TO_BOOTLOADER));
}

TEST_F(Link, a_latched_fault_is_no_obstacle_to_flashing) {
    play();
    board_host_starve_timeline();
    board_host_run_us(1000);
    ASSERT_EQ(status().state, OLS_STATE_FAULT);
    EXPECT_TRUE(ask(OLS_REBOOT_TO_BOOTLOADER).ok(OLS_REBOOT_TO_BOOTLOADER));
    EXPECT_TRUE(link_is_leaving());
}

TEST_F(Link, what_comes_after_the_request_to_leave_is_not_done) {
    ASSERT_TRUE(load(program(18), 0).ok(OLS_LOAD_END));
    Bytes stream(2 * OLS_FRAME_BYTES_MAX);
    const Bytes to_arm = bytes_of(ols_arm{});
    size_t bytes = ols_frame_encode(OLS_REBOOT_TO_BOOTLOADER, 1, nullptr, 0, stream.data(), stream.size());
    bytes += ols_frame_encode(OLS_ARM, 2, to_arm.data(), to_arm.size(), stream.data() + bytes, stream.size() - bytes);
    uint8_t answer[OLS_FRAME_BYTES_MAX];
    const size_t answered = board_host_exchange(stream.data(), bytes, answer, sizeof answer);
    EXPECT_EQ(answered, size_t(OLS_FRAME_BYTES_MAX - OLS_PAYLOAD_BYTES_MAX)) << "one empty reply and no second";
    EXPECT_TRUE(link_is_leaving());
    EXPECT_FALSE(board_host_pins_are_connected());
}

}  // namespace

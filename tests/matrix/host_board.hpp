// SPDX-License-Identifier: MIT
// HostBoard: the firmware's own code on this machine (firmware/board_host.c) as a board that is asked over the wire's messages, and whose
// pulses and failures a test has in its hand. One at a time: the firmware is.
#pragma once

#include <atomic>
#include <memory>
#include <mutex>
#include <optional>

#include "device/transfer.hpp"
#include "frame.h"
#include "scenario.hpp"

namespace ols::test {

class HostBoard {
  public:
    HostBoard();

    // For Board::connect().
    std::unique_ptr<Transfer> connect();

    bool has_started() const { return has_started_; }
    // Lets time pass until trigger n has fired: its rise in ticks since the start, as the pin was measured. Nothing when the board
    // ends before.
    std::optional<uint64_t> fire(uint64_t trigger);
    // Lets the last light end, and the program with it.
    void run_out();
    void fail(BoardFault fault);
    uint64_t now_us() const { return now_us_; }  // since power-up
    // The first trigger whose log entry nobody has asked for.
    uint64_t log_wanted_from() const { return log_wanted_from_; }

  private:
    friend class HostBoardTransfer;
    void pass(uint64_t us);
    std::vector<uint8_t> exchange(std::span<const uint8_t> bytes);

    std::mutex mutex_;
    ols_frame_parser requests_{};  // what was asked, to know of starts
    std::atomic<bool> has_started_ = false;
    std::atomic<uint64_t> log_wanted_from_ = 0, now_us_ = 0;
};

}  // namespace ols::test

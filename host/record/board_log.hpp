// SPDX-License-Identifier: MIT
// BoardLog: follows a playing board from a thread of its own and tells what it fired.
#pragma once

#include <atomic>
#include <functional>
#include <string>
#include <thread>
#include <vector>

#include "device/board.hpp"

namespace ols {

struct LogNews {
    std::vector<ols_trigger_log_entry> entries;
    uint64_t next_counter = 0;
    uint64_t arrivals = 0;  // frames that had arrived before the board was asked
};

class BoardLog {
  public:
    // Starts to follow; both functions are called from the thread. `arrivals` counts the frames read from the camera.
    // on_end comes once, last: "" when the board has played everything, else why it stopped.
    // When `stop` turns true the board is told to stop, and what it fired until then is still read.
    BoardLog(Board& board, const std::atomic<uint64_t>& arrivals, const std::atomic<bool>& stop,
             std::function<void(LogNews)> on_news, std::function<void(std::string)> on_end);
    ~BoardLog();  // waits for the end

  private:
    std::string follow();

    Board& board_;
    const std::atomic<uint64_t>& arrivals_;
    const std::atomic<bool>& stop_;
    std::function<void(LogNews)> on_news_;
    std::thread thread_;
};

}  // namespace ols

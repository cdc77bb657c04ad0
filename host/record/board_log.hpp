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

// How a log ended.
struct LogEnd {
    std::string why;       // the board stopped early, or is heard no more; "" when it has played everything
    bool is_lost = false;  // it is heard no more: what it fired later than the last news is not known
};

class BoardLog {
  public:
    // Starts to follow; all functions are called from the thread. `arrivals` counts the frames read from the camera.
    // on_end comes once, last.
    // When `why_stop` says something the board is told to stop, and what it fired until then is still read; LogEnd says it.
    BoardLog(Board& board, const std::atomic<uint64_t>& arrivals, std::function<std::string()> why_stop,
             std::function<void(LogNews)> on_news, std::function<void(LogEnd)> on_end);
    ~BoardLog();  // waits for the end

  private:
    LogEnd follow();

    Board& board_;
    const std::atomic<uint64_t>& arrivals_;
    std::function<std::string()> why_stop_;
    std::function<void(LogNews)> on_news_;
    std::thread thread_;
};

}  // namespace ols

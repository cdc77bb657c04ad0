// SPDX-License-Identifier: MIT
// BoardLog: follows a playing board from a thread of its own and tells what it fired.
#pragma once

#include <functional>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include "device/board.hpp"
#include "record/cause.hpp"
#include "record/clock_fit.hpp"
#include "record/record_monitor.hpp"
#include "stage/sequence.hpp"

namespace ols {

struct LogNews {
    std::vector<ols_trigger_log_entry> entries;
    uint64_t next_counter = 0;
    std::vector<uint64_t> arrivals;  // of each camera: frames that had arrived before the board was asked
};

// How a log ended.
struct LogEnd {
    Reason why;            // the board stopped early, or is heard no more; empty when it has played everything
    bool is_lost = false;  // it is heard no more: what it fired later than the last news is not known
};

// What a program can fire and last at most; a board that does more is not believed.
struct PlayBounds {
    uint64_t triggers = UINT32_MAX;
    uint64_t ticks = UINT64_MAX;  // from its start

    explicit PlayBounds(const Sequence& sequence);
    PlayBounds() = default;  // of a play that others may change
};

class BoardLog {
  public:
    // Starts to follow; all functions are called from the thread. `arrivals` counts the frames read from each camera.
    // on_end comes once, last.
    // When `why_stop` says something the board is told to stop, and what it fired until then is still read; LogEnd says it.
    // `between` may use the board, before each look at its log; its error means that the board is heard no more.
    // `monitor`, which may be null, hears of triggers, of the stop and of the dark.
    // A board that is heard no more, or whose log or clock does not go on as it must, is told to stop and given up.
    BoardLog(Board& board, const PlayBounds& bounds, std::function<std::vector<uint64_t>()> arrivals,
             std::function<Reason()> why_stop, std::function<void(LogNews)> on_news, std::function<void(LogEnd)> on_end,
             std::function<Status()> between = {}, RecordMonitor* monitor = nullptr);
    ~BoardLog();  // waits for the end

    // This machine's steady clock beside the board's, by what was asked of the board. After the end.
    std::optional<ClockRelation> host_clock() const { return host_clock_.relation(); }

  private:
    LogEnd follow();
    LogEnd read_to_end();
    Status check_clock(const ols_status_reply& status);
    Result<ols_status_reply> ask_status();
    void tell_to_stop();

    Board& board_;
    const PlayBounds bounds_;
    std::function<std::vector<uint64_t>()> arrivals_;
    std::function<Reason()> why_stop_;
    std::function<void(LogNews)> on_news_;
    HostClock host_clock_;
    std::function<Status()> between_;
    RecordMonitor own_monitor_;  // where nobody else's is given
    RecordMonitor& monitor_;
    StageBeat& beat_;
    uint64_t last_tick_ = 0;  // that the board told
    std::optional<Deadline> next_tick_;
    std::thread thread_;
};

}  // namespace ols

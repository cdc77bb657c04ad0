// SPDX-License-Identifier: MIT
// The board and the cameras that the daemon holds between takes.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "device/board.hpp"
#include "device/camera.hpp"
#include "record/stop_request.hpp"
#include "stage/stage.hpp"

namespace ols {

// For one thread.
class StageDevices {
  public:
    // Opens what the stage names. `stop` bounds every wait for the board (device/patience.hpp) and outlives this. The error says
    // which device is not there and what to do.
    static Result<StageDevices> open(const StageConfig& stage, const StopRequest& stop);

    // The board alone.
    static Result<Board> open_board(const StageConfig& stage, const StopRequest& stop);

    // Whether all are still there and the board is as it was left: dark, `armed` or not, without a fault. The error says what is not.
    Status look(bool armed);

    // Dark, by the board's own word: its state after a stop is one in which nothing may be lit. The error says what it answered.
    static Status make_dark(Board& board);
    Status make_dark() { return make_dark(*board_); }

    Board& board() { return *board_; }
    std::vector<Camera*> cameras() const;

    // "Pico (e6...) at 'usb:...', firmware 0.1; camera 0: ...".
    std::string account() const;

  private:
    std::unique_ptr<Board> board_;
    std::vector<std::unique_ptr<Camera>> cameras_;
};

}  // namespace ols

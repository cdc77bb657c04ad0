// SPDX-License-Identifier: MIT
// A stage that costs next to nothing: a ring whose records hold a plausible recording from the start, as a camera's own memory access
// would leave it, and a board that plays by a clock. What is measured with it is the host alone.
#pragma once

#include <atomic>
#include <memory>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include "../unit/played_board.hpp"
#include "device/camera.hpp"
#include "device/ring.hpp"
#include "stage/sequence.hpp"

namespace ols {

enum class Pace {
    stage,  // 2160 frames a second by this machine's clock; a frame that finds the ring full is dropped
    host,   // as fast as they are read; the board's clock goes by the frames
};

// The pictures of one cycle, with noise: a textured subject that sways, in soft light from each lamp's side.
std::vector<Frame> expose_cycle(const Sequence& sequence, const CameraConfig& camera);

class LiveStage {
  public:
    // The first camera of `stage`, and a cycle's pictures that come again in each cycle, each time with another sample or two. All
    // must outlive it.
    LiveStage(const Sequence& sequence, const StageConfig& stage, const std::vector<Frame>& cycle, Pace pace);
    ~LiveStage();

    Board& board() { return *board_; }
    Camera& camera() { return *camera_; }

  private:
    static constexpr uint64_t depth = 64;  // frames that may wait in the ring, of a camera's driver as often as not

    uint64_t ticks() const;
    void feed();
    void put(uint64_t trigger);

    const std::vector<Frame>& cycle_;
    const uint64_t triggers_, period_ticks_;
    const Pace pace_;
    const std::string path_;
    RingWriter writer_;
    std::byte* memory_ = nullptr;  // the ring once more
    size_t bytes_ = 0;
    uint64_t head_ = 0;
    std::atomic<uint64_t> put_ = 0;
    std::atomic<bool> end_ = false;
    test::PlayedBoard played_;
    std::optional<Board> board_;
    std::unique_ptr<Camera> camera_;
    std::thread thread_;
};

}  // namespace ols

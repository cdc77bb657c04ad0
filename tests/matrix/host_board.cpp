// SPDX-License-Identifier: MIT
// Exchanges go straight through; time passes only when the stage's thread says so.
#include "host_board.hpp"

#include <cstring>

#include "board_host.h"
#include "wire.h"
extern "C" {
#include "witness.h"
}

namespace ols::test {

namespace {

constexpr uint64_t step_us = 20, patience_us = 3'000;  // a slot lasts 463 us

}  // namespace

// The host's end: what was sent is answered at once.
class HostBoardTransfer : public Transfer {
  public:
    explicit HostBoardTransfer(HostBoard& board) : board_(board) {}

    std::string name() const override { return "the firmware on this machine"; }
    Status write(std::span<const uint8_t> bytes, uint32_t, const Deadline&) override {
        const auto answer = board_.exchange(bytes);
        answers_.insert(answers_.end(), answer.begin(), answer.end());
        return Done{};
    }
    Result<std::vector<uint8_t>> read(size_t capacity, uint32_t, const Deadline&) override {
        if (answers_.empty()) return ols::fail("the firmware gave no answer");
        const size_t count = std::min(capacity, answers_.size());
        std::vector<uint8_t> bytes(answers_.begin(), answers_.begin() + ptrdiff_t(count));
        answers_.erase(answers_.begin(), answers_.begin() + ptrdiff_t(count));
        return bytes;
    }

  private:
    HostBoard& board_;
    std::vector<uint8_t> answers_;
};

HostBoard::HostBoard() {
    board_host_power_up();
    board_host_attach();
}

std::unique_ptr<Transfer> HostBoard::connect() {
    return std::make_unique<HostBoardTransfer>(*this);
}

std::vector<uint8_t> HostBoard::exchange(std::span<const uint8_t> bytes) {
    const std::lock_guard lock(mutex_);
    std::vector<uint8_t> answer(1 << 16);
    answer.resize(board_host_exchange(bytes.data(), bytes.size(), answer.data(), answer.size()));
    for (size_t taken = 0; taken < bytes.size();) {
        taken += ols_frame_parser_write(&requests_, bytes.data() + taken, bytes.size() - taken);
        ols_frame frame;
        while (ols_frame_parser_read(&requests_, &frame)) {
            if (frame.type == OLS_START) has_started_ = true;
            if (frame.type != OLS_READ_TRIGGER_LOG) continue;
            ols_read_trigger_log asked;
            std::memcpy(&asked, frame.payload, sizeof asked);
            log_wanted_from_ = asked.first_counter;
        }
    }
    return answer;
}

std::optional<uint64_t> HostBoard::fire(uint64_t trigger) {
    const std::lock_guard lock(mutex_);
    for (uint64_t passed_us = 0; witness_count() <= trigger; passed_us += step_us) {
        if (passed_us > patience_us) return std::nullopt;
        pass(step_us);
    }
    return uint64_t(~witness_stamp(uint32_t(trigger))) * 2;
}

void HostBoard::run_out() {
    const std::lock_guard lock(mutex_);
    pass(patience_us);
}

void HostBoard::fail(BoardFault fault) {
    const std::lock_guard lock(mutex_);
    switch (fault) {
        case BoardFault::none: break;
        case BoardFault::timeline_starved: board_host_starve_timeline(); break;
        case BoardFault::shifter_starved: board_host_starve_shifter(); break;
        case BoardFault::late_trigger: board_host_delay_triggers(40); break;
        case BoardFault::emergency_stop:
            board_host_pull_stop_input(0, true);
            board_host_pull_stop_input(0, false);
            break;
        case BoardFault::over_duty: board_host_hold_light(UINT32_MAX); break;
        case BoardFault::reset:
            board_host_bite();
            board_host_attach();
            break;
    }
}

void HostBoard::pass(uint64_t us) {
    board_host_run_us(us);
    now_us_ += us;
}

}  // namespace ols::test

// SPDX-License-Identifier: MIT
// Transfers over CAN: protocol/isotp.h joined to a bus and its clock.
#include "device/can_transfer.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cstring>

#include "frame.h"
#include "isotp.h"
#include "wire.h"

namespace ols {

namespace {

const char* error_text(isotp_error error) {
    switch (error) {
        case ISOTP_OK: return "no error";
        case ISOTP_TIMEOUT_A: return "N_TIMEOUT_A: the bus took no frame in time; check its termination and bit rate";
        case ISOTP_TIMEOUT_BS: return "N_TIMEOUT_Bs: the board's flow control did not come; is it on, and on this bus?";
        case ISOTP_TIMEOUT_CR: return "N_TIMEOUT_Cr: the rest of the board's message did not come; ask again";
        case ISOTP_WRONG_SN: return "N_WRONG_SN: a frame of the board's message was lost; ask again";
        case ISOTP_INVALID_FS: return "N_INVALID_FS: unknown flow status; does something else use these identifiers?";
        case ISOTP_WAIT_OVERRUN: return "N_WFT_OVRN: the board said wait too often; reset it";
        case ISOTP_BUFFER_OVERFLOW:
            return "N_BUFFER_OVFLW: the board has no room, another host is talking to it; ask again";
        default: return "unknown error";
    }
}

class CanTransfer : public Transfer {
  public:
    CanTransfer(std::unique_ptr<CanBus> bus, unsigned board_number)
        : bus_(std::move(bus)),
          number_(board_number),
          to_board_(uint16_t(OLS_CANBUS_TO_BOARD + 16 * board_number)),
          to_host_(uint16_t(OLS_CANBUS_TO_HOST + 16 * board_number)) {
        begin_anew();
    }

    std::string name() const override { return fmt::format("board {} on {}", number_, bus_->name()); }

    Status write(std::span<const uint8_t> bytes, uint32_t timeout_us, const Deadline& deadline) override {
        begin_transfer(timeout_us);
        // A reply that nobody read belongs to a request that was given up.
        isotp_release(&isotp_);
        taken_ = 0;
        const uint64_t errors = lost_sending();
        if (!isotp_send(&isotp_, bytes.data(), uint16_t(bytes.size()), bus_->now_us()))
            return fail(fmt::format("a message of {} bytes does not fit ISO-TP", bytes.size()));
        while (isotp_is_sending(&isotp_)) {
            const Status stepped = step(deadline, "take the message");
            if (stepped.ok()) continue;
            begin_anew();  // `bytes` are not there any longer
            return stepped;
        }
        if (lost_sending() != errors) return failure();
        return Done{};
    }

    Result<std::vector<uint8_t>> read(size_t capacity, uint32_t timeout_us, const Deadline& deadline) override {
        begin_transfer(timeout_us);
        const uint64_t errors = lost_receiving();
        while (isotp_message_bytes(&isotp_) == 0) {
            if (const Status stepped = step(deadline, "answer"); !stepped.ok()) return stepped.error();
            if (lost_receiving() != errors) return failure();
        }
        const size_t count = std::min(capacity, size_t(isotp_message_bytes(&isotp_) - taken_));
        std::vector<uint8_t> bytes(message_ + taken_, message_ + taken_ + count);
        taken_ += count;
        if (taken_ == isotp_message_bytes(&isotp_)) {
            isotp_release(&isotp_);
            taken_ = 0;
        }
        return bytes;
    }

  private:
    uint64_t lost_sending() const {
        return isotp_.errors[ISOTP_TIMEOUT_A] + isotp_.errors[ISOTP_TIMEOUT_BS] + isotp_.errors[ISOTP_INVALID_FS] +
               isotp_.errors[ISOTP_WAIT_OVERRUN] + isotp_.errors[ISOTP_BUFFER_OVERFLOW];
    }

    uint64_t lost_receiving() const { return isotp_.errors[ISOTP_TIMEOUT_CR] + isotp_.errors[ISOTP_WRONG_SN]; }

    void begin_anew() { isotp_init(&isotp_, message_, sizeof message_, 0); }  // any block: the kernel's queue is long

    void begin_transfer(uint32_t timeout_us) {
        until_us_ = bus_->now_us() + timeout_us;
        frames_left_ = frames_max;
    }

    // Sends what is due, or waits for a frame. The error says that the board did not do `what` in time.
    Status step(const Deadline& deadline, const char* what) {
        if (bus_->now_us() >= until_us_ || deadline.left_ms() == 0)
            return fail(fmt::format("{} did not {} in time: reset it and start over", name(), what));
        if (frames_left_-- == 0)
            return fail(fmt::format("{}: more frames than a bus has room for: is it the stage's bus?", name()));
        can_frame frame{};
        frame.can_id = to_board_;
        frame.can_dlc = isotp_next_frame(&isotp_, frame.data, bus_->now_us());
        if (frame.can_dlc > 0) return bus_->send(frame, deadline);
        const auto got = bus_->receive(std::min(until_us_, isotp_due_us(&isotp_)), deadline);
        if (!got.ok()) return got.error();
        if (*got && (*got)->can_id == to_host_)
            isotp_take_frame(&isotp_, (*got)->data, (*got)->can_dlc, bus_->now_us());
        isotp_poll(&isotp_, bus_->now_us());
        return Done{};
    }

    Error failure() const { return fail(name() + ": " + error_text(isotp_.last_error)); }

    // A second of a bus at 1 Mbit/s that is full of the shortest frames, 47 bits (ISO 11898-1), holds 21 276.
    static constexpr int frames_max = 100'000;

    std::unique_ptr<CanBus> bus_;
    unsigned number_;
    uint16_t to_board_, to_host_;
    isotp isotp_;
    uint8_t message_[OLS_FRAME_BYTES_MAX];
    size_t taken_ = 0;       // of the message received
    uint64_t until_us_ = 0;  // of the transfer under way
    int frames_left_ = 0;
};

}  // namespace

std::unique_ptr<Transfer> can_transfer(std::unique_ptr<CanBus> bus, unsigned board_number) {
    return std::make_unique<CanTransfer>(std::move(bus), board_number);
}

Result<std::unique_ptr<Transfer>> open_can(const std::string& link, const Deadline& deadline) {
    const size_t colon = link.find(':'), mark = link.rfind('#');
    std::string place = link.substr(colon + 1, mark == std::string::npos ? mark : mark - colon - 1);
    unsigned board_number = 0;
    if (mark != std::string::npos) {
        const std::string text = link.substr(mark + 1);
        if (text.empty() || text.size() > 2 || text.find_first_not_of("0123456789") != std::string::npos ||
            std::stoi(text) > 15)
            return fail("'" + link + "': boards on a CAN bus have the numbers 0 to 15, as in can:can0#2");
        board_number = unsigned(std::stoi(text));
    }
    const auto id = uint16_t(OLS_CANBUS_TO_HOST + 16 * board_number);
    auto bus = link.starts_with("can:") ? open_socketcan(place, {id}) : open_can_socket(place, deadline);
    if (!bus.ok()) return bus.error();
    return can_transfer(std::move(*bus), board_number);
}

}  // namespace ols

// SPDX-License-Identifier: MIT
// The emulated CAN bus, frames over an AF_UNIX stream socket (docs/architecture.md, "CAN frames over a socket").
#include <fmt/format.h>

#include <algorithm>
#include <cstring>

#include "device/can_bus.hpp"
#include "device/unix_socket.hpp"

namespace ols {

namespace {

constexpr uint32_t now_id = 0xffffffff;  // a record that holds the board's tick instead of a frame
constexpr uint64_t ticks_per_us = 125;

class CanSocket : public CanBus {
  public:
    explicit CanSocket(UnixSocket socket) : socket_(std::move(socket)) {}

    std::string name() const override { return socket_.name(); }

    // Waits until the board has told its time.
    Status begin(const Deadline& deadline) {
        while (!knows_time_) {
            const auto record = next_record(deadline);
            if (!record.ok()) return record.error();
        }
        return Done{};
    }

    Status send(const can_frame& frame, const Deadline& deadline) override {
        return socket_.send(&frame, sizeof frame, deadline);
    }

    Result<std::optional<can_frame>> receive(uint64_t until_us, const Deadline& deadline) override {
        for (;;) {
            if (deadline.left_ms() > 0 && !socket_.has_bytes_within(deadline.next_wait_ms()))
                return std::optional<can_frame>();
            auto record = next_record(deadline);
            if (!record.ok() || *record || now_us_ >= until_us) return record;
        }
    }

    uint64_t now_us() const override { return now_us_; }

  private:
    // A frame; nothing when the record told the time instead.
    Result<std::optional<can_frame>> next_record(const Deadline& deadline) {
        can_frame record;
        if (const Status got = socket_.receive(&record, sizeof record, deadline); !got.ok()) return got.error();
        if (record.can_id == now_id) {
            take_time(record);
            return std::optional<can_frame>();
        }
        if (record.can_dlc > sizeof record.data)
            return fail(fmt::format("{} sends a frame of {} bytes, where 8 are the most: is it the stage's CAN socket?",
                                    name(), record.can_dlc));
        return std::optional(record);
    }

    void take_time(const can_frame& record) {
        uint64_t ticks;
        std::memcpy(&ticks, record.data, sizeof ticks);
        now_us_ = std::max(now_us_, ticks / ticks_per_us);
        knows_time_ = true;
    }

    UnixSocket socket_;
    uint64_t now_us_ = 0;
    bool knows_time_ = false;
};

}  // namespace

Result<std::unique_ptr<CanBus>> open_can_socket(const std::string& path, const Deadline& deadline) {
    auto socket = UnixSocket::connect(path, "the CAN bus", deadline);
    if (!socket.ok()) return socket.error();
    auto bus = std::make_unique<CanSocket>(std::move(*socket));
    if (const Status begun = bus->begin(deadline); !begun.ok()) return begun.error();
    return std::unique_ptr<CanBus>(std::move(bus));
}

}  // namespace ols

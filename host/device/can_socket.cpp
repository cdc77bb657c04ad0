// SPDX-License-Identifier: MIT
// The emulated CAN bus, frames over an AF_UNIX stream socket (docs/architecture.md, "CAN frames over a socket").
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

    // Waits until the board has told its time.
    Status begin() {
        for (can_frame record;;) {
            if (const Status got = socket_.receive(&record, sizeof record); !got.ok()) return got;
            if (take_time(record)) return Done{};
        }
    }

    Status send(const can_frame& frame) override { return socket_.send(&frame, sizeof frame); }

    Result<std::optional<can_frame>> receive(uint64_t until_us) override {
        do {
            can_frame record;
            if (const Status got = socket_.receive(&record, sizeof record); !got.ok()) return got.error();
            if (!take_time(record)) return std::optional(record);
        } while (now_us_ < until_us);
        return std::optional<can_frame>();
    }

    uint64_t now_us() const override { return now_us_; }

  private:
    bool take_time(const can_frame& record) {
        if (record.can_id != now_id) return false;
        uint64_t ticks;
        std::memcpy(&ticks, record.data, sizeof ticks);
        now_us_ = ticks / ticks_per_us;
        return true;
    }

    UnixSocket socket_;
    uint64_t now_us_ = 0;
};

}  // namespace

Result<std::unique_ptr<CanBus>> open_can_socket(const std::string& path, int patience_ms) {
    auto socket = UnixSocket::connect(path, "the CAN bus", patience_ms);
    if (!socket.ok()) return socket.error();
    auto bus = std::make_unique<CanSocket>(std::move(*socket));
    if (const Status begun = bus->begin(); !begun.ok()) return begun.error();
    return std::unique_ptr<CanBus>(std::move(bus));
}

}  // namespace ols

// SPDX-License-Identifier: MIT
// The emulated CAN bus, frames over an AF_UNIX stream socket (docs/architecture.md, "CAN frames over a socket").
#include <unistd.h>

#include <cerrno>
#include <cstring>

#include "device/can_bus.hpp"
#include "device/unix_socket.hpp"

namespace ols {

namespace {

constexpr uint32_t now_id = 0xffffffff;  // a record that holds the board's tick instead of a frame
constexpr uint64_t ticks_per_us = 125;

class CanSocket : public CanBus {
  public:
    CanSocket(int fd, std::string path) : fd_(fd), path_(std::move(path)) {}
    ~CanSocket() override { ::close(fd_); }

    // Waits until the board has told its time.
    Status begin() {
        for (can_frame record;;) {
            if (const Status got = receive_record(&record); !got.ok()) return got;
            if (take_time(record)) return Done{};
        }
    }

    Status send(const can_frame& frame) override {
        return send_whole(fd_, &frame, sizeof frame) ? Status(Done{}) : Status(lost());
    }

    Result<std::optional<can_frame>> receive(uint64_t until_us) override {
        do {
            can_frame record;
            if (const Status got = receive_record(&record); !got.ok()) return got.error();
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

    Status receive_record(can_frame* record) {
        return receive_whole(fd_, record, sizeof *record) ? Status(Done{}) : Status(lost());
    }

    Error lost() const { return fail("the CAN bus at '" + path_ + "' is gone: start the stage again"); }

    int fd_;
    std::string path_;
    uint64_t now_us_ = 0;
};

}  // namespace

Result<std::unique_ptr<CanBus>> open_can_socket(const std::string& path) {
    const auto fd = connect_unix(path, "the CAN bus");
    if (!fd.ok()) return fd.error();
    auto bus = std::make_unique<CanSocket>(*fd, path);
    if (const Status begun = bus->begin(); !begun.ok()) return begun.error();
    return std::unique_ptr<CanBus>(std::move(bus));
}

}  // namespace ols

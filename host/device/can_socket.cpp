// SPDX-License-Identifier: MIT
// The emulated CAN bus, frames over an AF_UNIX stream socket (docs/architecture.md, "CAN frames over a socket").
#include <fmt/format.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>

#include "device/can_bus.hpp"

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
        const ssize_t sent = ::send(fd_, &frame, sizeof frame, MSG_NOSIGNAL);  // 16 bytes: never in part on AF_UNIX
        return sent == ssize_t(sizeof frame) ? Status(Done{}) : Status(lost());
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
        auto* at = reinterpret_cast<uint8_t*>(record);
        for (size_t left = sizeof *record; left > 0;) {
            const ssize_t got = ::recv(fd_, at, left, 0);
            if (got < 0 && errno == EINTR) continue;
            if (got <= 0) return lost();
            at += got;
            left -= size_t(got);
        }
        return Done{};
    }

    Error lost() const { return fail("the CAN bus at '" + path_ + "' is gone: start the stage again"); }

    int fd_;
    std::string path_;
    uint64_t now_us_ = 0;
};

}  // namespace

Result<std::unique_ptr<CanBus>> open_can_socket(const std::string& path) {
    sockaddr_un address{};
    address.sun_family = AF_UNIX;
    if (path.empty() || path.size() >= sizeof address.sun_path)
        return fail(fmt::format("socket path '{}' must have 1 to {} characters", path, sizeof address.sun_path - 1));
    std::memcpy(address.sun_path, path.c_str(), path.size());
    const int fd = ::socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0);
    if (fd < 0) return fail(fmt::format("cannot make a socket: {}", std::strerror(errno)));
    if (::connect(fd, reinterpret_cast<const sockaddr*>(&address), sizeof address) != 0) {
        const int error = errno;
        ::close(fd);
        return fail(
            fmt::format("cannot reach the CAN bus at '{}': {}; start the stage first", path, std::strerror(error)));
    }
    auto bus = std::make_unique<CanSocket>(fd, path);
    if (const Status begun = bus->begin(); !begun.ok()) return begun.error();
    return std::unique_ptr<CanBus>(std::move(bus));
}

}  // namespace ols

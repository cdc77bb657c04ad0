// SPDX-License-Identifier: MIT
// SocketCAN: raw frames of an interface of this machine (Linux, Documentation/networking/can.rst), for kernels without CAN_ISOTP.
#include <fmt/format.h>
#include <linux/can/raw.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <cstring>

#include "device/can_bus.hpp"
#include "steady_clock.hpp"

namespace ols {

namespace {

class SocketCan : public CanBus {
  public:
    SocketCan(int fd, CanPlace place) : fd_(fd), place_(std::move(place)) {}
    ~SocketCan() override { ::close(fd_); }

    std::string name() const override { return "the CAN interface '" + place_.interface + "'"; }

    Status send(const can_frame& frame, const Deadline& deadline) override {
        for (const uint64_t begin_us = now_us();;) {
            if (::write(fd_, &frame, sizeof frame) == ssize_t(sizeof frame)) return Done{};
            if (errno == EINTR) continue;
            // A full queue is not an error that poll() could wait for: the kernel drops instead (can.rst, 4.1.7).
            if (errno != ENOBUFS) return lost();
            if (now_us() - begin_us > queue_timeout_us || deadline.left_ms() == 0)
                return fail("the CAN bus '" + place_.interface +
                            "' takes no frames: is the board on, the bus terminated, the bit rate the board's?");
            ::usleep(queue_retry_us);
        }
    }

    Result<std::optional<can_frame>> receive(uint64_t until_us, const Deadline& deadline) override {
        const uint64_t now = now_us();
        const uint64_t left_ms = until_us <= now ? 0 : (until_us - now + 999) / 1000;
        pollfd ready{fd_, POLLIN, 0};
        if (::poll(&ready, 1, int(std::min<uint64_t>(left_ms, uint64_t(deadline.next_wait_ms())))) < 0 &&
            errno != EINTR)
            return lost();
        can_frame frame{};
        const ssize_t got = ::recv(fd_, &frame, sizeof frame, MSG_DONTWAIT);
        if (got == ssize_t(sizeof frame) && frame.can_dlc <= sizeof frame.data) return std::optional(frame);
        if (got < 0 && errno != EAGAIN && errno != EINTR) return lost();
        return std::optional<can_frame>();
    }

    uint64_t now_us() const override { return steady_ns() / 1000; }

  private:
    static constexpr uint64_t queue_timeout_us = 1'000'000;
    static constexpr useconds_t queue_retry_us = 200;  // a frame or two

    Error lost() const { return can_down(place_, errno); }

    int fd_;
    CanPlace place_;
};

}  // namespace

Result<std::unique_ptr<CanBus>> open_socketcan(const CanPlace& place, CanIds ids) {
    const auto opened = open_can_address(place, SOCK_RAW, CAN_RAW);
    if (!opened.ok()) return opened.error();
    auto bus = std::make_unique<SocketCan>(opened->fd, place);
    const can_filter only{ids.id, ids.mask | CAN_EFF_FLAG | CAN_RTR_FLAG};
    if (::setsockopt(opened->fd, SOL_CAN_RAW, CAN_RAW_FILTER, &only, sizeof only) != 0 ||
        ::bind(opened->fd, reinterpret_cast<const sockaddr*>(&opened->address), sizeof opened->address) != 0)
        return can_down(place, errno);
    return std::unique_ptr<CanBus>(std::move(bus));
}

}  // namespace ols

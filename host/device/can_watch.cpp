// SPDX-License-Identifier: MIT
// Beside a link on SocketCAN: the claim of a board, and what its identifiers and the controller tell.
#include "device/can_watch.hpp"

#include <fmt/format.h>
#include <linux/can/error.h>
#include <linux/can/raw.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>

namespace ols {

namespace {

constexpr uint8_t flow_control = 3, wait_status = 1;  // ISO 15765-2, 9.6.5

// The abstract name of the claim: it belongs to the network namespace, as the interface does, and leaves nothing behind (unix(7)).
socklen_t claim_address(const CanPlace& place, sockaddr_un& address) {
    const std::string name = fmt::format("open-light-stage/{}/{:x}", place.interface, place.to_board());
    address.sun_family = AF_UNIX;
    std::memcpy(address.sun_path + 1, name.data(), name.size());
    return socklen_t(offsetof(sockaddr_un, sun_path) + 1 + name.size());
}

// " (process 123)" of the program that holds the claim; nothing when it has just gone.
std::string holder_of(const sockaddr_un& address, socklen_t bytes) {
    const int fd = ::socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0);
    ucred holder{};
    socklen_t size = sizeof holder;
    const bool known = ::connect(fd, reinterpret_cast<const sockaddr*>(&address), bytes) == 0 &&
                       ::getsockopt(fd, SOL_SOCKET, SO_PEERCRED, &holder, &size) == 0;
    ::close(fd);
    return known ? fmt::format(" (process {})", holder.pid) : "";
}

}  // namespace

Result<std::unique_ptr<CanClaim>> CanClaim::take(const CanPlace& place) {
    sockaddr_un address{};
    const socklen_t bytes = claim_address(place, address);
    const int fd = ::socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0);
    if (::bind(fd, reinterpret_cast<const sockaddr*>(&address), bytes) == 0 && ::listen(fd, 1) == 0)
        return std::unique_ptr<CanClaim>(new CanClaim(fd));
    const int error = errno;
    ::close(fd);
    if (error != EADDRINUSE) return fail(fmt::format("cannot claim {}: {}", place.name(), std::strerror(error)));
    return fail(
        fmt::format("{} is used by another program{}: end that one first", place.name(), holder_of(address, bytes)));
}

CanClaim::~CanClaim() {
    ::close(fd_);
}

Result<std::unique_ptr<CanWatch>> CanWatch::open(const CanPlace& place) {
    const auto opened = open_can_address(place, SOCK_RAW, CAN_RAW);
    if (!opened.ok()) return opened.error();
    std::unique_ptr<CanWatch> watch(new CanWatch(opened->fd, place));
    constexpr canid_t mask = CAN_SFF_MASK | CAN_EFF_FLAG | CAN_RTR_FLAG;
    const can_filter ours[]{{place.to_board(), mask}, {place.to_host(), mask}};
    const can_err_mask_t errors = CAN_ERR_CRTL | CAN_ERR_ACK | CAN_ERR_BUSOFF;
    if (::setsockopt(opened->fd, SOL_CAN_RAW, CAN_RAW_FILTER, ours, sizeof ours) != 0 ||
        ::setsockopt(opened->fd, SOL_CAN_RAW, CAN_RAW_ERR_FILTER, &errors, sizeof errors) != 0 ||
        ::bind(opened->fd, reinterpret_cast<const sockaddr*>(&opened->address), sizeof opened->address) != 0)
        return can_down(place, errno);
    return watch;
}

CanWatch::~CanWatch() {
    ::close(fd_);
}

void CanWatch::look() {
    can_frame frame{};
    iovec into{&frame, sizeof frame};
    msghdr message{};
    message.msg_iov = &into;
    message.msg_iovlen = 1;
    ssize_t got;
    // A frame that a program of this machine sent is marked so (can.rst, "RAW socket returned message flags").
    while ((got = ::recvmsg(fd_, &message, MSG_DONTWAIT)) == ssize_t(sizeof frame))
        take(frame, message.msg_flags & MSG_DONTROUTE);
    if (got < 0 && errno != EAGAIN && errno != EINTR) interface_error_ = errno;
}

void CanWatch::forget() {
    look();
    from_board_ = of_others_ = 0;
    waits_in_a_row_ = 0;
    interface_error_ = 0;
    has_sent_ = bus_off_ = passive_ = unacknowledged_ = false;
}

void CanWatch::take(const can_frame& frame, bool is_local) {
    if (frame.can_id & CAN_ERR_FLAG) return take_error(frame);
    if (frame.can_id == place_.to_board()) {
        has_sent_ |= is_local;
        of_others_ += !is_local;
        return;
    }
    ++from_board_;
    const bool waits = frame.can_dlc > 0 && frame.data[0] == (flow_control << 4 | wait_status);
    waits_in_a_row_ = waits ? waits_in_a_row_ + 1 : 0;
}

void CanWatch::take_error(const can_frame& frame) {
    bus_off_ |= (frame.can_id & CAN_ERR_BUSOFF) != 0;
    unacknowledged_ |= (frame.can_id & CAN_ERR_ACK) != 0;
    const uint8_t state = frame.can_id & CAN_ERR_CRTL ? frame.data[1] : 0;
    passive_ |= (state & (CAN_ERR_CRTL_RX_PASSIVE | CAN_ERR_CRTL_TX_PASSIVE)) != 0;
}

std::string CanWatch::trouble() const {
    if (interface_error_) return "; " + can_down(place_, interface_error_).message;
    if (bus_off_)
        return fmt::format(
            "; the controller went bus-off: check wiring, termination and bit rate, then sudo ip link set {} type can "
            "restart",
            place_.interface);
    if (unacknowledged_)
        return "; no other node acknowledges: is the board on, on this bus, and the bit rate the board's?";
    if (passive_) return "; the controller is error-passive: check termination and whether the bit rate is the board's";
    if (of_others_)
        return fmt::format("; another node sends with the identifier {:#x}: one host for a board", place_.to_board());
    return "";
}

}  // namespace ols

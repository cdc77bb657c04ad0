// SPDX-License-Identifier: MIT
// AF_UNIX stream sockets that never block: every wait is a poll(), in pieces between which the deadline is looked at.
#include "device/unix_socket.hpp"

#include <fmt/format.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

#include <cerrno>
#include <cstdint>
#include <cstring>
#include <utility>

#include "device/unix_address.hpp"

namespace ols {

Result<UnixSocket> UnixSocket::connect(const std::string& path, const std::string& what, const Deadline& deadline) {
    const auto address = unix_address(path);
    if (!address) return address.error();
    const int fd = ::socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0);
    if (fd < 0) return fail(fmt::format("cannot make a socket: {}", std::strerror(errno)));
    UnixSocket made(fd, fmt::format("{} at '{}'", what, path));
    while (::connect(fd, reinterpret_cast<const sockaddr*>(&*address), sizeof *address) != 0) {
        if (errno == EINTR) continue;
        if (errno != EAGAIN)
            return fail(fmt::format("cannot reach {}: {}; start the stage first", made.name_, std::strerror(errno)));
        // Its queue of clients is full, which poll() does not tell of (unix(7)).
        if (deadline.left_ms() == 0) return made.too_slow(deadline);
        ::poll(nullptr, 0, deadline.next_wait_ms());
    }
    return made;
}

UnixSocket::UnixSocket(UnixSocket&& other) noexcept
    : fd_(std::exchange(other.fd_, -1)), name_(std::move(other.name_)) {}

UnixSocket::~UnixSocket() {
    if (fd_ >= 0) ::close(fd_);
}

Status UnixSocket::wait(short events, const Deadline& deadline) const {
    for (pollfd ready{fd_, events, 0};;) {
        if (deadline.left_ms() == 0) return too_slow(deadline);
        const int count = ::poll(&ready, 1, deadline.next_wait_ms());
        if (count > 0) return Done{};
        if (count < 0 && errno != EINTR) return gone();
    }
}

Status UnixSocket::receive(void* bytes, size_t count, const Deadline& deadline) {
    auto* at = static_cast<uint8_t*>(bytes);
    while (count > 0) {
        if (const Status ready = wait(POLLIN, deadline); !ready.ok()) return ready;
        const ssize_t got = ::recv(fd_, at, count, 0);
        if (got < 0 && (errno == EINTR || errno == EAGAIN)) continue;
        if (got <= 0) return gone();
        at += got;
        count -= size_t(got);
    }
    return Done{};
}

Status UnixSocket::send(const void* bytes, size_t count, const Deadline& deadline) {
    const auto* at = static_cast<const uint8_t*>(bytes);
    while (count > 0) {
        if (const Status ready = wait(POLLOUT, deadline); !ready.ok()) return ready;
        const ssize_t sent = ::send(fd_, at, count, MSG_NOSIGNAL);
        if (sent < 0 && (errno == EINTR || errno == EAGAIN)) continue;
        if (sent <= 0) return gone();
        at += sent;
        count -= size_t(sent);
    }
    return Done{};
}

bool UnixSocket::has_bytes() const {
    uint8_t byte;
    return ::recv(fd_, &byte, 1, MSG_PEEK | MSG_DONTWAIT) > 0;
}

bool UnixSocket::has_bytes_within(int timeout_ms) const {
    pollfd ready{fd_, POLLIN, 0};
    return ::poll(&ready, 1, timeout_ms) != 0;
}

Error UnixSocket::too_slow(const Deadline& deadline) const {
    return fail(fmt::format(
        "{} has not finished an exchange {}: is it stopped, or does something hold it back? Otherwise start "
        "the stage again",
        name_, deadline.text()));
}

Error UnixSocket::gone() const {
    return fail(name_ + " is gone: start the stage again");
}

}  // namespace ols

// SPDX-License-Identifier: MIT
// AF_UNIX stream sockets. The kernel bounds each call (socket(7), SO_RCVTIMEO and SO_SNDTIMEO; the latter connect, too).
#include "device/unix_socket.hpp"

#include <fmt/format.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include <cerrno>
#include <cstdint>
#include <cstring>
#include <utility>

namespace ols {

Result<UnixSocket> UnixSocket::connect(const std::string& path, const std::string& what, int patience_ms) {
    sockaddr_un address{};
    address.sun_family = AF_UNIX;
    if (path.empty() || path.size() >= sizeof address.sun_path)
        return fail(fmt::format("socket path '{}' must have 1 to {} characters", path, sizeof address.sun_path - 1));
    std::memcpy(address.sun_path, path.c_str(), path.size());
    const int fd = ::socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0);
    if (fd < 0) return fail(fmt::format("cannot make a socket: {}", std::strerror(errno)));
    UnixSocket made(fd, fmt::format("{} at '{}'", what, path), patience_ms);
    const timeval bound{patience_ms / 1000, patience_ms % 1000 * 1000};
    setsockopt(fd, SOL_SOCKET, SO_RCVTIMEO, &bound, sizeof bound);
    setsockopt(fd, SOL_SOCKET, SO_SNDTIMEO, &bound, sizeof bound);
    int result;
    do result = ::connect(fd, reinterpret_cast<const sockaddr*>(&address), sizeof address);
    while (result != 0 && errno == EINTR);
    if (result == 0) return made;
    if (errno == EAGAIN) return made.failure(-1);
    return fail(fmt::format("cannot reach {}: {}; start the stage first", made.name_, std::strerror(errno)));
}

UnixSocket::UnixSocket(UnixSocket&& other) noexcept
    : fd_(std::exchange(other.fd_, -1)), name_(std::move(other.name_)), patience_ms_(other.patience_ms_) {}

UnixSocket::~UnixSocket() {
    if (fd_ >= 0) ::close(fd_);
}

Status UnixSocket::receive(void* bytes, size_t count) {
    auto* at = static_cast<uint8_t*>(bytes);
    while (count > 0) {
        const ssize_t got = ::recv(fd_, at, count, 0);
        if (got < 0 && errno == EINTR) continue;
        if (got <= 0) return failure(got);
        at += got;
        count -= size_t(got);
    }
    return Done{};
}

Status UnixSocket::send(const void* bytes, size_t count) {
    const auto* at = static_cast<const uint8_t*>(bytes);
    while (count > 0) {
        const ssize_t sent = ::send(fd_, at, count, MSG_NOSIGNAL);
        if (sent < 0 && errno == EINTR) continue;
        if (sent <= 0) return failure(sent);
        at += sent;
        count -= size_t(sent);
    }
    return Done{};
}

// Of the call that returned `result` just now.
Error UnixSocket::failure(ssize_t result) const {
    if (result < 0 && (errno == EAGAIN || errno == EWOULDBLOCK))
        return fail(
            fmt::format("{} has not moved for {:.3g} s: is it stopped, or does something hold it back? Otherwise start "
                        "the stage again",
                        name_, patience_ms_ / 1e3));
    return fail(name_ + " is gone: start the stage again");
}

}  // namespace ols

// SPDX-License-Identifier: MIT
// AF_UNIX stream sockets.
#include "device/unix_socket.hpp"

#include <fmt/format.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include <cerrno>
#include <cstdint>
#include <cstring>

namespace ols {

Result<int> connect_unix(const std::string& path, const std::string& what) {
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
            fmt::format("cannot reach {} at '{}': {}; start the stage first", what, path, std::strerror(error)));
    }
    return fd;
}

bool receive_whole(int fd, void* bytes, size_t count) {
    auto* at = static_cast<uint8_t*>(bytes);
    while (count > 0) {
        const ssize_t got = ::recv(fd, at, count, 0);
        if (got < 0 && errno == EINTR) continue;
        if (got <= 0) return false;
        at += got;
        count -= size_t(got);
    }
    return true;
}

bool send_whole(int fd, const void* bytes, size_t count) {
    const auto* at = static_cast<const uint8_t*>(bytes);
    while (count > 0) {
        const ssize_t sent = ::send(fd, at, count, MSG_NOSIGNAL);
        if (sent < 0 && errno == EINTR) continue;
        if (sent <= 0) return false;
        at += sent;
        count -= size_t(sent);
    }
    return true;
}

}  // namespace ols

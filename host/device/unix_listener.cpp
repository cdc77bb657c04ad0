// SPDX-License-Identifier: MIT
// AF_UNIX: bind, permissions, listen.
#include "device/unix_listener.hpp"

#include <fmt/format.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>

#include "device/unix_address.hpp"

namespace ols {

namespace {

bool is_listened_at(const sockaddr_un& address) {
    const int fd = ::socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0);
    const bool connected = ::connect(fd, reinterpret_cast<const sockaddr*>(&address), sizeof address) == 0;
    ::close(fd);
    return connected;
}

}  // namespace

Result<int> listen_at(const std::string& path, bool group_may) {
    const auto address = unix_address(path);
    if (!address) return address.error();
    struct stat there {};
    if (::lstat(path.c_str(), &there) == 0) {
        if (!S_ISSOCK(there.st_mode)) return fail("'" + path + "' exists and is not a socket: choose another path");
        if (is_listened_at(*address)) return fail("another program listens at '" + path + "': choose another path");
        ::unlink(path.c_str());
    }
    const int fd = ::socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0);
    // Nobody can connect before listen(), so nobody does before the permissions stand.
    if (fd < 0 || ::bind(fd, reinterpret_cast<const sockaddr*>(&*address), sizeof *address) != 0 ||
        ::chmod(path.c_str(), group_may ? 0660 : 0600) != 0 || ::listen(fd, 16) != 0) {
        const int error = errno;
        if (fd >= 0) ::close(fd);
        return fail(fmt::format("cannot listen at '{}' ({}): is there such a folder?", path, std::strerror(error)));
    }
    return fd;
}

}  // namespace ols

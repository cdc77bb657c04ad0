// SPDX-License-Identifier: MIT
// AF_UNIX: bind, permissions, listen.
#include "device/unix_listener.hpp"

#include <fmt/format.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/un.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>

namespace ols {

namespace {

sockaddr_un address_of(const std::string& path) {
    sockaddr_un address{};
    address.sun_family = AF_UNIX;
    std::memcpy(address.sun_path, path.c_str(), path.size());
    return address;
}

bool is_listened_at(const std::string& path) {
    const int fd = ::socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0);
    const sockaddr_un address = address_of(path);
    const bool connected = ::connect(fd, reinterpret_cast<const sockaddr*>(&address), sizeof address) == 0;
    ::close(fd);
    return connected;
}

}  // namespace

Result<int> listen_at(const std::string& path, bool group_may) {
    if (path.empty() || path.size() >= sizeof sockaddr_un::sun_path)
        return fail("'" + path + "' is no path of a socket: at most 107 bytes; choose a shorter one");
    struct stat there {};
    if (::lstat(path.c_str(), &there) == 0) {
        if (!S_ISSOCK(there.st_mode)) return fail("'" + path + "' exists and is not a socket: choose another path");
        if (is_listened_at(path)) return fail("another program listens at '" + path + "': choose another path");
        ::unlink(path.c_str());
    }
    const int fd = ::socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0);
    const sockaddr_un address = address_of(path);
    // Nobody can connect before listen(), so nobody does before the permissions stand.
    if (fd < 0 || ::bind(fd, reinterpret_cast<const sockaddr*>(&address), sizeof address) != 0 ||
        ::chmod(path.c_str(), group_may ? 0660 : 0600) != 0 || ::listen(fd, 16) != 0) {
        const int error = errno;
        if (fd >= 0) ::close(fd);
        return fail(fmt::format("cannot listen at '{}' ({}): is there such a folder?", path, std::strerror(error)));
    }
    return fd;
}

}  // namespace ols

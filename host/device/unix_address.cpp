// SPDX-License-Identifier: MIT
// unix(7): a path of a fixed size, with a zero at its end.
#include "device/unix_address.hpp"

#include <fmt/format.h>
#include <sys/socket.h>

#include <cstring>

namespace ols {

Result<sockaddr_un> unix_address(const std::string& path) {
    sockaddr_un address{};
    address.sun_family = AF_UNIX;
    if (path.empty() || path.size() >= sizeof address.sun_path)
        return fail(fmt::format("'{}' is no path of a socket, which has 1 to {} bytes: choose a shorter one", path,
                                sizeof address.sun_path - 1));
    std::memcpy(address.sun_path, path.c_str(), path.size());
    return address;
}

}  // namespace ols

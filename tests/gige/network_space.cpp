// SPDX-License-Identifier: MIT
// namespaces(7), netdevice(7).
#include "network_space.hpp"

#include <arpa/inet.h>
#include <net/if.h>
#include <sched.h>
#include <sys/ioctl.h>
#include <sys/socket.h>
#include <unistd.h>

#include <cstdio>
#include <string>

namespace ols::test {

bool enter_network_space() {
    if (unshare(CLONE_NEWUSER | CLONE_NEWNET) != 0 && unshare(CLONE_NEWNET) != 0) return false;
    const int fd = socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0);
    ifreq request{};
    snprintf(request.ifr_name, sizeof request.ifr_name, "lo");
    request.ifr_flags = IFF_UP | IFF_LOOPBACK | IFF_RUNNING;
    const bool is_up = ioctl(fd, SIOCSIFFLAGS, &request) == 0;
    close(fd);
    return is_up;
}

bool add_loopback_address(int last) {
    const int fd = socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0);
    ifreq request{};
    snprintf(request.ifr_name, sizeof request.ifr_name, "lo:%d", last);
    auto* address = reinterpret_cast<sockaddr_in*>(&request.ifr_addr);
    address->sin_family = AF_INET;
    inet_pton(AF_INET, ("127.0.0." + std::to_string(last)).c_str(), &address->sin_addr);
    const bool is_added = ioctl(fd, SIOCSIFADDR, &request) == 0;
    close(fd);
    return is_added;
}

}  // namespace ols::test

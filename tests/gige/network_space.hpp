// SPDX-License-Identifier: MIT
// A network of the process's own, with nothing but its loopback: cameras of other tests are not in it, and port 3956 is free.
#pragma once

namespace ols::test {

// Call it before there are threads. False when the system does not allow it (user namespaces are off); the shared loopback is
// there then.
bool enter_network_space();

// Another address of the loopback's interface, 127.0.0.`last`, for programs that listen where an interface has an address.
bool add_loopback_address(int last);

}  // namespace ols::test

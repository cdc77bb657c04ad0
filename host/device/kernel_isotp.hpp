// SPDX-License-Identifier: MIT
// Transfers over CAN by the kernel's ISO-TP: it answers flow control also while this program does not run.
#pragma once

#include <memory>

#include "device/can_watch.hpp"
#include "device/transfer.hpp"

namespace ols {

// False where the module can_isotp is not there.
bool kernel_has_isotp();

// `watch` outlives it.
Result<std::unique_ptr<Transfer>> open_kernel_isotp(const CanPlace& place, CanWatch& watch);

}  // namespace ols

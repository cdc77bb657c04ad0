// SPDX-License-Identifier: MIT
// The BOOTSEL drive: the boot loader as a volume that takes a UF2 file (RP2040 datasheet 2.8.4).
#pragma once

#include <span>
#include <string>

#include "result.hpp"

namespace ols {

// The first mounted volume that is an RP2040's drive, by /proc/mounts and the file that the boot ROM puts there; empty
// when there is none.
std::string find_boot_drive();

// Copies a UF2 file's bytes to the drive mounted at `path`; the board restarts by itself when all have come. Errors: not
// an RP2040's drive, or it went away in between.
Status write_boot_drive(const std::string& path, std::span<const uint8_t> uf2);

}  // namespace ols

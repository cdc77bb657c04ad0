// SPDX-License-Identifier: MIT
// Writing a firmware image through the boot loader, in an order in which the board never starts half of one: the first
// sector, without which the boot ROM starts nothing, is erased first, and its first page, boot2, is written last. The last
// sector of flash notes which board the image is for while the image's own label is gone.
#pragma once

#include <functional>
#include <optional>

#include "device/firmware_image.hpp"
#include "device/picoboot.hpp"

namespace ols {

using FlashProgress = std::function<void(size_t done_bytes, size_t total_bytes)>;

// Takes the boot loader over: what an earlier, interrupted host has left is forgotten.
Status take_over(Picoboot& loader);

// The label of the image in flash, or of the one whose writing was interrupted; nothing when flash holds neither.
Result<std::optional<ImageLabel>> read_label(Picoboot& loader);

// Writes, reads back and compares everything. An error says what the board does now. To be begun anew after any error.
Status write_image(Picoboot& loader, const FirmwareImage& image, const FlashProgress& progress);

}  // namespace ols

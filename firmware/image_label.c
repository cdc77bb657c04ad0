// SPDX-License-Identifier: MIT
// The label of this image (protocol/image_label.h); stage.ld puts it where tools look for it.
#include "image_label.h"

#include "board.h"
#include "layout_hash.h"

__attribute__((section(".image_label"), used)) static const struct ols_image_label label = {
    .magic = OLS_IMAGE_LABEL_MAGIC,
    .label_bytes = sizeof label,
    .layout_hash = OLS_LAYOUT_HASH,
    .board = BOARD_NAME,
    .firmware_version = BOARD_FIRMWARE_VERSION};

// SPDX-License-Identifier: MIT
// The label in a firmware image: which board it is for and what it speaks, at a fixed place in flash, so that a tool can
// tell before it writes the image.
#ifndef OLS_IMAGE_LABEL_H
#define OLS_IMAGE_LABEL_H

#include <stdint.h>

#include "wire.h"

#define OLS_IMAGE_LABEL_ADDRESS 0x10000108  // behind boot2 and the two words that it starts the image with
#define OLS_IMAGE_LABEL_MAGIC 0x62614c4f    // "OLab"

struct ols_image_label {
    uint32_t magic;
    uint32_t label_bytes;  // of this struct: a later one may be longer
    uint64_t layout_hash;  // of the messages, as in a hello
    char board[16];        // as in a hello
    char firmware_version[24];
} OLS_PACKED;

OLS_WIRE_ASSERT(sizeof(struct ols_image_label) == 56, "image label");

#endif

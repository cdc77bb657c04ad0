// SPDX-License-Identifier: MIT
// Frames: how messages travel on a byte stream (USB bulk, socket). Encoder and incremental parser without allocation.
#ifndef OLS_FRAME_H
#define OLS_FRAME_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "wire.h"

#ifdef __cplusplus
extern "C" {
#endif

enum { OLS_FRAME_BYTES_MAX = sizeof(struct ols_frame_header) + OLS_PAYLOAD_BYTES_MAX + sizeof(uint32_t) };

// CRC-32 as Ethernet and zlib have it (reflected 0xedb88320). `crc` is 0 or the result for the bytes before these.
uint32_t ols_crc32(uint32_t crc, const void* bytes, size_t byte_count);

// Writes one frame to `frame` and returns its size, or 0 when the payload is above OLS_PAYLOAD_BYTES_MAX or the frame
// above `frame_bytes_max`. `payload` may be null when `payload_bytes` is 0.
size_t ols_frame_encode(uint16_t type, uint16_t request_id, const void* payload, size_t payload_bytes, uint8_t* frame,
                        size_t frame_bytes_max);

// A received message; `payload` points into the parser and holds until the parser is called again.
struct ols_frame {
    uint16_t type;
    uint16_t request_id;
    uint16_t payload_bytes;
    const uint8_t* payload;
};

// Zero-initialise, then: write bytes, read frames until there is none, write more.
struct ols_frame_parser {
    uint8_t bytes[OLS_FRAME_BYTES_MAX];
    size_t begin;            // of the bytes not yet handed out
    size_t end;              // of the bytes received
    uint32_t dropped_bytes;  // that belonged to no valid frame
};

// Takes up to `byte_count` bytes and returns how many; at least one when the last read found no frame.
size_t ols_frame_parser_write(struct ols_frame_parser* parser, const void* bytes, size_t byte_count);

// Finds the next whole valid frame. Bytes that cannot belong to one are dropped and counted; after damage, reading goes
// on at the next place where a valid frame starts.
bool ols_frame_parser_read(struct ols_frame_parser* parser, struct ols_frame* frame);

#ifdef __cplusplus
}
#endif

#endif

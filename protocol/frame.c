// SPDX-License-Identifier: MIT
// Frames: encoder and incremental parser. The layout is ols_frame_header's in wire.h.
#include "frame.h"

#include <string.h>

enum {
    HEADER_BYTES = sizeof(struct ols_frame_header),
    CHECKED_BYTES = offsetof(struct ols_frame_header, header_check)
};

// Eight bits on. Four a step: a table of 16 words is quick enough and does not fill the board's SRAM.
static inline uint32_t crc32_step(uint32_t crc) {
    static const uint32_t table[16] = {0x00000000, 0x1db71064, 0x3b6e20c8, 0x26d930ac, 0x76dc4190, 0x6b6b51f4,
                                       0x4db26158, 0x5005713c, 0xedb88320, 0xf00f9344, 0xd6d6a3e8, 0xcb61b38c,
                                       0x9b64c2b0, 0x86d3d2d4, 0xa00ae278, 0xbdbdf21c};
    crc = crc >> 4 ^ table[crc & 15];
    return crc >> 4 ^ table[crc & 15];
}

typedef uint32_t __attribute__((may_alias)) aliased_word;

// By words where they are aligned: least significant byte first, as host and board have it.
uint32_t ols_crc32(uint32_t crc, const void* bytes, size_t byte_count) {
    if (byte_count == 0) return crc;  // of no bytes there may be no pointer
    const uint8_t* next = bytes;
    const uint8_t* const end = next + byte_count;
    crc = ~crc;
    while (next < end && (uintptr_t)next % sizeof(aliased_word) != 0) crc = crc32_step(crc ^ *next++);
    for (; (size_t)(end - next) >= sizeof(aliased_word); next += sizeof(aliased_word))
        crc = crc32_step(crc32_step(crc32_step(crc32_step(crc ^ *(const aliased_word*)(const void*)next))));
    while (next < end) crc = crc32_step(crc ^ *next++);
    return ~crc;
}

static uint16_t header_check(const void* header) {
    return (uint16_t)ols_crc32(0, header, CHECKED_BYTES);
}

size_t ols_frame_encode(uint16_t type, uint16_t request_id, const void* payload, size_t payload_bytes, uint8_t* frame,
                        size_t frame_bytes_max) {
    const size_t frame_bytes = HEADER_BYTES + payload_bytes + sizeof(uint32_t);
    if (payload_bytes > OLS_PAYLOAD_BYTES_MAX || frame_bytes > frame_bytes_max) return 0;
    struct ols_frame_header header = {
        .sync = OLS_FRAME_SYNC, .payload_bytes = (uint16_t)payload_bytes, .type = type, .request_id = request_id};
    header.header_check = header_check(&header);
    memcpy(frame, &header, HEADER_BYTES);
    if (payload_bytes) memcpy(frame + HEADER_BYTES, payload, payload_bytes);
    const uint32_t crc = ols_crc32(0, frame, HEADER_BYTES + payload_bytes);
    memcpy(frame + HEADER_BYTES + payload_bytes, &crc, sizeof crc);
    return frame_bytes;
}

size_t ols_frame_parser_write(struct ols_frame_parser* parser, const void* bytes, size_t byte_count) {
    if (parser->begin > 0) {
        memmove(parser->bytes, parser->bytes + parser->begin, parser->end - parser->begin);
        parser->end -= parser->begin;
        parser->begin = 0;
    }
    const size_t room = sizeof parser->bytes - parser->end;
    const size_t taken = byte_count < room ? byte_count : room;
    memcpy(parser->bytes + parser->end, bytes, taken);
    parser->end += taken;
    return taken;
}

// What the bytes from `bytes` on are, as far as `byte_count` of them tell.
enum verdict { INCOMPLETE, INVALID, VALID };

static enum verdict judge_frame(const uint8_t* bytes, size_t byte_count, struct ols_frame_header* header) {
    if (bytes[0] != (OLS_FRAME_SYNC & 0xff)) return INVALID;
    if (byte_count < HEADER_BYTES) return INCOMPLETE;
    memcpy(header, bytes, HEADER_BYTES);
    if (header->sync != OLS_FRAME_SYNC || header->header_check != header_check(bytes)) return INVALID;
    if (header->payload_bytes > OLS_PAYLOAD_BYTES_MAX) return INVALID;
    const size_t covered_bytes = HEADER_BYTES + header->payload_bytes;
    if (byte_count < covered_bytes + sizeof(uint32_t)) return INCOMPLETE;
    uint32_t crc;
    memcpy(&crc, bytes + covered_bytes, sizeof crc);
    return crc == ols_crc32(0, bytes, covered_bytes) ? VALID : INVALID;
}

bool ols_frame_parser_read(struct ols_frame_parser* parser, struct ols_frame* frame) {
    for (; parser->begin < parser->end; parser->begin++, parser->dropped_bytes++) {
        const uint8_t* const bytes = parser->bytes + parser->begin;
        struct ols_frame_header header;
        const enum verdict verdict = judge_frame(bytes, parser->end - parser->begin, &header);
        if (verdict == INVALID) continue;
        if (verdict == INCOMPLETE) return false;
        *frame = (struct ols_frame){header.type, header.request_id, header.payload_bytes, bytes + HEADER_BYTES};
        parser->begin += HEADER_BYTES + header.payload_bytes + sizeof(uint32_t);
        return true;
    }
    return false;
}

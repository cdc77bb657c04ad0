// SPDX-License-Identifier: MIT
// Fuzzes the frame parser with a mix of raw bytes, good frames and damaged frames, in pieces of any size: it stays
// within its buffer, always makes room for more, and hands out only frames that the encoder would have made.
// links: ols_protocol
#include <algorithm>
#include <cstdlib>
#include <cstring>
#include <vector>

#include "frame.h"

namespace {

void expect(bool truth) {
    if (!truth) abort();
}

// The input is a script: an operation, a length, and as many bytes.
std::vector<uint8_t> stream_from_script(const uint8_t* script, size_t size) {
    std::vector<uint8_t> stream;
    while (size >= 3) {
        const int operation = script[0];
        const size_t length = std::min<size_t>(script[1] + (script[2] & 3) * 256, size - 3);
        const uint8_t* const bytes = script + 3;
        if (operation % 3 == 0) {
            stream.insert(stream.end(), bytes, bytes + length);
        } else {
            uint8_t frame[OLS_FRAME_BYTES_MAX];
            const size_t frame_bytes = ols_frame_encode(script[2], script[1], bytes, length, frame, sizeof frame);
            if (operation % 3 == 2) frame[script[1] % frame_bytes] ^= uint8_t(operation);
            stream.insert(stream.end(), frame, frame + frame_bytes);
        }
        script += 3 + length;
        size -= 3 + length;
    }
    return stream;
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* script, size_t size) {
    const std::vector<uint8_t> stream = stream_from_script(script, size);
    ols_frame_parser parser{};
    uint64_t handed_out_bytes = 0;
    for (size_t used = 0; used < stream.size();) {
        const size_t offered = std::min<size_t>(1 + stream[used] % 70, stream.size() - used);
        const size_t taken = ols_frame_parser_write(&parser, stream.data() + used, offered);
        expect(taken > 0 && taken <= offered);
        used += taken;
        for (ols_frame frame; ols_frame_parser_read(&parser, &frame);) {
            uint8_t again[OLS_FRAME_BYTES_MAX];
            const size_t bytes =
                ols_frame_encode(frame.type, frame.request_id, frame.payload, frame.payload_bytes, again, sizeof again);
            expect(bytes > 0 && memcmp(again, frame.payload - sizeof(ols_frame_header), bytes) == 0);
            handed_out_bytes += bytes;
        }
    }
    expect(handed_out_bytes + parser.dropped_bytes <= stream.size());
    return 0;
}

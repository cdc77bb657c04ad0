// SPDX-License-Identifier: MIT
// Fuzzes ISO-TP with frames of any bytes, time that passes, and sending meanwhile: no message without its frames, counts
// within the buffer, every message ends within the standard's time-outs, and two honest ends understand each other after it.
// links: ols_protocol
#include <algorithm>
#include <cstdlib>
#include <cstring>

#include "isotp.h"

namespace {

void expect(bool truth) {
    if (!truth) abort();
}

constexpr uint16_t capacity = 300;

struct End {
    End(uint8_t block_size) { isotp_init(&tp, buffer, capacity, block_size); }
    uint8_t buffer[capacity];
    isotp tp;
};

// Moves frames both ways until there are none.
void carry(End& from, End& to, uint64_t now_us) {
    for (uint8_t data[8];;) {
        if (const uint8_t n = isotp_next_frame(&from.tp, data, now_us))
            isotp_take_frame(&to.tp, data, n, now_us);
        else if (const uint8_t m = isotp_next_frame(&to.tp, data, now_us))
            isotp_take_frame(&from.tp, data, m, now_us);
        else
            return;
    }
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* script, size_t size) {
    if (size < 1) return 0;
    End end(script[0] & 7);
    uint8_t message[400], frame[8];
    for (size_t i = 0; i < sizeof message; i++) message[i] = uint8_t(i * 31 + 7);
    uint64_t now_us = 1, taken_bytes = 0;
    for (size_t at = 1; at < size;) {
        const uint8_t operation = script[at++];
        if (operation < 0x20) {
            now_us += uint64_t(operation) * 40'000;
            isotp_poll(&end.tp, now_us);
        } else if (operation < 0x28) {
            isotp_send(&end.tp, message, uint16_t(operation * 10 % sizeof message), now_us);
        } else if (operation < 0x30) {
            const uint8_t n = isotp_next_frame(&end.tp, frame, now_us);
            expect(n <= 8);
        } else if (operation < 0x34) {
            expect(isotp_message_bytes(&end.tp) <= taken_bytes);  // not one byte more than came
            isotp_release(&end.tp);
        } else {
            const uint8_t bytes = uint8_t(std::min<size_t>(operation & 15, size - at));
            isotp_take_frame(&end.tp, script + at, bytes, now_us);
            taken_bytes += bytes;
            at += bytes;
        }
        expect(end.tp.received <= end.tp.receive_bytes || isotp_message_bytes(&end.tp) == 0);
        expect(end.tp.receive_bytes <= capacity && end.tp.received <= capacity);
    }
    // Whatever is under way ends by itself, but for a sender that is told to wait again and again, which is not.
    for (int n = 0; n < 2; n++) isotp_poll(&end.tp, now_us += ISOTP_TIMEOUT_US);
    expect(!isotp_is_sending(&end.tp));
    isotp_release(&end.tp);
    while (isotp_next_frame(&end.tp, frame, now_us) > 0) {
    }
    End peer(script[0] >> 5);
    const auto bytes = uint16_t(1 + size % capacity);
    expect(isotp_send(&peer.tp, message, bytes, now_us));
    carry(peer, end, now_us);
    expect(isotp_message_bytes(&end.tp) == bytes && memcmp(end.buffer, message, bytes) == 0);
    expect(isotp_send(&end.tp, message, bytes, now_us));
    carry(end, peer, now_us);
    expect(isotp_message_bytes(&peer.tp) == bytes && memcmp(peer.buffer, message, bytes) == 0);
    return 0;
}

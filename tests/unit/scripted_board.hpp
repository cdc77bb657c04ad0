// SPDX-License-Identifier: MIT
// A board that answers what a test says, framed by protocol/frame.c.
#pragma once

#include <algorithm>
#include <cstring>
#include <functional>
#include <memory>
#include <span>
#include <vector>

#include "device/board.hpp"
#include "layout_hash.h"

namespace ols {

using Bytes = std::vector<uint8_t>;

template <typename T>
Bytes bytes_of(const T& value) {
    const auto* at = reinterpret_cast<const uint8_t*>(&value);
    return Bytes(at, at + sizeof value);
}

struct Answer {
    uint16_t type;
    Bytes payload;
};

// Parses what the client sends and queues what `answer` says, handed out in pieces of `piece` bytes.
class ScriptedBoard : public Transfer {
  public:
    using Script = std::function<Answer(uint16_t type, const Bytes& payload)>;
    ScriptedBoard(Script script, size_t piece) : script_(std::move(script)), piece_(piece) {}

    Status write(std::span<const uint8_t> bytes, uint32_t, const Deadline&) override {
        ols_frame_parser_write(&parser_, bytes.data(), bytes.size());
        ols_frame frame;
        while (ols_frame_parser_read(&parser_, &frame)) {
            const Bytes payload(frame.payload, frame.payload + frame.payload_bytes);
            const Answer answer = script_(frame.type, payload);
            uint8_t reply[OLS_FRAME_BYTES_MAX];
            const size_t n = ols_frame_encode(answer.type, frame.request_id, answer.payload.data(),
                                              answer.payload.size(), reply, sizeof reply);
            out_.insert(out_.end(), reply, reply + n);
        }
        return Done{};
    }
    Result<Bytes> read(size_t capacity, uint32_t, const Deadline&) override {
        if (out_.empty()) return fail("the board did not answer in time");
        const size_t n = std::min({capacity, piece_, out_.size()});
        Bytes piece(out_.begin(), out_.begin() + ptrdiff_t(n));
        out_.erase(out_.begin(), out_.begin() + ptrdiff_t(n));
        return piece;
    }
    Bytes out_;

  private:
    Script script_;
    size_t piece_;
    ols_frame_parser parser_{};
};

inline ols_hello_reply hello_reply() {
    ols_hello_reply reply{};
    reply.layout_hash = OLS_LAYOUT_HASH;
    std::strcpy(reply.firmware_version, "1.2.3");
    for (uint8_t i = 0; i < 8; ++i) reply.board_id[i] = uint8_t(0x10 + i);
    reply.tick_hz = 125'000'000;
    reply.chain_bits = 176;
    return reply;
}

}  // namespace ols

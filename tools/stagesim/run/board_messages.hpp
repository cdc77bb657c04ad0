// SPDX-License-Identifier: MIT
// What the emulated board tells the virtual stage, one JSON line a message (docs/architecture.md, "Exposures").
#pragma once

#include <cstdint>
#include <string>
#include <variant>
#include <vector>

#include "result.hpp"
#include "stage/stage.hpp"

namespace ols {

// A trigger was high from `rise` to `fall` (board ticks); in each segment one pattern was lit.
struct ExposureMessage {
    struct Segment {
        uint64_t on, off;           // board ticks
        std::vector<uint8_t> bits;  // one a chain bit, 0 or 1
    };
    int trigger = 0;
    uint64_t rise = 0, fall = 0;
    std::vector<Segment> segments;
};
struct NowMessage {
    uint64_t tick = 0;  // every exposure that rose before it has been told of
};
// The answer to a line {"type":"sync","n":N} of ours: what came before it is all that happened before the board read that.
struct SyncMessage {
    uint64_t n = 0, tick = 0;  // every exposure that rose before the tick has been told of
};
struct UsbMessage {
    bool connected = false;
};
struct OtherMessage {
    std::string type;  // hello, reset, end, or one of a newer board
};
using BoardMessage = std::variant<ExposureMessage, NowMessage, SyncMessage, UsbMessage, OtherMessage>;

// The error quotes the line.
Result<BoardMessage> parse_board_message(const std::string& line);

// How long each lamp of the stage was lit, in microseconds; levels add up from segments. Chain bits without a lamp are
// ignored.
std::vector<double> lit_microseconds(const ExposureMessage& exposure, const StageConfig& stage);

constexpr double microseconds_per_tick = 0.008;

}  // namespace ols

// SPDX-License-Identifier: MIT
// JSON lines to messages.
#include "run/board_messages.hpp"

#include <nlohmann/json.hpp>

namespace ols {

namespace {

using nlohmann::json;

std::vector<uint8_t> parse_bits(const std::string& hex) {
    std::vector<uint8_t> bits;
    for (const char digit : hex) {
        const int value = std::stoi(std::string(1, digit), nullptr, 16);
        for (int b = 3; b >= 0; --b) bits.push_back(uint8_t(value >> b & 1));
    }
    return bits;
}

ExposureMessage parse_exposure(const json& message) {
    ExposureMessage exposure;
    message.at("trigger").get_to(exposure.trigger);
    message.at("rise").get_to(exposure.rise);
    message.at("fall").get_to(exposure.fall);
    for (const json& segment : message.at("segments"))
        exposure.segments.push_back({segment.at("on"), segment.at("off"), parse_bits(segment.at("bits"))});
    return exposure;
}

}  // namespace

Result<BoardMessage> parse_board_message(const std::string& line) {
    try {
        const json message = json::parse(line);
        const std::string type = message.at("type");
        if (type == "exposure") return BoardMessage(parse_exposure(message));
        if (type == "now") return BoardMessage(NowMessage{message.at("tick")});
        if (type == "sync") return BoardMessage(SyncMessage{message.at("n"), message.at("tick")});
        if (type == "usb") return BoardMessage(UsbMessage{message.at("connected")});
        return BoardMessage(OtherMessage{type});
    } catch (const std::exception&) {
        return fail("the board sent a line that is no message of this version: " + line.substr(0, 120));
    }
}

std::vector<double> lit_microseconds(const ExposureMessage& exposure, const StageConfig& stage) {
    // Whole ticks are summed as integers: however the light is cut into segments, the sum is the same.
    std::vector<uint64_t> ticks(stage.lamp_count(), 0);
    for (const auto& segment : exposure.segments) {
        const uint64_t on = std::max(segment.on, exposure.rise), off = std::min(segment.off, exposure.fall);
        if (off <= on) continue;
        for (size_t lamp = 0; lamp < ticks.size(); ++lamp) {
            const size_t bit = size_t(stage.chain_bit_of_lamp[lamp]);
            if (bit < segment.bits.size() && segment.bits[bit]) ticks[lamp] += off - on;
        }
    }
    std::vector<double> lit_us;
    for (const uint64_t t : ticks) lit_us.push_back(double(t) * microseconds_per_tick);
    return lit_us;
}

}  // namespace ols

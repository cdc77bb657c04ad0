// SPDX-License-Identifier: MIT
// The formats of a camera that records for us, and three ways to put their bits.
#include "pixel_code.hpp"

#include <cassert>

namespace ols::test {

const std::vector<PixelCode>& pixel_codes() {
    using P = PixelCode;
    static const std::vector<PixelCode> codes = {
        {"Mono8", 0x01080001, 8, P::unpacked},         {"Mono10", 0x01100003, 10, P::unpacked},
        {"Mono10Packed", 0x010C0004, 10, P::pairs},    {"Mono10p", 0x010A0046, 10, P::stream},
        {"Mono12", 0x01100005, 12, P::unpacked},       {"Mono12Packed", 0x010C0006, 12, P::pairs},
        {"Mono12p", 0x010C0047, 12, P::stream},        {"Mono16", 0x01100007, 16, P::unpacked},
        {"BayerGR8", 0x01080008, 8, P::unpacked},      {"BayerRG8", 0x01080009, 8, P::unpacked},
        {"BayerGB8", 0x0108000A, 8, P::unpacked},      {"BayerBG8", 0x0108000B, 8, P::unpacked},
        {"BayerRG10", 0x0110000D, 10, P::unpacked},    {"BayerRG10Packed", 0x010C0027, 10, P::pairs},
        {"BayerRG10p", 0x010A0058, 10, P::stream},     {"BayerRG12", 0x01100011, 12, P::unpacked},
        {"BayerGR12Packed", 0x010C002A, 12, P::pairs}, {"BayerRG12Packed", 0x010C002B, 12, P::pairs},
        {"BayerGB12Packed", 0x010C002C, 12, P::pairs}, {"BayerBG12p", 0x010C0053, 12, P::stream},
        {"BayerRG12p", 0x010C0059, 12, P::stream},     {"BayerRG16", 0x0110002F, 16, P::unpacked},
        {"RGB8", 0x02180014, 8, P::unpacked},
    };
    return codes;
}

const PixelCode& pixel_code(const std::string& name) {
    for (const PixelCode& code : pixel_codes())
        if (code.name == name) return code;
    assert(false);
    return pixel_codes()[0];
}

const PixelCode& pixel_code(uint32_t value) {
    for (const PixelCode& code : pixel_codes())
        if (code.code == value) return code;
    return pixel_codes()[0];
}

std::vector<uint8_t> packed(const std::vector<uint16_t>& samples, const PixelCode& format) {
    const size_t count = samples.size();
    std::vector<uint8_t> bytes((count * (format.code >> 16 & 0xff) + 7) / 8);
    if (format.packing == PixelCode::stream) {
        // Bit by bit, the lowest of each sample first.
        for (size_t n = 0; n < count * size_t(format.bits); ++n)
            bytes[n / 8] |= uint8_t((samples[n / size_t(format.bits)] >> n % size_t(format.bits) & 1) << n % 8);
    } else if (format.packing == PixelCode::pairs) {
        const int low_bits = format.bits - 8;
        for (size_t n = 0; n < count; ++n) {
            uint8_t* pair = &bytes[n / 2 * 3];
            pair[n % 2 * 2] = uint8_t(samples[n] >> low_bits);
            pair[1] |= uint8_t((samples[n] & ((1 << low_bits) - 1)) << n % 2 * 4);
        }
    } else {
        for (size_t n = 0; n < count; ++n) {
            if (format.bits == 8)
                bytes[n] = uint8_t(samples[n]);
            else
                bytes[2 * n] = uint8_t(samples[n]), bytes[2 * n + 1] = uint8_t(samples[n] >> 8);
        }
    }
    return bytes;
}

}  // namespace ols::test

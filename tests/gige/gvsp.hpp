// SPDX-License-Identifier: MIT
// Packets of GigE Vision's streaming protocol (standard 2.0, part "GVSP"): leader, payload and trailer of one image.
#pragma once

#include <cstdint>
#include <vector>

namespace ols::test {

using Packet = std::vector<uint8_t>;

struct GvspImage {
    uint64_t block_id = 0, ticks = 0;
    uint32_t pixel_code = 0, width = 0, height = 0, offset_x = 0, offset_y = 0;
    bool has_chunks = false;
};
constexpr uint32_t ip_udp_bytes = 28;  // that a packet's size counts, too

// `packet_bytes` as the stream channel's packet size register has it. Extended ids have 64 bits, others 16.
std::vector<Packet> gvsp_packets(const GvspImage& image, const std::vector<uint8_t>& payload, uint32_t packet_bytes,
                                 bool extended_ids);

// Big-endian numbers, as everything of GigE Vision.
void put(Packet& packet, uint64_t value, int bytes);
uint64_t get(const uint8_t* at, int bytes);

}  // namespace ols::test

// SPDX-License-Identifier: MIT
// Headers of 8 bytes (20 with extended ids) and what follows them.
#include "gvsp.hpp"

#include <algorithm>
#include <cstddef>

namespace ols::test {

namespace {

enum PacketFormat : uint8_t { leader = 1, trailer = 2, payload_generic = 3 };
constexpr uint16_t payload_image = 0x0001, has_chunks_bit = 0x4000;

Packet packet_of(PacketFormat format, uint64_t block_id, uint32_t packet_id, bool extended_ids) {
    Packet packet;
    put(packet, 0, 2);  // status: success
    if (extended_ids) {
        put(packet, 0, 2);
        put(packet, uint64_t(0x80 | format) << 24, 4);
        put(packet, block_id, 8);
        put(packet, packet_id, 4);
    } else {
        put(packet, block_id, 2);
        put(packet, uint64_t(format) << 24 | packet_id, 4);
    }
    return packet;
}

}  // namespace

void put(Packet& packet, uint64_t value, int bytes) {
    for (int shift = 8 * (bytes - 1); shift >= 0; shift -= 8) packet.push_back(uint8_t(value >> shift));
}

uint64_t get(const uint8_t* at, int bytes) {
    uint64_t value = 0;
    for (int n = 0; n < bytes; ++n) value = value << 8 | at[n];
    return value;
}

std::vector<Packet> gvsp_packets(const GvspImage& image, const std::vector<uint8_t>& payload, uint32_t packet_bytes,
                                 bool extended_ids) {
    const uint64_t type = payload_image | (image.has_chunks ? has_chunks_bit : 0);
    std::vector<Packet> packets;
    Packet first = packet_of(leader, image.block_id, 0, extended_ids);
    put(first, 0, 2);
    put(first, type, 2);
    put(first, image.ticks, 8);
    for (const uint32_t word : {image.pixel_code, image.width, image.height, image.offset_x, image.offset_y})
        put(first, word, 4);
    put(first, 0, 4);  // padding of rows and of the image
    packets.push_back(std::move(first));
    const size_t room = packet_bytes - ip_udp_bytes - (extended_ids ? 20 : 8);
    for (size_t from = 0; from < payload.size(); from += room) {
        Packet packet = packet_of(payload_generic, image.block_id, uint32_t(packets.size()), extended_ids);
        const auto begin = payload.begin() + std::ptrdiff_t(from);
        packet.insert(packet.end(), begin, begin + std::ptrdiff_t(std::min(room, payload.size() - from)));
        packets.push_back(std::move(packet));
    }
    Packet last = packet_of(trailer, image.block_id, uint32_t(packets.size()), extended_ids);
    put(last, type, 4);
    put(last, image.height, 4);
    packets.push_back(std::move(last));
    return packets;
}

}  // namespace ols::test

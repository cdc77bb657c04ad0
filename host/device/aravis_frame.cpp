// SPDX-License-Identifier: MIT
// Buffers' status, ids, times and samples.
#include "device/aravis_frame.hpp"

#include <cmath>

namespace ols {

namespace {

// ChunkTimestamp counts as the camera's clock does, in nanoseconds or ticks; it is that one of the two that is near the time stamp
// of the frame's leader.
constexpr double near_ns = 1e9;

}  // namespace

AravisFrames::AravisFrames(AravisLink& link, AravisSetup setup, uint32_t index)
    : setup_(std::move(setup)),
      index_(index),
      counts_16_bits_(link.is_gige()),
      chunks_(setup_.has_chunk_time ? arv_device_create_chunk_parser(link.device()) : nullptr),
      chunk_ticks_hz_(link.ticks_hz()) {}

AravisFrames::Kind AravisFrames::read(ArvBuffer* buffer, Frame& frame) {
    const ArvBufferStatus status = arv_buffer_get_status(buffer);
    if (status == ARV_BUFFER_STATUS_ABORTED || status == ARV_BUFFER_STATUS_CLEARED) return Kind::none;
    // Of a buffer that is not whole nothing can be believed: its id may be that of the frame it held before.
    if (status != ARV_BUFFER_STATUS_SUCCESS || !AravisStream::is_filled(buffer)) return Kind::incomplete;
    const ArvBufferPayloadType payload = arv_buffer_get_payload_type(buffer);
    if (payload != ARV_BUFFER_PAYLOAD_TYPE_IMAGE && payload != ARV_BUFFER_PAYLOAD_TYPE_EXTENDED_CHUNK_DATA)
        return Kind::incomplete;
    frame.camera = index_;
    frame.stamp = {arv_buffer_get_frame_id(buffer), time_ns(buffer)};
    if (!unpack(buffer, frame)) return Kind::incomplete;
    if (counts_16_bits_) frame.stamp.frame_id = ids_.unwrap(frame.stamp);
    return Kind::whole;
}

uint64_t AravisFrames::time_ns(ArvBuffer* buffer) {
    const uint64_t leader_ns = arv_buffer_get_timestamp(buffer);
    if (!chunks_ || !arv_buffer_has_chunks(buffer)) return leader_ns;
    LibraryError error;
    const auto ticks =
        uint64_t(arv_chunk_parser_get_integer_value(chunks_.get(), buffer, "ChunkTimestamp", error.out()));
    if (error) return leader_ns;
    const uint64_t scaled_ns = ticks_to_ns(ticks, chunk_ticks_hz_);
    for (const uint64_t ns : {ticks, scaled_ns})
        if (std::abs(double(int64_t(leader_ns - ns))) < near_ns) return ns;
    return leader_ns;
}

// False when samples are lacking.
bool AravisFrames::unpack(ArvBuffer* buffer, Frame& frame) const {
    int x = 0, y = 0, width = 0, height = 0, x_padding = 0, y_padding = 0;
    arv_buffer_get_image_region(buffer, &x, &y, &width, &height);
    arv_buffer_get_image_padding(buffer, &x_padding, &y_padding);
    frame.width = uint32_t(std::max(width, 0));
    frame.height = uint32_t(std::max(height, 0));
    frame.pitch_bytes = frame.width * uint32_t(sizeof(uint16_t));
    const bool is_as_set_up = arv_buffer_get_image_pixel_format(buffer) == setup_.pixel_code && setup_.layout &&
                              width == setup_.in_force.width && height == setup_.in_force.height;
    if (!is_as_set_up) return true;  // and whoever gets it sees that
    const SampleLayout& layout = *setup_.layout;
    frame.cfa = layout.cfa;
    frame.white = float((1 << layout.bits) - 1);
    size_t size = 0;
    const auto* data = static_cast<const std::byte*>(arv_buffer_get_image_data(buffer, &size));
    const size_t row_bytes = x_padding > 0 ? packed_row_bytes(layout, frame.width) + size_t(x_padding) : 0;
    frame.samples.make_room(size_t(frame.pitch_bytes) * frame.height);
    const std::span<uint16_t> samples(reinterpret_cast<uint16_t*>(frame.samples.data()),
                                      size_t(frame.width) * frame.height);
    return unpack_samples({data, size}, layout, frame.width, frame.height, row_bytes, samples).ok();
}

}  // namespace ols

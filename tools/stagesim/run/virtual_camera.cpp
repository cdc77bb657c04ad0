// SPDX-License-Identifier: MIT
// From exposures to stamped frames.
#include "run/virtual_camera.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <cmath>
#include <cstring>
#include <limits>

namespace ols {

uint64_t camera_time_ns(const CameraClock& clock, uint64_t tick) {
    // The drift is added to an exact product, so that no digit of a long recording is lost.
    const uint64_t board_ns = tick * 8;
    const int64_t drift_ns = std::llround(double(board_ns) * clock.drift_ppm * 1e-6);
    return uint64_t(clock.offset_ns + int64_t(board_ns) + drift_ns);
}

Frame make_frame(const Exposure& exposure, const CameraConfig& camera, const EffectSet& effects) {
    const Image& counts = exposure.counts;
    const bool whole_counts = effects.active("quantisation");
    Frame frame;
    frame.camera = exposure.camera;
    frame.width = uint32_t(counts.width), frame.height = uint32_t(counts.height);
    frame.cfa = counts.channels == 3 ? Cfa::rgb : camera.cfa;
    frame.format = whole_counts ? PixelFormat::u16 : PixelFormat::f32;
    frame.black = whole_counts ? float(camera.black) : 0;
    frame.white = whole_counts ? float(camera.white) : std::numeric_limits<float>::max();
    const size_t sample_bytes = whole_counts ? sizeof(uint16_t) : sizeof(float);
    frame.pitch_bytes = uint32_t(counts.width * counts.channels * sample_bytes);
    frame.samples.resize(counts.data.size() * sample_bytes);
    if (whole_counts) {
        auto* out = reinterpret_cast<uint16_t*>(frame.samples.data());
        for (size_t i = 0; i < counts.data.size(); ++i) out[i] = uint16_t(counts.data[i]);
    } else {
        std::memcpy(frame.samples.data(), counts.data.data(), frame.samples.size());
    }
    return frame;
}

RingContent ring_content(const Setup& setup, const std::set<std::string>& disabled) {
    const EffectSet effects(setup, disabled);
    RingContent content;
    content.width = uint32_t(setup.camera.width), content.height = uint32_t(setup.camera.height);
    content.cfa = effects.mosaic() ? setup.camera.cfa : Cfa::rgb;
    content.format = effects.active("quantisation") ? PixelFormat::u16 : PixelFormat::f32;
    content.bits = uint32_t(setup.camera.bits);
    return content;
}

VirtualCamera::VirtualCamera(const Setup& setup, const std::set<std::string>& disabled, uint32_t index, RingWriter ring,
                             const std::string& frames_path, const std::vector<Fault>& faults, bool wait_for_reader,
                             const std::atomic<bool>& cancelled)
    : setup_(setup),
      renderer_(setup, disabled),
      index_(index),
      ring_(std::move(ring)),
      frames_file_(frames_path),
      delivery_(faults, index),
      wait_for_reader_(wait_for_reader),
      cancelled_(cancelled),
      clock_(setup.scene.clock) {}

void VirtualCamera::expose(const ExposureMessage& message) {
    const uint64_t trigger = triggers_++;
    if (trigger == 0) first_rise_ = message.rise;
    if (const Fault* restart = delivery_.find(FaultKind::restart_camera, trigger)) {
        next_frame_id_ = 1;
        if (!restart->keep_clock) clock_epoch_tick_ = message.rise, clock_.offset_ns = 0;
    }
    std::vector<double> lit_us = lit_microseconds(message, setup_.stage);
    delivery_.dim(lit_us, trigger);
    if (delivery_.strikes(FaultKind::drop_trigger, trigger)) return;

    const CameraStamp stamp{next_frame_id_++, time_ns(message.rise)};
    write_truth(stamp, trigger, message.rise, lit_us);
    if (!ring_.wanted()) {
        ++unwanted_;
        return;
    }
    const double middle_us = (double(message.rise - first_rise_) + double(message.fall - first_rise_)) / 2;
    const Exposure exposure = renderer_.expose(lit_us, middle_us * microseconds_per_tick, trigger, index_);
    Frame frame = make_frame(exposure, setup_.camera, renderer_.effects());
    frame.stamp = stamp;
    delivery_.send(std::move(frame), trigger, [this](Frame f) { deliver(std::move(f)); });
}

void VirtualCamera::write_truth(const CameraStamp& stamp, uint64_t trigger, uint64_t tick,
                                const std::vector<double>& lit_us) {
    std::vector<size_t> lit;
    for (size_t lamp = 0; lamp < lit_us.size(); ++lamp)
        if (lit_us[lamp] != 0) lit.push_back(lamp);
    frames_file_.add(fmt::format(R"({{"frame_id":{},"timestamp_ns":{},"trigger":{},"tick":{},"lit":[{}]}})",
                                 stamp.frame_id, stamp.timestamp_ns, trigger, tick, fmt::join(lit, ",")));
}

Status VirtualCamera::keep_frames(const std::string& path) {
    kept_frames_.open(path, std::ios::binary);
    if (!kept_frames_) return fail("cannot write '" + path + "': check its folder");
    return Done{};
}

void VirtualCamera::keep(const Frame& frame) {
    if (!kept_frames_.is_open()) return;
    const uint64_t stamp[] = {frame.stamp.frame_id, frame.stamp.timestamp_ns};
    const size_t sample_bytes = frame.format == PixelFormat::u16 ? sizeof(uint16_t) : sizeof(float);
    const size_t row_bytes = size_t(frame.width) * size_t(samples_per_pixel(frame.cfa)) * sample_bytes;
    kept_frames_.write(reinterpret_cast<const char*>(stamp), sizeof stamp);
    for (size_t y = 0; y < frame.height; ++y)
        kept_frames_.write(reinterpret_cast<const char*>(frame.samples.data() + y * frame.pitch_bytes),
                           std::streamsize(row_bytes));
    kept_frames_.flush();
}

Status VirtualCamera::truth_written() const {
    if (kept_frames_.is_open() && !kept_frames_)
        return fail("the frames that are kept could not all be written: free space");
    return frames_file_.status();
}

void VirtualCamera::deliver(Frame frame) {
    switch (ring_.write(frame, wait_for_reader_, cancelled_)) {
        case RingWriter::Outcome::written:
            ++delivered_;
            keep(frame);
            break;
        case RingWriter::Outcome::unwanted: ++unwanted_; break;
        case RingWriter::Outcome::full:
        case RingWriter::Outcome::cancelled: ++dropped_; break;
    }
}

uint64_t VirtualCamera::time_ns(uint64_t tick) const {
    return camera_time_ns(clock_, tick - std::min(tick, clock_epoch_tick_));
}

void VirtualCamera::set_now(uint64_t tick) {
    ring_.set_watermark(time_ns(tick));
}

void VirtualCamera::confirm_start(uint32_t start, uint64_t tick) {
    ring_.confirm_start(start, time_ns(tick));
}

void VirtualCamera::finish() {
    delivery_.finish([this](Frame f) { deliver(std::move(f)); });
    ring_.close();
}

}  // namespace ols

// SPDX-License-Identifier: MIT
// Frame: one camera exposure as plain pixels, and the image types every stage hands on.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "image/sample_buffer.hpp"

namespace ols {

enum class PixelFormat : uint32_t {
    u16 = 1,  // unsigned counts, one 16-bit word a sample, little-endian
    f32 = 2,  // float counts, for sources without quantisation (camera model off)
};

enum class Cfa : uint32_t {
    none = 0,  // monochrome, one sample a pixel
    rggb = 1,
    bggr = 2,
    grbg = 3,
    gbrg = 4,
    rgb = 5,  // three interleaved samples a pixel, no mosaic
};

inline size_t sample_bytes(PixelFormat format) {
    return format == PixelFormat::u16 ? sizeof(uint16_t) : sizeof(float);
}

inline int samples_per_pixel(Cfa cfa) {
    return cfa == Cfa::rgb ? 3 : 1;
}

// The colour (0 red, 1 green, 2 blue) that a mosaic pixel sees; x, y in pixels from the top left.
inline int cfa_color(Cfa cfa, int x, int y) {
    const int odd = (y & 1) * 2 + (x & 1);
    switch (cfa) {
        case Cfa::rggb: return (const int[]){0, 1, 1, 2}[odd];
        case Cfa::bggr: return (const int[]){2, 1, 1, 0}[odd];
        case Cfa::grbg: return (const int[]){1, 0, 2, 1}[odd];
        case Cfa::gbrg: return (const int[]){1, 2, 0, 1}[odd];
        default: return 1;
    }
}

// What the camera says of a frame, before anybody knows which slot it is.
struct CameraStamp {
    uint64_t frame_id = 0;      // the camera's own count
    uint64_t timestamp_ns = 0;  // the camera's own clock, start of exposure
};

struct Frame {
    uint32_t camera = 0;
    CameraStamp stamp;
    uint32_t width = 0, height = 0;  // pixels
    PixelFormat format = PixelFormat::u16;
    Cfa cfa = Cfa::none;
    uint32_t pitch_bytes = 0;  // from row to row
    float black = 0;  // counts of no light; of a take's whole counts as measured or, failing that, as the stage has it
    float white = 4095;  // counts at which a sample saturates

    SampleBuffer samples;  // height * pitch_bytes

    // Where identify put it; valid only when `identified`.
    bool identified = false;
    uint32_t cycle = 0;
    uint32_t slot = 0;
    uint64_t tick = 0;            // trigger rise, board ticks
    uint32_t exposure_ticks = 0;  // trigger width
};

// Of one row, without what lies between rows.
inline size_t row_samples(const Frame& frame) {
    return frame.width * size_t(samples_per_pixel(frame.cfa));
}

// A dense float image, interleaved channels, rows top to bottom.
struct Image {
    int width = 0, height = 0, channels = 0;
    std::vector<float> data;

    Image() = default;
    Image(int w, int h, int c) : width(w), height(h), channels(c), data(size_t(w) * h * c) {}
    float& at(int x, int y, int c = 0) { return data[(size_t(y) * width + x) * channels + c]; }
    float at(int x, int y, int c = 0) const { return data[(size_t(y) * width + x) * channels + c]; }
};

}  // namespace ols

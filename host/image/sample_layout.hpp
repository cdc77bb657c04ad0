// SPDX-License-Identifier: MIT
// How cameras and their files lay out samples in memory, and unpacking them into our 16-bit words.
//
// Sources: PFNC (EMVA/AIA Pixel Format Naming Convention 2.4, section 6: unpacked, "p" and the GigE Vision "Packed" of appendix A
// there); Linux, Documentation/userspace-api/media/v4l/pixfmt-yuv-luma.rst and pixfmt-srggb10p.rst, -srggb12p.rst; Adobe DNG 1.6,
// "BitsPerSample" and TIFF 6.0, section "FillOrder", for streams of bits that begin with the highest.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

#include "image/frame.hpp"
#include "result.hpp"

namespace ols {

enum class SamplePacking {
    bytes,  // 8 bits a sample
    words,  // a 16-bit word a sample, little-endian, the value in its lowest bits (what is above them is kept: a device
            // that sets it is wrongly set up, and its samples count as saturated)
    words_high,  // the same, the value in its highest bits (what is below them is dropped)
    words_big,   // a 16-bit word a sample, big-endian, the value in its lowest bits
    gige_pairs,  // GigE Vision "Mono12Packed": two samples in 3 bytes, their high 8 bits first and last, their low bits between
    bits_low,   // PFNC "p": a stream of bits, the lowest first
    bits_high,  // a stream of bits, the highest first, each row from a whole byte on
    mipi,  // MIPI CSI-2 (V4L2 "P"): high 8 bits of 4 (10 bits) or 2 samples (12 bits), then a byte of their low bits
};

struct SampleLayout {
    SamplePacking packing = SamplePacking::words;
    int bits = 16;  // of a sample: 8 to 16; only 8 for bytes, 10 or 12 for gige_pairs and mipi
    Cfa cfa = Cfa::none;

    friend bool operator==(const SampleLayout&, const SampleLayout&) = default;
};

// Bytes that `samples` samples in a row take, at least; rows of bits begin at a whole byte. An odd last sample of gige_pairs takes
// two bytes; the last of mipi whole groups, as their low bits come last.
size_t packed_row_bytes(const SampleLayout& layout, size_t samples);

// Unpacks rows of `samples` samples into `to`, `height` rows of `samples` words without gaps. `row_bytes` is from row to row in `from`.
// With `row_bytes` 0 rows follow each other without regard to bytes, as PFNC "p" and GigE Vision leave them.
// Errors: `from` holds less than that, `to` is not height * samples long, or the layout is not one of those above.
Status unpack_samples(std::span<const std::byte> from, const SampleLayout& layout, size_t samples, size_t height,
                      size_t row_bytes, std::span<uint16_t> to);

}  // namespace ols

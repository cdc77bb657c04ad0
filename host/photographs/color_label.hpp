// SPDX-License-Identifier: MIT
// What a picture file says of its colours (transfer and primaries), and the way from there to linear light of Rec. 709's primaries.
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "image/primaries.hpp"
#include "result.hpp"

namespace ols {

struct ColorLabel {
    std::string name;              // for messages: "the profile 'Adobe RGB (1998)'"; empty: the file says nothing
    std::vector<uint8_t> profile;  // ICC; if any, it decides
    double gamma = 0;              // light = code ^ gamma; 0: not said
    std::array<std::vector<uint16_t>, 3>
        curves;  // TIFF 6.0 section 20, TransferFunction: light 0..65535 by code; empty: none
    std::optional<Primaries> primaries;
    bool is_srgb = false;  // said in so many words
};

// sRGB as a table of 4096 entries, light 0..65535 by code.
std::vector<uint16_t> srgb_curve();

// Colour codes of ITU-T H.273 as a label. Errors (without the file's name): a transfer for displays, primaries of another kind.
Result<ColorLabel> label_of_codes(int primaries, int transfer, const std::string& name);

// A way from codes (0 to 1) to linear light, colours adapted to D65 by Bradford's matrix (relative colorimetric, by Little CMS).
class ColorConversion {
  public:
    // `channels` is 1 or 3. Errors (without the file's name): a damaged profile, one for other channels, primaries that span
    // no triangle, a gamma out of range.
    static Result<ColorConversion> create(const ColorLabel& label, int channels);

    // Whether it is that of sRGB, to a part in a thousand of the full scale: a table does the same.
    bool is_srgb() const { return is_srgb_; }
    // Interleaved samples, in place. Thread-safe.
    void apply(std::span<float> samples) const;

  private:
    std::shared_ptr<void> transform_;
    int channels_ = 0;
    bool is_srgb_ = false;
};

}  // namespace ols

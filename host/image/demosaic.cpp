// SPDX-License-Identifier: MIT
// Malvar, He and Cutler's demosaicing filters.
#include "image/demosaic.hpp"

#include <fmt/format.h>

#include <cassert>
#include <cstdlib>

namespace ols {

namespace {

constexpr int border = 2;

int mirrored(int i, int size) {
    const int period = 2 * (size - 1);
    i = std::abs(i) % period;
    return i < size ? i : period - i;
}

Image with_mirrored_border(const Image& image) {
    Image padded(image.width + 2 * border, image.height + 2 * border, 1);
    for (int y = 0; y < padded.height; ++y)
        for (int x = 0; x < padded.width; ++x)
            padded.at(x, y) = image.at(mirrored(x - border, image.width), mirrored(y - border, image.height));
    return padded;
}

// The sums of neighbours that all four filters are made of. `p` points at the pixel in the padded mosaic.
struct Neighborhood {
    float here, across1, across2, down1, down2, diagonal;

    Neighborhood(const float* p, int pitch)
        : here(p[0]),
          across1(p[-1] + p[1]),
          across2(p[-2] + p[2]),
          down1(p[-pitch] + p[pitch]),
          down2(p[-2 * pitch] + p[2 * pitch]),
          diagonal(p[-pitch - 1] + p[-pitch + 1] + p[pitch - 1] + p[pitch + 1]) {}
};

float green_at_red_or_blue(const Neighborhood& n) {
    return (4 * n.here + 2 * (n.across1 + n.down1) - (n.across2 + n.down2)) / 8;
}

// Red at blue and blue at red.
float opposite_color(const Neighborhood& n) {
    return (6 * n.here + 2 * n.diagonal - 1.5f * (n.across2 + n.down2)) / 8;
}

// At green: the colour whose nearest samples are left and right, and the one whose nearest are above and below.
float color_across(const Neighborhood& n) {
    return (5 * n.here + 4 * n.across1 - n.diagonal - n.across2 + 0.5f * n.down2) / 8;
}

float color_down(const Neighborhood& n) {
    return (5 * n.here + 4 * n.down1 - n.diagonal - n.down2 + 0.5f * n.across2) / 8;
}

}  // namespace

Status check_mosaic_size(Cfa cfa, int width, int height) {
    if (cfa == Cfa::none || cfa == Cfa::rgb || (width >= 2 && height >= 2)) return Done{};
    return fail(fmt::format("a mosaic of {} x {} pixels does not hold all its colours: it takes 2 x 2", width, height));
}

Image demosaic(const Image& mosaic, Cfa cfa) {
    assert(mosaic.channels == 1 && mosaic.width >= 2 && mosaic.height >= 2);
    assert(cfa != Cfa::none && cfa != Cfa::rgb);
    const Image padded = with_mirrored_border(mosaic);
    Image rgb(mosaic.width, mosaic.height, 3);
    for (int y = 0; y < rgb.height; ++y) {
        for (int x = 0; x < rgb.width; ++x) {
            const Neighborhood n(&padded.data[size_t(y + border) * padded.width + x + border], padded.width);
            const int seen = cfa_color(cfa, x, y);
            float* pixel = &rgb.at(x, y);
            pixel[seen] = n.here;
            if (seen == 1) {
                const int beside = cfa_color(cfa, x + 1, y);
                pixel[beside] = color_across(n);
                pixel[2 - beside] = color_down(n);
            } else {
                pixel[1] = green_at_red_or_blue(n);
                pixel[2 - seen] = opposite_color(n);
            }
        }
    }
    return rgb;
}

Image as_rgb(const Image& image, Cfa cfa) {
    if (image.channels == 3) return image;
    if (cfa != Cfa::none) return demosaic(image, cfa);
    Image rgb(image.width, image.height, 3);
    for (size_t i = 0; i < rgb.data.size(); ++i) rgb.data[i] = image.data[i / 3];
    return rgb;
}

}  // namespace ols

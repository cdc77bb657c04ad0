// SPDX-License-Identifier: MIT
// Turned and mirrored pictures: Exif 2.32, tag 274 Orientation, 1 to 8 (the same as TIFF 6.0's).
#pragma once

#include "image/frame.hpp"

namespace ols {

// Where a pixel of the upright picture lies in the stored one of width x height.
struct StoredPixel {
    int x, y;
};
StoredPixel stored_pixel(int orientation, int width, int height, int x, int y);

// Whether width and height change places.
constexpr bool is_turned_aside(int orientation) {
    return orientation >= 5;
}

// The picture as a viewer shows it. Values of the tag beyond 1 to 8 are the caller's to refuse.
Image upright(Image stored, int orientation);

// The filter of a mosaic that upright() turned.
Cfa upright(Cfa stored, int orientation, int width, int height);

}  // namespace ols

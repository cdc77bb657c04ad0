// SPDX-License-Identifier: MIT
// One mapping for pictures and for the filters of mosaics.
#include "image/orientation.hpp"

#include <algorithm>

namespace ols {

StoredPixel stored_pixel(int orientation, int width, int height, int x, int y) {
    const int right = width - 1, bottom = height - 1;
    switch (orientation) {
        case 2: return {right - x, y};
        case 3: return {right - x, bottom - y};
        case 4: return {x, bottom - y};
        case 5: return {y, x};
        case 6: return {y, bottom - x};
        case 7: return {right - y, bottom - x};
        case 8: return {right - y, x};
        default: return {x, y};
    }
}

Image upright(Image stored, int orientation) {
    if (orientation <= 1) return stored;
    const bool aside = is_turned_aside(orientation);
    Image image(aside ? stored.height : stored.width, aside ? stored.width : stored.height, stored.channels);
    for (int y = 0; y < image.height; ++y)
        for (int x = 0; x < image.width; ++x) {
            const auto from = stored_pixel(orientation, stored.width, stored.height, x, y);
            std::copy_n(&stored.at(from.x, from.y, 0), stored.channels, &image.at(x, y, 0));
        }
    return image;
}

Cfa upright(Cfa stored, int orientation, int width, int height) {
    for (const Cfa cfa : {Cfa::rggb, Cfa::bggr, Cfa::grbg, Cfa::gbrg}) {
        bool same = true;
        for (int y = 0; y < 2; ++y)
            for (int x = 0; x < 2; ++x) {
                const auto from = stored_pixel(orientation, width, height, x, y);
                same &= cfa_color(cfa, x, y) == cfa_color(stored, from.x, from.y);
            }
        if (same) return cfa;
    }
    return stored;
}

}  // namespace ols

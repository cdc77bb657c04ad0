// SPDX-License-Identifier: MIT
// First along the rows that have chroma, then down the columns.
#include "image/exr_chroma.hpp"

#include <ImfRgbaYca.h>

#include <algorithm>
#include <vector>

namespace ols {

namespace {

namespace Yca = Imf::RgbaYca;
using Row = std::vector<Imf::Rgba>;

// A row of chroma in every second of `width` pixels, with the margins that the filter reads.
Row spread(const Image& halved, int row, int width) {
    Row spread(size_t(width + Yca::N - 1), Imf::Rgba(0, 0, 0, 0));
    for (int i = 0; i < int(spread.size()); ++i) {
        const int x = std::clamp((i - Yca::N2) >> 1, 0, halved.width - 1);
        spread[size_t(i)] = Imf::Rgba(halved.at(x, row, 0), 0, halved.at(x, row, 1), 0);
    }
    return spread;
}

}  // namespace

Image full_chroma(const Image& halved) {
    Image full(2 * halved.width, 2 * halved.height, 2);
    std::vector<Row> rows;  // the even ones
    for (int y = 0; y < halved.height; ++y) {
        rows.emplace_back(size_t(full.width));
        Yca::reconstructChromaHoriz(full.width, spread(halved, y, full.width).data(), rows.back().data());
    }
    Row between(size_t(full.width));
    for (int y = 0; y < full.height; ++y) {
        const Row* row = &rows[size_t(y / 2)];
        if (y % 2 == 1) {
            const Imf::Rgba* around[Yca::N];
            for (int k = 0; k < Yca::N; ++k)
                around[k] = rows[size_t(std::clamp((y - Yca::N2 + k) >> 1, 0, halved.height - 1))].data();
            Yca::reconstructChromaVert(full.width, around, between.data());
            row = &between;
        }
        for (int x = 0; x < full.width; ++x) {
            full.at(x, y, 0) = (*row)[size_t(x)].r;
            full.at(x, y, 1) = (*row)[size_t(x)].b;
        }
    }
    return full;
}

void chroma_to_rgb(Image& ycc, const std::array<double, 3>& weights) {
    for (size_t i = 0; i < ycc.data.size(); i += size_t(ycc.channels)) {
        float* p = &ycc.data[i];
        if (p[1] == 0 && p[2] == 0) {  // grey exactly
            p[1] = p[2] = p[0];
            continue;
        }
        const double y = p[0], red = (p[1] + 1.0) * y, blue = (p[2] + 1.0) * y;
        p[0] = float(red);
        p[1] = float((y - red * weights[0] - blue * weights[2]) / weights[1]);
        p[2] = float(blue);
    }
}

}  // namespace ols

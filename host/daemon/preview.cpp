// SPDX-License-Identifier: MIT
// One target, strip by strip, under one light.
#include "daemon/preview.hpp"

#include <algorithm>
#include <cmath>

#include "archive/archive.hpp"
#include "exceptions.hpp"
#include "image/demosaic.hpp"
#include "image/png.hpp"
#include "relight/relight.hpp"

namespace ols {

namespace {

Result<LampWeights> weights_for(const std::vector<LightPosition>& lights, double exposure_ev) {
    std::vector<Vec3> directions;
    for (const LightPosition& light : lights) directions.push_back(light.direction);
    const auto cells = SphereCells::make(directions);
    if (!cells) return cells.error();
    const double gain = std::exp2(exposure_ev), fill = 0.3;
    LampWeights weights;
    for (const double solid_angle : cells->solid_angles())
        weights.irradiance.push_back({gain * fill * solid_angle, gain * fill * solid_angle, gain * fill * solid_angle});
    add_point_light({{-0.6, 0.7, 0.8}, {gain * 0.9, gain * 0.9, gain * 0.9}}, *cells, weights);
    return weights;
}

}  // namespace

Result<Preview> preview_target(const std::string& archive, uint32_t camera, uint32_t index, double exposure_ev) {
    return guarded("the preview cannot be made", [&]() -> Result<Preview> {
        const auto reader = ArchiveReader::open(archive);
        if (!reader) return reader.error();
        const auto weights = weights_for(reader->info().lights, exposure_ev);
        if (!weights) return weights.error();
        const auto target = reader->open_target(camera, index, TargetCheck::size);
        if (!target) return target.error();
        const Target& head = target->head();
        Preview preview{{}, head.width, head.height, 0};
        Image sum;
        const int rows = target->strip_rows();
        for (int y = 0; y < head.height; y += rows) {
            const auto strip = target->read_box({0, y, head.width, std::min(rows, head.height - y)});
            if (!strip) return strip.error();
            const auto lit = relight({strip->width, strip->height, strip->cfa, strip->lamps}, *weights, 1);
            if (!lit) return lit.error();
            if (sum.data.empty()) sum = Image(head.width, head.height, lit->image.channels);
            std::ranges::copy(lit->image.data, sum.data.begin() + std::ptrdiff_t(y) * head.width * sum.channels);
            preview.masked_pixels +=
                size_t(std::ranges::count_if(strip->mask, [](uint32_t bits) { return bits != 0; }));
        }
        auto png = encode_png_preview(as_rgb(sum, head.cfa));
        if (!png) return png.error();
        preview.png = std::move(*png);
        return preview;
    });
}

}  // namespace ols

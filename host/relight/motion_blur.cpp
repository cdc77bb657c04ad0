// SPDX-License-Identifier: MIT
// The mean of sub-frames, tile by tile: each with as many of them as the motion that crosses it needs.
#include "relight/motion_blur.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <atomic>
#include <cmath>

#include "relight/moved_sheet.hpp"
#include "worker_threads.hpp"

namespace ols {

namespace {

constexpr int tile_size = 32;

// From the nearer end, so that the ends, and what lies between equal ends, keep their bits.
float between(float a, float b, float fraction) {
    return fraction < 0.5f ? a + fraction * (b - a) : b - (1 - fraction) * (b - a);
}

Status check_options(double frame_rate_hz, const MotionBlurOptions& options) {
    if (!(options.shutter_deg >= 0 && options.shutter_deg <= 720))
        return fail(
            fmt::format("a shutter of {} degrees: give 0 (no blur) to 720 (two frames long)", options.shutter_deg));
    if (!(std::abs(options.phase_deg) <= 360))
        return fail(fmt::format("a shutter phase of {} degrees: give -360 to 360", options.phase_deg));
    if (!(options.step_px >= 0.01 && options.step_px <= 16))
        return fail(fmt::format("a blur step of {} pixels: give 0.01 to 16", options.step_px));
    if (!(frame_rate_hz > 0 && std::isfinite(frame_rate_hz)))
        return fail(fmt::format("{} frames a second: a shutter angle needs a frame rate above 0", frame_rate_hz));
    return Done{};
}

Status check_picture(const Image& sharp) {
    const auto bad = std::count_if(sharp.data.begin(), sharp.data.end(), [](float v) { return !std::isfinite(v); });
    if (bad == 0) return Done{};
    return fail(fmt::format(
        "the picture has {} samples that are not finite, which would spread along the motion: lower the exposure",
        bad));
}

// Motion farther than the picture is large shows nothing, and would take as many sub-frames as it is long.
Status check_reach(const ExposurePath& path) {
    const FlowField& first = path.moved[0];
    const double limit = double(first.width) * first.width + double(first.height) * first.height;
    for (size_t k = 0; k < path.moved.size(); ++k)
        for (size_t p = 0; p < first.size(); ++p)
            if (const double u = path.moved[k].u[p], v = path.moved[k].v[p]; !(u * u + v * v <= limit))
                return fail(
                    fmt::format("at {:+.2f} ms the motion leads farther than the picture is large, from pixel {}, {}: "
                                "that is no motion to blur along; use a narrower shutter",
                                path.times_s[k] * 1e3, p % size_t(first.width), p / size_t(first.width)));
    return Done{};
}

class Blurrer {
  public:
    Blurrer(const Image& sharp, const ExposurePath& path, double step_px)
        : sharp_(sharp),
          path_(path),
          step_px_(step_px),
          sheet_(path),
          columns_((sharp.width + tile_size - 1) / tile_size),
          rows_((sharp.height + tile_size - 1) / tile_size),
          patches_of_tile_(size_t(columns_) * size_t(rows_)),
          blurred_(sharp) {
        for (size_t i = 0; i < sheet_.patches().size(); ++i) assign(i);
    }

    BlurredImage run(int threads) {
        std::atomic<int> next = 0;
        std::atomic<size_t> unseen = 0;
        run_workers(thread_count(threads), [&](int) {
            for (int tile; (tile = next++) < columns_ * rows_;) unseen += blur_tile(tile);
        });
        return {std::move(blurred_), path_.extrapolated_s, unseen};
    }

  private:
    // Notes a patch with every tile that it may be seen in.
    void assign(size_t index) {
        const SheetPatch& patch = sheet_.patches()[index];
        const auto tile_of = [](float place, int tiles) {
            return int(std::clamp(std::floor(place / tile_size), -1.0f, float(tiles)));
        };
        const int x0 = std::max(0, tile_of(patch.left, columns_)),
                  x1 = std::min(columns_ - 1, tile_of(patch.right, columns_));
        const int y0 = std::max(0, tile_of(patch.top, rows_)), y1 = std::min(rows_ - 1, tile_of(patch.bottom, rows_));
        for (int y = y0; y <= y1; ++y)
            for (int x = x0; x <= x1; ++x) patches_of_tile_[size_t(y * columns_ + x)].push_back(index);
    }

    int sub_frames(const std::vector<size_t>& patches, size_t piece) const {
        float longest = 0;
        for (const size_t i : patches) longest = std::max(longest, sheet_.patches()[i].piece_px[piece]);
        return std::max(1, int(std::ceil(longest / step_px_)));
    }

    // Returns how many of its pixels saw nothing.
    size_t blur_tile(int index) {
        const auto& patches = patches_of_tile_[size_t(index)];
        if (std::all_of(patches.begin(), patches.end(), [&](size_t i) { return sheet_.patches()[i].still; })) return 0;
        const int x = index % columns_ * tile_size, y = index / columns_ * tile_size;
        SheetTile tile{x, y, std::min(tile_size, sharp_.width - x), std::min(tile_size, sharp_.height - y), {}};
        const size_t pixels = size_t(tile.width) * size_t(tile.height);
        std::vector<double> seen_s(pixels);
        std::vector<float> change(pixels * size_t(sharp_.channels));
        const std::vector<SheetHit> still = hits_of_still(patches, tile);
        for (size_t piece = 0; piece < path_.pieces(); ++piece) {
            const int count = sub_frames(patches, piece);
            for (int n = 0; n < count; ++n) {
                tile.hits = still;
                for (const size_t i : patches)
                    if (const auto& patch = sheet_.patches()[i]; !patch.still)
                        sheet_.draw(patch, piece, (float(n) + 0.5f) / float(count), tile);
                add_sub_frame(tile, path_.piece_s(piece) / count, seen_s, change);
            }
        }
        return finish(tile, seen_s, change);
    }

    // What does not move is drawn once for all sub-frames.
    std::vector<SheetHit> hits_of_still(const std::vector<size_t>& patches, SheetTile& tile) const {
        tile.hits.assign(size_t(tile.width) * size_t(tile.height), {SheetHit::nothing, 0, 0, 0, 0});
        for (const size_t i : patches)
            if (const auto& patch = sheet_.patches()[i]; patch.still) sheet_.draw(patch, 0, 0, tile);
        return tile.hits;
    }

    // Sums differences from the sharp picture, so that what does not change keeps its bits.
    void add_sub_frame(const SheetTile& tile, double weight_s, std::vector<double>& seen_s,
                       std::vector<float>& change) const {
        const size_t channels = size_t(sharp_.channels);
        for (size_t i = 0; i < tile.hits.size(); ++i) {
            const SheetHit& hit = tile.hits[i];
            if (hit.nearness == SheetHit::nothing) continue;
            seen_s[i] += weight_s;
            const int x0 = sheet_.pixel_x(hit.cell_x), x1 = sheet_.pixel_x(hit.cell_x + 1);
            const int y0 = sheet_.pixel_y(hit.cell_y), y1 = sheet_.pixel_y(hit.cell_y + 1);
            const float *a = pixel(x0, y0), *b = pixel(x1, y0), *c = pixel(x0, y1), *d = pixel(x1, y1);
            const float* own = pixel(tile.x + int(i) % tile.width, tile.y + int(i) / tile.width);
            for (size_t k = 0; k < channels; ++k) {
                const float value = between(between(a[k], b[k], hit.fx), between(c[k], d[k], hit.fx), hit.fy);
                change[i * channels + k] += float(weight_s) * (value - own[k]);
            }
        }
    }

    size_t finish(const SheetTile& tile, const std::vector<double>& seen_s, const std::vector<float>& change) {
        const size_t channels = size_t(sharp_.channels);
        size_t unseen = 0;
        for (size_t i = 0; i < seen_s.size(); ++i) {
            if (seen_s[i] == 0) {
                ++unseen;
                continue;
            }
            const size_t at =
                (size_t(tile.y + int(i) / tile.width) * size_t(sharp_.width) + size_t(tile.x + int(i) % tile.width)) *
                channels;
            for (size_t k = 0; k < channels; ++k) blurred_.data[at + k] += change[i * channels + k] / float(seen_s[i]);
        }
        return unseen;
    }

    const float* pixel(int x, int y) const {
        return &sharp_.data[(size_t(y) * size_t(sharp_.width) + size_t(x)) * size_t(sharp_.channels)];
    }

    const Image& sharp_;
    const ExposurePath& path_;
    const double step_px_;
    const MovedSheet sheet_;
    const int columns_, rows_;  // of tiles
    std::vector<std::vector<size_t>> patches_of_tile_;
    Image blurred_;
};

}  // namespace

Result<BlurredImage> motion_blurred(const Image& sharp, const TargetMotion& motion, double frame_rate_hz,
                                    const MotionBlurOptions& options) {
    if (auto s = check_options(frame_rate_hz, options); !s) return s.error();
    if (auto s = check_picture(sharp); !s) return s.error();
    if (auto s = check_motion(motion, sharp.width, sharp.height); !s) return s.error();
    if (motion.times_s.empty()) return fail("there is no motion to blur along");
    if (options.shutter_deg == 0) return BlurredImage{sharp};
    const double frame_s = 1 / frame_rate_hz, middle_s = options.phase_deg / 360 * frame_s;
    const double half_s = options.shutter_deg / 720 * frame_s;
    const ExposurePath path = exposure_path(motion, middle_s - half_s, middle_s + half_s);
    if (auto s = check_reach(path); !s) return s.error();
    return Blurrer(sharp, path, options.step_px).run(options.threads);
}

}  // namespace ols

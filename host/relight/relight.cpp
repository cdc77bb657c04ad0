// SPDX-License-Identifier: MIT
// The weighted sum, in blocks of rows that stay in cache while all lamps are added to them.
#include "relight/relight.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <numbers>

#include "worker_threads.hpp"

namespace ols {

namespace {

// A block's sums stay below this, half of a first-level cache of 32 KB.
constexpr size_t block_floats = 4096;

bool is_mosaic(Cfa cfa) {
    return cfa != Cfa::none && cfa != Cfa::rgb;
}

// sum[x] += weight[x % 2] * plane[x]; eight at a time is what the compiler turns into vectors.
void add_weighted(float* sum, const float* plane, int count, float even, float odd) {
    const float weights[8] = {even, odd, even, odd, even, odd, even, odd};
    int x = 0;
    for (; x + 8 <= count; x += 8)
        for (int k = 0; k < 8; ++k) sum[x + k] += weights[k] * plane[x + k];
    for (; x < count; ++x) sum[x] += weights[x % 2] * plane[x];
}

class Relighter {
  public:
    Relighter(const OlatImages& olat, const LampWeights& weights) : olat_(olat), outputs_(is_mosaic(olat.cfa) ? 1 : 3) {
        for (const Rgb& w : weights.irradiance)
            for (double v : w) weights_.push_back(float(v / std::numbers::pi));
        result_.image = Image(olat.width, olat.height, outputs_);
        rows_per_block_ = std::max(1, int(block_floats / (size_t(olat.width) * outputs_)));
    }

    RelitImage run(int threads) {
        threads = thread_count(threads);
        std::atomic<int> next_row = 0;
        std::vector<std::vector<size_t>> left_out(threads, std::vector<size_t>(olat_.lamps()));
        run_workers(threads, [&](int worker) {
            std::vector<float> sums(size_t(outputs_) * rows_per_block_ * olat_.width);
            for (int y; (y = next_row.fetch_add(rows_per_block_)) < olat_.height;)
                relight_rows(y, std::min(y + rows_per_block_, olat_.height), sums, left_out[worker]);
        });
        result_.left_out_samples.assign(olat_.lamps(), 0);
        for (const auto& counts : left_out)
            for (int lamp = 0; lamp < olat_.lamps(); ++lamp) result_.left_out_samples[lamp] += counts[lamp];
        return std::move(result_);
    }

  private:
    const Plane& plane(int lamp, int output) const {
        return olat_.planes[size_t(lamp) * olat_.planes_per_lamp() + (olat_.cfa == Cfa::rgb ? output : 0)];
    }

    float weight(int lamp, int output, int x, int y) const {
        return weights_[size_t(lamp) * 3 + (outputs_ == 1 ? cfa_color(olat_.cfa, x, y) : output)];
    }

    void relight_rows(int begin, int end, std::vector<float>& sums, std::vector<size_t>& left_out) {
        const int width = olat_.width;
        const size_t output_floats = size_t(rows_per_block_) * width;
        std::fill(sums.begin(), sums.end(), 0.0f);
        for (int lamp = 0; lamp < olat_.lamps(); ++lamp)
            for (int o = 0; o < outputs_; ++o)
                for (int y = begin; y < end; ++y)
                    add_weighted(&sums[o * output_floats + size_t(y - begin) * width],
                                 &plane(lamp, o)[size_t(y) * width], width, weight(lamp, o, 0, y),
                                 weight(lamp, o, 1, y));
        for (int y = begin; y < end; ++y)
            for (int x = 0; x < width; ++x)
                for (int o = 0; o < outputs_; ++o) {
                    const float sum = sums[o * output_floats + size_t(y - begin) * width + x];
                    result_.image.at(x, y, o) = std::isfinite(sum) ? sum : sum_of_finite(x, y, o, left_out);
                }
    }

    // A NaN or Inf among the samples shows in the sum; only then are they looked at one by one.
    float sum_of_finite(int x, int y, int output, std::vector<size_t>& left_out) const {
        float sum = 0;
        for (int lamp = 0; lamp < olat_.lamps(); ++lamp) {
            const float sample = plane(lamp, output)[size_t(y) * olat_.width + x];
            if (std::isfinite(sample))
                sum += weight(lamp, output, x, y) * sample;
            else if (output == 0 || olat_.cfa == Cfa::rgb)
                ++left_out[lamp];
        }
        return sum;
    }

    const OlatImages& olat_;
    int outputs_;
    int rows_per_block_;
    std::vector<float> weights_;  // lamps x 3, over pi
    RelitImage result_;
};

}  // namespace

Result<RelitImage> relight(const OlatImages& olat, const LampWeights& weights, int threads) {
    if (olat.planes.empty() || olat.planes.size() % olat.planes_per_lamp() != 0)
        return fail(fmt::format("{} image planes are no whole number of lamps with {} each", olat.planes.size(),
                                olat.planes_per_lamp()));
    if (olat.lamps() != int(weights.irradiance.size()))
        return fail(
            fmt::format("there are OLAT images of {} lamps and weights for {}: use the light positions that "
                        "belong to these images",
                        olat.lamps(), weights.irradiance.size()));
    if (is_mosaic(olat.cfa) && (olat.width < 2 || olat.height < 2))
        return fail(
            fmt::format("a mosaic of {} x {} pixels holds no colours: 2 x 2 is the least", olat.width, olat.height));
    for (size_t i = 0; i < olat.planes.size(); ++i)
        if (olat.planes[i].size() != size_t(olat.width) * olat.height)
            return fail(fmt::format("plane {} has {} samples, an image of {} x {} has {}", i, olat.planes[i].size(),
                                    olat.width, olat.height, size_t(olat.width) * olat.height));
    return Relighter(olat, weights).run(threads);
}

}  // namespace ols

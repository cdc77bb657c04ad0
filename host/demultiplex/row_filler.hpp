// SPDX-License-Identifier: MIT
// Row filler: fills the masked samples of tiles before they are inverted, and tells for each sample how that was done.
//
// Samples of a tile with the same masked rows share one RowFill, which is kept for the next tile: highlights are clustered.
#pragma once

#include <list>
#include <map>
#include <memory>
#include <mutex>
#include <span>
#include <vector>

#include "demultiplex/masked_sample.hpp"
#include "demultiplex/row_fill.hpp"
#include "stage/stage.hpp"

namespace ols {

// The fills of the sets of rows that were masked last; for any number of threads.
class FillCache {
  public:
    // `capacity` sets: half of 159 rows masked take 51 KB.
    FillCache(const FillModel& model, Estimate estimate, size_t capacity = 512)
        : model_(model), estimate_(estimate), capacity_(capacity) {}

    std::shared_ptr<const RowFill> fill_for(const std::vector<int>& masked);

    const FillModel& model() const { return model_; }
    Estimate estimate() const { return estimate_; }

  private:
    struct Entry {
        std::shared_ptr<const RowFill> fill;
        std::list<std::vector<int>>::iterator use;
    };
    const FillModel& model_;
    const Estimate estimate_;
    const size_t capacity_;
    std::mutex mutex_;
    std::map<std::vector<int>, Entry> entries_;
    std::list<std::vector<int>> uses_;  // latest first
};

// How a sample was filled; the figures are RowFill's.
struct SampleFill {
    FillKind kind = FillKind::none;
    float noise_gain = 1, worst_noise_gain = 1, power = 0, worst_power = 0;
};

// What a filler knows of the samples besides their counts; spans are as long as the job.
struct SampleKnowledge {
    std::span<const float>
        offset;  // added to every row's count of a sample, and no light (a fraction of the black level)
    std::span<const float> white;        // the count at which a sample saturates
    std::span<const uint8_t> lost_rows;  // a 1 for each row that was never recorded: its samples have no least value
    NoiseModel noise;
};

class RowFiller final : public SampleFiller {
  public:
    // `fills` has a place for every sample of the job.
    RowFiller(FillCache& cache, const SampleKnowledge& knowledge, std::span<SampleFill> fills)
        : cache_(cache), knowledge_(knowledge), fills_(fills) {}

    // Rounds to whole counts, half away from zero. A sample that is not solved is filled with zeros.
    void fill(int32_t* tile, size_t begin, size_t count) const override;
    // The same, not rounded; masked samples are NaN.
    void fill(float* tile, size_t begin, size_t count) const;

  private:
    struct Tile;
    void fill(Tile& tile, size_t begin) const;
    void bound(const RowFill& fill, Tile& tile, size_t sample, size_t at) const;

    FillCache& cache_;
    SampleKnowledge knowledge_;
    std::span<SampleFill> fills_;
};

// Fills the rows themselves, where whoever reads them next takes no filler. Tiles of which no sample is marked in `masked` (not
// 0 where any row's sample is masked; its length is the rows') are passed over unread.
void fill_rows(const RowFiller& filler, std::span<int32_t* const> rows, std::span<const uint8_t> masked);
void fill_rows(const RowFiller& filler, std::span<float* const> rows, std::span<const uint8_t> masked);

}  // namespace ols

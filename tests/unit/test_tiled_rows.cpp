// SPDX-License-Identifier: MIT
// Frames stored in tiles invert to the same as plain images, whatever their size and depth.
// links: ols_demultiplex
#include <gtest/gtest.h>

#include <random>

#include "demultiplex/hadamard_tile.hpp"
#include "demultiplex/tiled_rows.hpp"

using namespace ols;

namespace {

// Frames of any depth, as plain images of counts above black and as tiled rows, inverted both ways.
template <typename Count>
void expect_same_sums(size_t samples, int count_max, const SampleFiller* filler, int white) {
    const Basis basis = *find_basis("s159");
    const HadamardPlan plan = *hadamard_plan(basis);
    std::mt19937 random(3);
    TiledRows tiled(basis.rows, samples);
    std::vector<int16_t> black(samples);
    for (auto& b : black) b = int16_t(random() % 7);
    std::vector<std::vector<int32_t>> rows;
    for (int row = 0; row < basis.rows; ++row) {
        std::vector<Count> counts(samples);
        rows.emplace_back();
        for (size_t p = 0; p < samples; ++p) {
            counts[p] = Count(random() % unsigned(count_max + 1));
            rows.back().push_back(counts[p] >= white ? masked_sample<int32_t> : counts[p] - black[p]);
        }
        tiled.write<Count>(row, counts, black, white);
    }
    std::vector<const int32_t*> first;
    for (const auto& row : rows) first.push_back(row.data());
    std::vector<std::vector<int32_t>> sums[2];
    for (const bool from_tiles : {false, true}) {
        sums[from_tiles].assign(size_t(basis.images()), std::vector<int32_t>(samples));
        std::vector<int32_t*> out;
        for (auto& lamp : sums[from_tiles]) out.push_back(lamp.data());
        HadamardJob job{.plan = &plan, .sums = {out}, .filler = filler};
        if (from_tiles)
            job.rows16 = tiled.planes();
        else
            job.rows32 = {first};
        TileScratch scratch(plan);
        TileCounts counts;
        invert_tiles(job, 0, samples, scratch, counts);
    }
    EXPECT_EQ(sums[0], sums[1]);
}

class Zeroes : public SampleFiller {
  public:
    void fill(int32_t* tile, size_t, size_t) const override {
        for (size_t at = 0; at < 159 * tile_samples; ++at)
            if (tile[at] == masked_sample<int32_t>) tile[at] = 0;
    }
};

TEST(TiledRows, invert_as_plain_images_do_at_any_size_and_depth) {
    for (const size_t samples : {1u, 31u, 32u, 33u, 1000u}) {
        expect_same_sums<uint8_t>(samples, 255, nullptr, 1 << 16);
        expect_same_sums<uint16_t>(samples, 4095, nullptr, 1 << 16);
        expect_same_sums<uint16_t>(samples, 32767, nullptr, 1 << 16);
    }
}

TEST(TiledRows, saturated_counts_are_masked) {
    const Zeroes filler;
    expect_same_sums<uint16_t>(500, 4095, &filler, 4000);
    expect_same_sums<uint8_t>(500, 255, &filler, 255);
}

}  // namespace

// SPDX-License-Identifier: MIT
// The structured inversion of Hadamard bases: exact in integers on every SIMD path, for any counts, with short sums that
// wrapped always noticed; and as few additions as it says.
// links: ols_demultiplex
#include <gtest/gtest.h>

#include <half.h>

#include <cstdlib>
#include <random>

#include "demultiplex/hadamard_tile.hpp"

using namespace ols;

namespace {

using Planes = std::vector<std::vector<int32_t>>;

template <typename T>
std::vector<T*> pointers(std::vector<std::vector<std::remove_const_t<T>>>& planes, size_t offset = 0) {
    std::vector<T*> out;
    for (auto& plane : planes) out.push_back(plane.data() + offset);
    return out;
}

// The sums by their definition.
Planes by_definition(const Basis& basis, const Planes& rows) {
    const size_t samples = rows[0].size();
    Planes sums(size_t(basis.lamps), std::vector<int32_t>(samples));
    for (int lamp = 0; lamp < basis.lamps; ++lamp)
        for (int row = 0; row < basis.rows; ++row) {
            const int32_t weight = basis.weight(row, lamp);
            for (size_t p = 0; p < samples; ++p) sums[size_t(lamp)][p] += weight * rows[size_t(row)][p];
        }
    return sums;
}

class HadamardInverse : public testing::TestWithParam<std::string> {
  protected:
    ~HadamardInverse() override { choose_tile_path(nullptr); }

    // From rows of 16 bits where they fit, and from rows of 32 bits; both must agree.
    Planes inverted(Planes rows) {
        const size_t samples = rows[0].size();
        Planes sums(size_t(basis.lamps), std::vector<int32_t>(samples));
        TileScratch scratch(plan);
        counts = {};
        const auto rows32 = pointers<const int32_t>(rows);
        const auto out = pointers<int32_t>(sums);
        invert_tiles({.plan = &plan, .rows32 = {rows32}, .sums = {out}}, 0, samples, scratch, counts);
        std::vector<std::vector<int16_t>> short_rows;
        for (const auto& row : rows) {
            short_rows.emplace_back(row.begin(), row.end());
            if (!std::equal(row.begin(), row.end(), short_rows.back().begin())) return sums;
        }
        Planes again = sums;
        const auto rows16 = pointers<const int16_t>(short_rows);
        const auto out_again = pointers<int32_t>(again);
        invert_tiles({.plan = &plan, .rows16 = {rows16}, .sums = {out_again}}, 0, samples, scratch, counts);
        EXPECT_EQ(sums, again);
        return sums;
    }

    Planes random_rows(size_t samples, int lowest, int highest, unsigned seed = 1) const {
        std::mt19937 random(seed);
        std::uniform_int_distribution<int> count(lowest, highest);
        Planes rows(size_t(basis.rows), std::vector<int32_t>(samples));
        for (auto& row : rows)
            for (auto& v : row) v = count(random);
        return rows;
    }

    // Rows of which lamp `lamp` gets the sum `wanted` and every other lamp a small one: its own weights, scaled.
    Planes rows_for(int lamp, int wanted) const {
        Planes rows(size_t(basis.rows), std::vector<int32_t>(1));
        int sum = 0, ones = 0;
        for (int row = 0; row < basis.rows; ++row) ones += std::abs(basis.weight(row, lamp)) == 1;
        for (int row = 0; row < basis.rows; ++row) {
            const int weight = basis.weight(row, lamp);
            if (std::abs(weight) != 1) continue;
            rows[size_t(row)][0] = weight * (wanted / ones);
            sum += wanted / ones;
        }
        for (int row = 0; sum != wanted; ++row)
            if (std::abs(basis.weight(row, lamp)) == 1)
                rows[size_t(row)][0] += basis.weight(row, lamp) * (wanted > sum ? 1 : -1), sum += wanted > sum ? 1 : -1;
        return rows;
    }

    const Basis basis = *find_basis(GetParam());
    const HadamardPlan plan = *hadamard_plan(basis);
    TileCounts counts;
};
INSTANTIATE_TEST_SUITE_P(, HadamardInverse, testing::Values("s159", "hadamard156"));

// SAMPLES=10000000 for the long run.
TEST_P(HadamardInverse, sums_equal_exact_arithmetic_on_every_path) {
    const char* wanted = std::getenv("SAMPLES");
    const size_t samples = wanted ? std::strtoull(wanted, nullptr, 10) : 20'000;
    constexpr size_t at_once = 4001;  // no multiple of a tile
    // Camera counts, as bright as 16 bits get, and about where short sums begin to wrap.
    constexpr int ranges[][2] = {{-40, 4095}, {-32768, 32767}, {-2600, 2600}, {-9, 9}};
    for (size_t done = 0; done < samples; done += at_once) {
        const auto& range = ranges[done / at_once % 4];
        const Planes rows = random_rows(at_once, range[0], range[1], unsigned(done));
        const Planes truth = by_definition(basis, rows);
        for (const char* path : tile_paths()) {
            choose_tile_path(path);
            ASSERT_EQ(inverted(rows), truth) << path << ", counts to " << range[1];
        }
    }
}

TEST_P(HadamardInverse, counts_beyond_16_bits_are_exact_too) {
    for (const char* path : tile_paths()) {
        choose_tile_path(path);
        const Planes rows = random_rows(130, -(1 << 23) + 1, (1 << 23) - 1);
        EXPECT_EQ(inverted(rows), by_definition(basis, rows)) << path;
        EXPECT_EQ(counts.fallbacks, counts.tiles) << path;
    }
}

// One sum at each corner of 16 bits, of every lamp. 65536 is the hardest: it wraps to zero, and its square is 2^32, which
// an identity modulo 2^32 alone would not miss.
TEST_P(HadamardInverse, a_single_wrapped_sum_is_always_noticed) {
    for (const char* path : tile_paths()) {
        choose_tile_path(path);
        for (const int wanted : {32767, -32767, 32768, -32768, 32769, -32769, 65535, 65536, -65536, 131072})
            for (int lamp = 0; lamp < basis.lamps; lamp += 7) {
                const Planes rows = rows_for(lamp, wanted), truth = by_definition(basis, rows);
                ASSERT_EQ(truth[size_t(lamp)][0], wanted);
                ASSERT_EQ(inverted(rows), truth) << path << " lamp " << lamp << " sum " << wanted;
                const bool sum_of_all = plan.lamp_output[size_t(lamp)] == 0;
                const bool fits = std::abs(wanted) < 32768 || sum_of_all;  // which is kept in 32 bits
                ASSERT_EQ(counts.fallbacks, fits ? 0u : counts.tiles) << path << " lamp " << lamp << " sum " << wanted;
            }
    }
}

TEST_P(HadamardInverse, ordinary_counts_need_no_fallback) {
    std::mt19937 random(5);
    Planes lamps(size_t(basis.lamps), std::vector<int32_t>(640)), rows(size_t(basis.rows), lamps[0]);
    for (auto& lamp : lamps)
        for (auto& v : lamp) v = int(random() % 40);  // up to 4095 counts with half of the lamps lit
    for (int row = 0; row < basis.rows; ++row) {
        std::fill(rows[size_t(row)].begin(), rows[size_t(row)].end(), 0);
        for (int lamp = 0; lamp < basis.lamps; ++lamp)
            for (size_t p = 0; p < 640 && basis.lit(row, lamp); ++p) rows[size_t(row)][p] += lamps[size_t(lamp)][p];
    }
    const Planes sums = inverted(rows);
    EXPECT_EQ(counts.fallbacks, 0u);
    const int one = int(std::lround(1 / basis.scale));
    for (int lamp = 0; lamp < basis.lamps; ++lamp)
        for (size_t p = 0; p < 640; ++p) ASSERT_EQ(sums[size_t(lamp)][p], one * lamps[size_t(lamp)][p]);
}

// Every output type of the same rows, in images that begin at odd places and in tiles.
TEST_P(HadamardInverse, shorts_floats_and_halves_are_the_sums_rounded_as_they_say_less_their_offsets) {
    constexpr size_t samples = 4 * tile_samples + 5, tiles = 5;
    Planes rows = random_rows(samples, -200, 200);
    for (auto& row : rows) row[2] *= 120;  // too bright for shorts
    const Planes sums = by_definition(basis, rows);
    std::vector<float> factors(samples);
    for (size_t p = 0; p < samples; ++p) factors[p] = 0.0125f * float(p % 9) - 0.03f;
    factors[7] = 1e-9f, factors[8] = 2e-8f, factors[9] = 1e4f;  // zero, subnormal and infinite halves
    const size_t images = size_t(basis.images());
    // Each other lamp has them from another list.
    const std::vector<float> even(samples, 0.25f);
    std::vector<float> odd(samples);
    for (size_t p = 0; p < samples; ++p) odd[p] = 0.5f - 0.01f * float(p);
    std::vector<const float*> offsets;
    for (size_t i = 0; i < images; ++i) offsets.push_back(i % 2 ? odd.data() : even.data());
    for (const char* path : tile_paths())
        for (const bool tiled : {false, true}) {
            const bool has_offsets = tiled;
            choose_tile_path(path);
            const size_t image_step = tiled ? tile_samples : samples + 3,
                         tile_step = tiled ? images * tile_samples : tile_samples;
            std::vector<int16_t> shorts(images * (tiles * tile_samples + 3) + 64);
            std::vector<float> floats(shorts.size());
            std::vector<uint16_t> halves(shorts.size());
            const auto first = [&](auto& values) {
                auto* const aligned =
                    values.data() + (64 - reinterpret_cast<uintptr_t>(values.data()) % 64) % 64 / sizeof(values[0]);
                std::vector<std::decay_t<decltype(aligned)>> out;
                for (size_t i = 0; i < images; ++i) out.push_back(aligned + i * image_step);
                return out;
            };
            const auto short_images = first(shorts);
            const auto float_images = first(floats);
            const auto half_images = first(halves);
            const auto rows32 = pointers<const int32_t>(rows);
            TileScratch scratch(plan);
            counts = {};
            invert_tiles(
                {.plan = &plan,
                 .rows32 = {rows32},
                 .shorts = {short_images, tile_step},
                 .floats = {float_images, tile_step},
                 .halves = {half_images, tile_step},
                 .factors = factors,
                 .offsets = has_offsets ? std::span<const float* const>(offsets) : std::span<const float* const>()},
                0, samples, scratch, counts);
            uint64_t clipped = 0;
            const ols::Planes<float> layout{float_images, tile_step};
            for (size_t i = 0; i < images; ++i)
                for (size_t p = 0; p < samples; ++p) {
                    const int32_t z = sums[i][p];
                    const float value = float(z) * factors[p] - (has_offsets ? offsets[i][p] : 0);
                    const size_t at = layout.offset(p);
                    clipped += z != std::clamp(z, -32768, 32767);
                    ASSERT_EQ(short_images[i][at], std::clamp(z, -32768, 32767)) << path;
                    ASSERT_EQ(float_images[i][at], value) << path;
                    ASSERT_EQ(half_images[i][at], Imath::half(value).bits()) << path << " " << value;
                }
            EXPECT_GT(clipped, 0u);
            EXPECT_EQ(counts.clipped, clipped);
        }
}

// A filler whose values are easy to foretell.
class FillsWithSampleNumber : public SampleFiller {
  public:
    explicit FillsWithSampleNumber(int rows) : rows_(rows) {}

    void fill(int32_t* tile, size_t begin, size_t count) const override {
        for (int row = 0; row < rows_; ++row)
            for (size_t i = 0; i < count; ++i) {
                int32_t& sample = tile[size_t(row) * tile_samples + i];
                if (sample == masked_sample<int32_t>) sample = int32_t(begin + i) + row;
            }
    }

  private:
    int rows_;
};

TEST_P(HadamardInverse, masked_samples_and_lost_rows_are_inverted_as_they_are_filled) {
    constexpr size_t samples = 5 * tile_samples + 7;
    Planes rows = random_rows(samples, -40, 200), filled = rows;
    const auto mask = [&](int row, size_t p) {
        rows[size_t(row)][p] = masked_sample<int32_t>;
        filled[size_t(row)][p] = int32_t(p) + row;
    };
    mask(3, 5), mask(4, 5), mask(0, 2 * tile_samples), mask(basis.rows - 1, samples - 1);
    rows[7][3 * tile_samples] = filled[7][3 * tile_samples] = 1 << 20;  // not masked; too large for 16 bits
    const FillsWithSampleNumber filler(basis.rows);
    for (const bool with_lost_row : {false, true}) {
        for (size_t p = 0; with_lost_row && p < samples; ++p) mask(9, p);
        const Planes truth = by_definition(basis, filled);
        auto rows32 = pointers<const int32_t>(rows);
        if (with_lost_row) rows32[9] = nullptr;
        for (const char* path : tile_paths()) {
            choose_tile_path(path);
            Planes sums(size_t(basis.lamps), std::vector<int32_t>(samples));
            TileScratch scratch(plan);
            counts = {};
            const auto out = pointers<int32_t>(sums);
            invert_tiles({.plan = &plan, .rows32 = {rows32}, .sums = {out}, .filler = &filler}, 0, samples, scratch,
                         counts);
            EXPECT_EQ(sums, truth) << path;
            EXPECT_EQ(counts.filled, with_lost_row ? counts.tiles : 3u) << path;
            EXPECT_EQ(counts.fallbacks, 1u) << path;
        }
    }
}

TEST_P(HadamardInverse, the_lowest_value_of_16_bits_is_a_count_unless_there_is_a_filler) {
    Planes rows = random_rows(70, -40, 200);
    rows[5][3] = -32768;
    rows[6][66] = -32768;
    EXPECT_EQ(inverted(rows), by_definition(basis, rows));
    std::vector<std::vector<int16_t>> short_rows;
    for (const auto& row : rows) short_rows.emplace_back(row.begin(), row.end());
    rows[5][3] = 8, rows[6][66] = 72;
    const FillsWithSampleNumber filler(basis.rows);
    auto rows16 = pointers<const int16_t>(short_rows);
    for (const char* path : tile_paths()) {
        choose_tile_path(path);
        Planes sums(size_t(basis.lamps), std::vector<int32_t>(70));
        TileScratch scratch(plan);
        const auto out = pointers<int32_t>(sums);
        invert_tiles({.plan = &plan, .rows16 = {rows16}, .sums = {out}, .filler = &filler}, 0, 70, scratch,
                     counts = {});
        EXPECT_EQ(sums, by_definition(basis, rows)) << path;
        EXPECT_EQ(counts.filled, 2u) << path;
    }
}

// A plain sum takes rows - 1 additions a lamp: 24 648 and 24 180.
TEST(HadamardPlan, takes_a_tenth_and_a_seventh_of_the_additions) {
    EXPECT_LE(hadamard_plan(*find_basis("s159"))->whole.additions(), 2538);
    EXPECT_LE(hadamard_plan(*find_basis("hadamard156"))->whole.additions(), 3266);
}

TEST(HadamardPlan, a_basis_that_only_bears_the_name_has_none) {
    Basis basis = *find_basis("s159");
    basis.weights[1000] = int8_t(-basis.weights[1000]);
    EXPECT_FALSE(hadamard_plan(basis));
    EXPECT_FALSE(hadamard_plan(*find_basis("single")));
}

TEST(SumPlan, shared_pairs_change_nothing_but_the_number_of_additions) {
    std::mt19937 random(2);
    std::vector<Terms> rows(40);
    std::vector<std::vector<int>> matrix(40, std::vector<int>(30));
    for (size_t r = 0; r < rows.size(); ++r)
        for (int n = 0; n < 30; ++n) {
            matrix[r][size_t(n)] = int(random() % 3) - 1;
            if (matrix[r][size_t(n)]) rows[r].push_back({n, matrix[r][size_t(n)]});
        }
    int before = 0;
    for (const int uses_min : {1000, 4, 2}) {
        SumPlan plan(30);
        for (const int value : plan.sums(rows, uses_min)) plan.add_output(value);
        EXPECT_EQ(plan.matrix(), matrix);
        if (before) {
            EXPECT_LT(plan.additions(), before);
        }
        before = plan.additions();
    }
}

}  // namespace

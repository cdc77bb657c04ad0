// SPDX-License-Identifier: MIT
// Rows that are images of their own: the product in closed form, wherever they begin and however long they are.
// links: ols_demultiplex
#include "demultiplex/scaled_row.hpp"

#include <gtest/gtest.h>
#include <hwy/targets.h>

#include <cstdint>
#include <random>
#include <vector>

#include "image/plane.hpp"

using namespace ols;

namespace {

constexpr size_t samples = 203;  // no multiple of any vector

struct Images {
    Plane aligned, beside;  // the latter begins a sample beyond a cache line
    bool operator==(const Images&) const = default;
};

template <typename Sample>
Images scaled(const std::vector<Sample>& row, const RowScale& scale) {
    Images out{Plane(samples + 1, -7.0f), Plane(samples + 2, -7.0f)};
    scale_row(row.data(), samples, scale, out.aligned.data());
    scale_row(row.data(), samples, scale, out.beside.data() + 1);
    return out;
}

template <typename Sample>
void expect_products(const std::vector<Sample>& row, double weight) {
    std::mt19937 random(3);
    std::vector<float> factors, offsets;
    for (size_t p = 0; p < samples; ++p) {
        factors.push_back(0.001f * float(random() % 5000));
        offsets.push_back(float(random() % 9));
    }
    std::vector<Images> results;
    for (const int64_t target : hwy::SupportedAndGeneratedTargets()) {
        hwy::SetSupportedTargetsForTest(target);
        for (const float* const less :
             {static_cast<const float*>(nullptr), static_cast<const float*>(offsets.data())}) {
            const Images& out = results.emplace_back(scaled(row, {weight, factors.data(), less}));
            for (size_t p = 0; p < samples; ++p) {
                const float product = float(weight * double(row[p])) * factors[p];
                EXPECT_EQ(out.aligned[p], less ? product - less[p] : product) << p;
                EXPECT_EQ(out.beside[p + 1], out.aligned[p]) << p;
            }
            EXPECT_EQ(out.aligned[samples], -7) << "beyond the end";
            EXPECT_EQ(out.beside[0], -7) << "before the beginning";
            EXPECT_EQ(out.beside[samples + 1], -7);
        }
    }
    hwy::SetSupportedTargetsForTest(0);
    ASSERT_GT(results.size(), 2u);
}

template <typename Sample>
std::vector<Sample> counts_up_to(int most) {
    std::mt19937 random(5);
    std::vector<Sample> row;
    for (size_t p = 0; p < samples; ++p) row.push_back(Sample(int(random() % unsigned(2 * most + 1)) - most));
    return row;
}

}  // namespace

// 1.275 lies between two floats.
TEST(ScaledRow, is_weight_times_count_times_factor_less_offset) {
    for (const double weight : {3.0, 1.275}) {
        expect_products(counts_up_to<int16_t>(32767), weight);
        expect_products(counts_up_to<int32_t>((1 << 23) - 1), weight);
        expect_products(counts_up_to<float>(1000), weight);
    }
}

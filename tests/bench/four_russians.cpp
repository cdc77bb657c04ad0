// SPDX-License-Identifier: MIT
// Tables of 32 samples by 256 sums, 16 KB, stay in the nearest cache while all lamps take their sums from them.
#include "four_russians.hpp"

#include <vector>

namespace ols {

namespace {

constexpr size_t at_once = 32;
constexpr int group_rows = 8, table_sums = 1 << group_rows;
typedef int16_t Sums __attribute__((vector_size(at_once * sizeof(int16_t)), aligned(sizeof(int16_t)), may_alias));
typedef float Floats __attribute__((vector_size(at_once * sizeof(float)), aligned(sizeof(float)), may_alias));

// table[bits]: the sum of the group's rows, minus where the bit is set.
__attribute__((always_inline)) inline void fill_table(const Sums* rows, int count, Sums* table) {
    table[0] = Sums{};
    for (int r = 0; r < count; ++r) table[0] += rows[r];
    for (int r = 0; r < count; ++r) {
        const Sums twice = rows[r] + rows[r];
        for (int bits = 0; bits < 1 << r; ++bits) table[bits | 1 << r] = table[bits] - twice;
    }
}

#if defined(__x86_64__)
__attribute__((target_clones("arch=x86-64-v4", "arch=x86-64-v3", "default")))
#endif
void invert_samples(std::span<int16_t* const> rows, size_t begin, const std::vector<uint8_t>& patterns, float scale, std::span<float* const> lamps) {
    Sums table[table_sums], group[group_rows];
    std::vector<int16_t> values(lamps.size() * at_once);
    Sums* const sums = reinterpret_cast<Sums*>(values.data());
    const uint8_t* pattern = patterns.data();
    for (size_t first = 0; first < rows.size(); first += group_rows) {
        const int count = int(std::min<size_t>(group_rows, rows.size() - first));
        for (int r = 0; r < count; ++r) __builtin_memcpy(&group[r], rows[first + size_t(r)] + begin, sizeof(Sums));
        fill_table(group, count, table);
        for (size_t i = 0; i < lamps.size(); ++i) sums[i] += table[*pattern++];
    }
    for (size_t i = 0; i < lamps.size(); ++i)
        *reinterpret_cast<Floats*>(lamps[i] + begin) = __builtin_convertvector(sums[i], Floats) * scale;
}

}  // namespace

void invert_by_four_russians(const Basis& basis, std::span<int16_t* const> rows, size_t samples,
                             std::span<float* const> lamps) {
    std::vector<uint8_t> patterns;  // [group][lamp]
    for (int first = 0; first < basis.rows; first += group_rows)
        for (int i = 0; i < basis.images(); ++i) {
            patterns.push_back(0);
            for (int r = first; r < std::min(first + group_rows, basis.rows); ++r)
                patterns.back() |= uint8_t((basis.weight(r, i) < 0) << (r - first));
        }
    for (size_t begin = 0; begin < samples; begin += at_once)
        invert_samples(rows, begin, patterns, float(basis.scale), lamps);
}

}  // namespace ols

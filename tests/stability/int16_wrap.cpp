// SPDX-License-Identifier: MIT
// Sums of 156 samples leave int16 at 420 counts a lamp and wrap in silence; the inversion notices and is exact.
// links: ols_demultiplex
#include <algorithm>
#include <array>
#include <cstdint>
#include <cstdlib>
#include <vector>

#include "demultiplex/demultiplex.hpp"
#include "hard_case.hpp"

using namespace ols;

namespace {

// Around what int16, 12 bits and 16 bits hold, of both signs.
constexpr std::array corners = {-65535, -32769, -32768, -32767, -4096, -420, -1, 0, 1, 420, 4095, 32767, 32768, 65535};

// Sample (lamp, corner) has in each row the corner value with the sign of the lamp's weight, so that the lamp's sum
// reaches as far as any can; one more sample a corner has it in every row.
std::vector<std::vector<int32_t>> corner_rows(const Basis& basis) {
    std::vector<std::vector<int32_t>> rows(basis.rows);
    for (int r = 0; r < basis.rows; ++r)
        for (const int corner : corners) {
            for (int i = 0; i < basis.lamps; ++i) rows[r].push_back(basis.weight(r, i) < 0 ? -corner : corner);
            rows[r].push_back(corner);
        }
    return rows;
}

struct Errors {
    double naive = 0, ours = 0;  // largest, counts of a lamp
};

Errors errors_at_corners(const Basis& basis) {
    const auto rows = corner_rows(basis);
    const size_t samples = rows[0].size();
    // The gain takes the scale out again, so that floats hold the integer sums themselves.
    const std::vector<float> gain(samples, float(1 / basis.scale));
    std::vector<std::vector<float>> lamps(basis.lamps, std::vector<float>(samples));
    std::vector<const int32_t*> in;
    std::vector<float*> out;
    for (const auto& row : rows) in.push_back(row.data());
    for (auto& lamp : lamps) out.push_back(lamp.data());
    demultiplex(basis, in, samples, out, {gain, 1});

    Errors errors;
    for (int i = 0; i < basis.lamps; ++i)
        for (size_t p = 0; p < samples; ++p) {
            int64_t exact = 0;
            uint16_t wrapped = 0;  // unsigned, whose wrap-around C++ defines
            for (int r = 0; r < basis.rows; ++r) {
                exact += int64_t(basis.weight(r, i)) * rows[r][p];
                wrapped = uint16_t(wrapped + basis.weight(r, i) * rows[r][p]);
            }
            errors.naive = std::max(errors.naive, std::abs(double(int16_t(wrapped)) - double(exact)) * basis.scale);
            errors.ours = std::max(errors.ours, std::abs(double(lamps[i][p]) - double(exact)) * basis.scale);
        }
    return errors;
}

}  // namespace

// Bound: 0. A lamp's weights sum to at most 232 in magnitude, so that its sum stays below 232 * 65535 < 2^24: exact in
// int32, and as a float.
TEST(Int16Wrap, at_every_corner_value_in_s159) {
    const Errors errors = errors_at_corners(*find_basis("s159"));
    expect_within("int16 wraps, samples at every corner value, s159", errors.naive, errors.ours, 0, "counts");
}

TEST(Int16Wrap, at_every_corner_value_in_hadamard156) {
    const Errors errors = errors_at_corners(*find_basis("hadamard156"));
    expect_within("int16 wraps, samples at every corner value, hadamard156", errors.naive, errors.ours, 0, "counts");
}

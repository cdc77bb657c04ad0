// SPDX-License-Identifier: MIT
// The steps of the two constructions of stage/basis.cpp, and the proof that they are what a basis asks for.
#include "demultiplex/hadamard_plan.hpp"

#include "stage/hadamard.hpp"

namespace ols {

namespace {

// S-159: H of order 160 is [P P; P -P], so that H' y is P' u and P' v for the sums u and the differences v of the upper
// and the lower half of y. The first row of H, which is no slot, counts as zero: row 79 is left alone. A lamp is lit
// where H is negative, so the outputs are those of -H'.
HadamardPlan steps_of_s159(int lamps) {
    constexpr int half = 80;
    HadamardPlan made;
    made.order = 2 * half;
    made.singles.push_back({half - 1, 0, half});
    for (int r = 1; r < half; ++r) made.pairs.push_back({r - 1, r + half - 1, r, half + r});
    made.steps = {{Codelet::paley_80, 0, 2 * half}, {Codelet::paley_80, half, 0}};  // u has been used by then
    made.places = 3 * half;
    for (int k = 1; k < made.order; ++k) made.outputs.push_back(k < half ? 2 * half + k : k - half);
    for (int lamp = 0; lamp < lamps; ++lamp) made.lamp_output.push_back(lamp + 1);
    return made;
}

// Hadamard-156: the blocks of Williamson's array are split into even and odd parts. Where the signs that normalise rows j
// and 39 - j differ, the sum of the two is the odd part.
HadamardPlan steps_of_hadamard156() {
    constexpr int m = 39, half = m / 2, blocks = 4, parts = blocks * (half + 1);
    Signs h = williamson_156();
    const Normalisation signs = normalise(h);
    HadamardPlan made;
    made.order = blocks * m;
    for (int b = 0; b < blocks; ++b) {
        const int even = b * (half + 1), odd = parts + even;
        made.singles.push_back({b * m, even, odd});
        for (int j = 1; j <= half; ++j) {
            const int first = b * m + j, second = b * m + m - j;
            const bool same = signs.rows[size_t(first)] == signs.rows[size_t(second)];
            made.pairs.push_back({first, second, (same ? even : odd) + j, (same ? odd : even) + j});
        }
    }
    made.places = 2 * parts + made.order - 1;
    made.steps = {{Codelet::williamson_even, 0, 2 * parts},
                  {Codelet::williamson_odd, parts, 3 * parts - 1},  // behind the 79 even sums
                  {Codelet::williamson_merge, 2 * parts, 0}};
    for (int k = 1; k < made.order; ++k) made.outputs.push_back(k - 1);
    for (int lamp = 0; lamp < made.order; ++lamp) made.lamp_output.push_back(lamp);
    made.extra_weight = -made.order / 2;  // to the weight of row 0 for lamp 0
    return made;
}

SumPlan whole_plan(const HadamardPlan& made) {
    SumPlan whole(made.rows);
    std::vector<int> values(size_t(made.places), 0);
    for (const auto& single : made.singles) {
        values[size_t(single.place)] = single.row;
        values[size_t(single.negated)] = whole.sum({{single.row, -1}});
    }
    for (const auto& pair : made.pairs) {
        values[size_t(pair.sum)] = whole.sum({{pair.first, 1}, {pair.second, 1}});
        values[size_t(pair.difference)] = whole.sum({{pair.first, 1}, {pair.second, -1}});
    }
    for (const auto& step : made.steps) {
        const SumPlan& part = codelet_plan(step.codelet);
        const auto from = values.begin() + step.from;
        const std::vector<int> outputs = whole.append(part, {from, from + part.inputs()});
        std::copy(outputs.begin(), outputs.end(), values.begin() + step.to);
    }
    for (const int place : made.outputs) whole.add_output(values[size_t(place)]);
    return whole;
}

// What the plan computes is what the basis asks for.
bool matches(const HadamardPlan& made, const Basis& basis) {
    if (basis.rows != made.rows || basis.images() != int(made.lamp_output.size()) || !basis.has_integers())
        return false;
    const auto outputs = made.whole.matrix();
    for (int lamp = 0; lamp < basis.images(); ++lamp)
        for (int row = 0; row < basis.rows; ++row) {
            const int output = made.lamp_output[size_t(lamp)];
            const int weight = output > 0 ? outputs[size_t(output - 1)][size_t(row)]
                                          : 1 + (row == made.extra_row ? made.extra_weight : 0);
            if (weight != basis.weight(row, lamp)) return false;
        }
    return true;
}

}  // namespace

std::optional<HadamardPlan> hadamard_plan(const Basis& basis) {
    HadamardPlan made;
    if (basis.name == "s159")
        made = steps_of_s159(basis.images());
    else if (basis.name == "hadamard156")
        made = steps_of_hadamard156();
    else
        return std::nullopt;
    made.rows = int(2 * made.pairs.size() + made.singles.size());
    made.whole = whole_plan(made);
    if (!matches(made, basis)) return std::nullopt;
    made.code = lay_out(made.whole, {made.extra_row});
    return made;
}

}  // namespace ols

// SPDX-License-Identifier: MIT
// Plans for the two constructions of stage/basis.cpp. Both matrices are made of circulants C(i, j) = c(j - i) modulo an
// odd m whose first row is even, c(-k) = c(k), or odd. Such a circulant, applied to the even part e(j) = y(j) + y(-j) and
// the odd part o(j) = y(j) - y(-j), has entries c(j - i) + c(j + i) and c(j - i) - c(j + i), which are 0 or +-2: half of
// the additions are gone, and the factor of two cancels that of the split.
#include "reflectance/hadamard_plan.hpp"

#include "stage/hadamard.hpp"

namespace ols {

namespace {

// The even and odd parts of the inputs value[0..m-1] (numbers and signs), m odd: whole[0] and m / 2 of each.
struct Parts {
    Term centre;
    std::vector<int> even, odd;  // even[j - 1], odd[j - 1] for j = 1..m/2
};

Parts split(SumPlan& plan, const Terms& values) {
    const int m = int(values.size());
    Parts parts{values[0], {}, {}};
    for (int j = 1; j <= m / 2; ++j) {
        const Term a = values[j], b = values[m - j];
        parts.even.push_back(plan.sum({a, b}));
        parts.odd.push_back(plan.sum({a, {b.value, -b.sign}}));
    }
    return parts;
}

void append(Terms& terms, int value, int sign) {
    if (sign != 0) terms.push_back({value, sign});
}

int legendre(int a, int q) {
    a = ((a % q) + q) % q;
    if (a == 0) return 0;
    for (int i = 1; i <= q / 2; ++i)
        if (i * i % q == a) return 1;
    return -1;
}

// -P' u for the normalised Paley matrix of order q + 1 = 80 (stage/basis.cpp), without its first output, which is the sum
// of all: output j is -u(0) + u(j + 1) + sum over i of chi(i - j) u(i + 1). chi is odd, so that even parts give odd
// outputs and odd parts even ones; chi(0) = 0 leaves one of u(j + 1), u(-j + 1) over, which joins u(j + 1) to a part.
std::vector<int> transform_paley(SumPlan& plan, const std::vector<int>& u, const Parts& parts) {
    const int q = int(u.size()) - 1, half = q / 2;
    const auto chi = [q](int a) { return legendre(a, q); };
    std::vector<Terms> odd_rows, even_rows;  // outputs j = 1.. and 0.., without what chi(0) leaves over
    for (int j = 0; j <= half; ++j) {
        Terms odd_row, even_row = {{u[0], -1}};
        append(odd_row, parts.centre.value, chi(-j));
        for (int i = 1; i <= half; ++i) {
            if (i == j) continue;
            append(odd_row, parts.even[i - 1], (chi(i - j) + chi(-i - j)) / 2);
            append(even_row, parts.odd[i - 1], (chi(i - j) - chi(-i - j)) / 2);
        }
        if (j > 0) odd_rows.push_back(odd_row);
        even_rows.push_back(even_row);
    }
    const std::vector<int> odd = plan.sums(odd_rows), even = plan.sums(even_rows);

    std::vector<int> outputs(q);
    outputs[0] = plan.sum({{even[0], 1}, {u[1], 1}});
    for (int j = 1; j <= half; ++j) {
        const Term even_part = {parts.even[j - 1], 1};
        const int odd_part = parts.odd[j - 1];
        const bool square = chi(-2 * j) > 0;
        outputs[j] = plan.sum({{even[j], 1}, {odd[j - 1], 1}, square ? even_part : Term{odd_part, 1}});
        outputs[q - j] = plan.sum({{even[j], 1}, {odd[j - 1], -1}, square ? Term{odd_part, -1} : even_part});
    }
    return outputs;
}

Parts split_all_but_first(SumPlan& plan, const std::vector<int>& u) {
    Terms values;
    for (size_t i = 1; i < u.size(); ++i) values.push_back({u[i], 1});
    return split(plan, values);
}

// S-159: H of order 160 is [P P; P -P], and its first row, which is no slot, counts as zero. A lamp is lit where H is
// negative, so the outputs are those of -H'.
HadamardPlan plan_s159(const Basis& basis) {
    constexpr int half = 80;
    HadamardPlan made;
    SumPlan plan(basis.rows);
    std::vector<int> u(half), v(half);
    u[0] = half - 1;  // row 80 of H, whose partner is row 0
    v[0] = plan.sum({{half - 1, -1}});
    for (int r = 1; r < half; ++r) {
        u[size_t(r)] = plan.sum({{r - 1, 1}, {r + half - 1, 1}});
        v[size_t(r)] = plan.sum({{r - 1, 1}, {r + half - 1, -1}});
    }
    for (const int output : transform_paley(plan, u, split_all_but_first(plan, u))) plan.add_output(output);
    const Parts parts = split_all_but_first(plan, v);
    Terms sum_of_all = {{v[0], -1}, {parts.centre.value, -1}};
    for (const int even_part : parts.even) sum_of_all.push_back({even_part, -1});
    plan.add_output(plan.sum(sum_of_all));
    for (const int output : transform_paley(plan, v, parts)) plan.add_output(output);
    for (int lamp = 0; lamp < basis.images(); ++lamp) made.lamp_output.push_back(lamp);
    made.plan = std::move(plan);
    made.order = 2 * half;
    return made;
}

// Hadamard-156: Williamson's array W of symmetric circulants of order 39. H is W with the signs of rows and columns that
// normalise it, so z(c) = column_sign(c) times the sum over r of W(r, c) row_sign(r) y(r).
HadamardPlan plan_hadamard156(const Basis& basis) {
    constexpr int m = 39, half = m / 2, blocks = 4;
    const Signs w = williamson_156();
    Signs normalised = w;
    const Normalisation signs = normalise(normalised);
    HadamardPlan made;
    made.plan = SumPlan(basis.rows);
    made.order = blocks * m;
    std::vector<Parts> parts;
    for (int b = 0; b < blocks; ++b) {
        Terms rows;
        for (int j = 0; j < m; ++j) rows.push_back({b * m + j, signs.rows[size_t(b * m + j)]});
        parts.push_back(split(made.plan, rows));
    }
    // Outputs i = 0..19 of each block, from the even parts, and 1..19, from the odd ones.
    std::vector<Terms> even_rows, odd_rows;
    for (int column_block = 0; column_block < blocks; ++column_block)
        for (int i = 0; i <= half; ++i) {
            const int column = column_block * m + i;
            Terms even_row, odd_row;
            for (int b = 0; b < blocks; ++b) {
                append(even_row, parts[b].centre.value, parts[b].centre.sign * w.at(b * m, column));
                for (int j = 1; j <= half; ++j) {
                    const int at = w.at(b * m + j, column), mirrored = w.at(b * m + m - j, column);
                    append(even_row, parts[b].even[j - 1], (at + mirrored) / 2);
                    append(odd_row, parts[b].odd[j - 1], (at - mirrored) / 2);
                }
            }
            if (column > 0) even_rows.push_back(even_row);  // column 0 is the sum of all rows
            if (i > 0) odd_rows.push_back(odd_row);
        }
    const std::vector<int> even = made.plan.sums(even_rows), odd = made.plan.sums(odd_rows);
    for (int column = 1; column < blocks * m; ++column) {
        const int b = column / m, i = column % m, nearest = i <= half ? i : m - i, sign = signs.columns[size_t(column)];
        Terms terms = {{even[size_t(b * (half + 1) + nearest - 1)], sign}};
        if (i > 0) terms.push_back({odd[size_t(b * half + nearest - 1)], i <= half ? sign : -sign});
        made.plan.add_output(made.plan.sum(terms));
    }
    for (int lamp = 0; lamp < basis.images(); ++lamp) made.lamp_output.push_back(lamp - 1);
    made.extra_weight = -made.order / 2;  // to the weight of row 0 for lamp 0
    return made;
}

// What the plan computes is what the basis asks for.
bool matches(const HadamardPlan& made, const Basis& basis) {
    const auto outputs = made.plan.matrix();
    for (int lamp = 0; lamp < basis.images(); ++lamp)
        for (int row = 0; row < basis.rows; ++row) {
            const int output = made.lamp_output[size_t(lamp)];
            const int weight = output >= 0 ? outputs[size_t(output)][size_t(row)]
                                           : 1 + (row == made.extra_row ? made.extra_weight : 0);
            if (weight != basis.weight(row, lamp)) return false;
        }
    return true;
}

}  // namespace

std::optional<HadamardPlan> hadamard_plan(const Basis& basis) {
    std::optional<HadamardPlan> made;
    if (basis.name == "s159") made = plan_s159(basis);
    if (basis.name == "hadamard156") made = plan_hadamard156(basis);
    if (made && !matches(*made, basis)) made.reset();
    return made;
}

}  // namespace ols

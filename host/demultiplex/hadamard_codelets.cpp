// SPDX-License-Identifier: MIT
// Plans for the parts of the two constructions of stage/basis.cpp. Both matrices are made of circulants C(i, j) = c(j - i)
// modulo an odd m whose first row is even, c(-k) = c(k), or odd. Such a circulant, applied to the even part
// e(j) = y(j) + y(-j) and the odd part o(j) = y(j) - y(-j), has entries c(j - i) + c(j + i) and c(j - i) - c(j + i), which
// are 0 or +-2: half of the additions are gone, and the factor of two cancels that of the split.
#include "demultiplex/hadamard_codelets.hpp"

#include "stage/hadamard.hpp"

namespace ols {

namespace {

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

// Output 0 is -(sum of all u). Output j + 1 is -u(0) + u(j + 1) + sum over i of chi(i - j) u(i + 1). chi is odd, so that
// even parts give odd outputs and odd parts even ones; chi(0) = 0 leaves one of u(j + 1), u(-j + 1) over, which joins
// u(j + 1) to a part.
SumPlan paley_plan(int q) {
    const int half = q / 2;
    SumPlan plan(q + 1);
    std::vector<int> even_parts(size_t(half) + 1), odd_parts(size_t(half) + 1);  // from 1
    Terms sum_of_all = {{0, -1}, {1, -1}};
    for (int j = 1; j <= half; ++j) {
        even_parts[size_t(j)] = plan.sum({{1 + j, 1}, {1 + q - j, 1}});
        odd_parts[size_t(j)] = plan.sum({{1 + j, 1}, {1 + q - j, -1}});
        sum_of_all.push_back({even_parts[size_t(j)], -1});
    }
    std::vector<Terms> odd_rows, even_rows;  // outputs j = 1.. and 0.., without what chi(0) leaves over
    for (int j = 0; j <= half; ++j) {
        Terms odd_row, even_row = {{0, -1}};
        append(odd_row, 1, legendre(-j, q));
        for (int i = 1; i <= half; ++i) {
            if (i == j) continue;
            const int ahead = legendre(i - j, q), behind = legendre(-i - j, q);
            append(odd_row, even_parts[size_t(i)], (ahead + behind) / 2);
            append(even_row, odd_parts[size_t(i)], (ahead - behind) / 2);
        }
        if (j > 0) odd_rows.push_back(odd_row);
        even_rows.push_back(even_row);
    }
    const std::vector<int> odd = plan.sums(odd_rows), even = plan.sums(even_rows);

    std::vector<int> outputs(size_t(q) + 1);
    outputs[0] = plan.sum(sum_of_all);
    outputs[1] = plan.sum({{even[0], 1}, {1, 1}});
    for (int j = 1; j <= half; ++j) {
        const Term even_part = {even_parts[size_t(j)], 1};
        const int odd_part = odd_parts[size_t(j)], even_sum = even[size_t(j)], odd_sum = odd[size_t(j) - 1];
        const bool square = legendre(-2 * j, q) > 0;
        outputs[size_t(1 + j)] = plan.sum({{even_sum, 1}, {odd_sum, 1}, square ? even_part : Term{odd_part, 1}});
        outputs[size_t(1 + q - j)] = plan.sum({{even_sum, 1}, {odd_sum, -1}, square ? Term{odd_part, -1} : even_part});
    }
    for (const int output : outputs) plan.add_output(output);
    return plan;
}

// W is Williamson's array, H is W with the signs of rows and columns that normalise it: z(c) = column_sign(c) times the
// sum over r of W(r, c) row_sign(r) y(r).
constexpr int m = 39, half = m / 2, blocks = 4, parts_of_block = half + 1;

struct Williamson {
    Signs w = williamson_156();
    Normalisation signs;

    Williamson() {
        Signs normalised = w;
        signs = normalise(normalised);
    }
};

SumPlan williamson_plan(bool even) {
    const Williamson h;
    std::vector<Terms> rows;
    for (int column_block = 0; column_block < blocks; ++column_block)
        for (int i = even ? 0 : 1; i <= half; ++i) {
            const int column = column_block * m + i;
            if (column == 0) continue;  // the sum of all rows
            Terms row;
            for (int b = 0; b < blocks; ++b) {
                const int sign = h.signs.rows[size_t(b * m)];
                if (even) append(row, b * parts_of_block, sign * h.w.at(b * m, column));
                for (int j = 1; j <= half; ++j) {
                    const int at = h.w.at(b * m + j, column), mirrored = h.w.at(b * m + m - j, column);
                    append(row, b * parts_of_block + j,
                           h.signs.rows[size_t(b * m + j)] * (at + (even ? mirrored : -mirrored)) / 2);
                }
            }
            rows.push_back(row);
        }
    SumPlan plan(blocks * parts_of_block);
    for (const int output : plan.sums(rows)) plan.add_output(output);
    return plan;
}

SumPlan williamson_merge_plan() {
    constexpr int even_sums = blocks * parts_of_block - 1, odd_sums = blocks * half;
    const Williamson h;
    SumPlan plan(even_sums + odd_sums);
    for (int column = 1; column < blocks * m; ++column) {
        const int b = column / m, i = column % m, nearest = i <= half ? i : m - i;
        const int sign = h.signs.columns[size_t(column)];
        Terms terms = {{b * parts_of_block + nearest - 1, sign}};
        if (i > 0) terms.push_back({even_sums + b * half + nearest - 1, i <= half ? sign : -sign});
        plan.add_output(plan.sum(terms));
    }
    return plan;
}

}  // namespace

const char* codelet_name(Codelet codelet) {
    constexpr const char* names[] = {"paley_80", "williamson_even", "williamson_odd", "williamson_merge"};
    return names[size_t(codelet)];
}

const SumPlan& codelet_plan(Codelet codelet) {
    static const SumPlan plans[] = {paley_plan(79), williamson_plan(true), williamson_plan(false),
                                    williamson_merge_plan()};
    return plans[size_t(codelet)];
}

}  // namespace ols

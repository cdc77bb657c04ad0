// SPDX-License-Identifier: MIT
// Hadamard matrices by construction. H is Hadamard of order n when its entries are +1 and -1 and H H' = n I.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

namespace ols {

// A square matrix of +1 and -1.
struct Signs {
    int n = 0;
    std::vector<int8_t> signs;

    explicit Signs(int order) : n(order), signs(size_t(order) * order, 1) {}
    int8_t& at(int row, int column) { return signs[size_t(row) * n + column]; }
    int at(int row, int column) const { return signs[size_t(row) * n + column]; }
};

// What normalise multiplied rows and columns by, +1 or -1 each.
struct Normalisation {
    std::vector<int8_t> rows, columns;
};

// Negates columns, then rows, until the first row and the first column are all +1; H H' = n I stays.
Normalisation normalise(Signs& h);

// Paley's first construction, order q + 1 for a prime q = 3 mod 4, normalised: H = I + [0 1; -1 Q] with Q(i, j) = +1 when
// i - j is a square modulo q, -1 when it is not, 0 on the diagonal (R. Paley, "On orthogonal matrices", 1933).
Signs paley(int q);

// [H H; H -H], of twice the order; normalised when H is.
Signs sylvester_double(const Signs& h);

// Williamson's array [A B C D; -B A -D C; -C D A -B; -D -C B A] of four symmetric circulants of order 39, order 156; not
// normalised.
Signs williamson_156();

}  // namespace ols

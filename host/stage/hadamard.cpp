// SPDX-License-Identifier: MIT
// The constructions of Paley, Sylvester and Williamson.
#include "stage/hadamard.hpp"

#include <string_view>

namespace ols {

Normalisation normalise(Signs& h) {
    Normalisation signs{std::vector<int8_t>(size_t(h.n), 1), std::vector<int8_t>(size_t(h.n), 1)};
    for (int c = 0; c < h.n; ++c) {
        if (h.at(0, c) > 0) continue;
        signs.columns[size_t(c)] = -1;
        for (int r = 0; r < h.n; ++r) h.at(r, c) = int8_t(-h.at(r, c));
    }
    for (int r = 0; r < h.n; ++r) {
        if (h.at(r, 0) > 0) continue;
        signs.rows[size_t(r)] = -1;
        for (int c = 0; c < h.n; ++c) h.at(r, c) = int8_t(-h.at(r, c));
    }
    return signs;
}

Signs paley(int q) {
    std::vector<bool> square(size_t(q), false);
    for (int i = 1; i < q; ++i) square[size_t(i) * i % q] = true;
    Signs h(q + 1);
    for (int i = 0; i < q; ++i) {
        h.at(i + 1, 0) = -1;
        for (int j = 0; j < q; ++j) h.at(i + 1, j + 1) = i == j || square[(i - j + q) % q] ? 1 : -1;
    }
    normalise(h);
    return h;
}

Signs sylvester_double(const Signs& h) {
    Signs doubled(2 * h.n);
    for (int r = 0; r < doubled.n; ++r)
        for (int c = 0; c < doubled.n; ++c)
            doubled.at(r, c) = int8_t(h.at(r % h.n, c % h.n) * (r >= h.n && c >= h.n ? -1 : 1));
    return doubled;
}

Signs williamson_156() {
    // A half-row holds elements 0..19 of a circulant's first row; symmetry gives the rest: a(k) = a(39 - k).
    constexpr int order = 39;
    constexpr std::string_view half_rows[4] = {"+-+-++-+--+--++-----", "+-+-++----+++--++---", "++---+-++++---+---+-",
                                               "+-+++-++------+--+-+"};
    constexpr int block[4][4] = {{0, 1, 2, 3}, {1, 0, 3, 2}, {2, 3, 0, 1}, {3, 2, 1, 0}};
    constexpr int sign[4][4] = {{1, 1, 1, 1}, {-1, 1, -1, 1}, {-1, 1, 1, -1}, {-1, -1, 1, 1}};
    Signs h(4 * order);
    for (int r = 0; r < h.n; ++r)
        for (int c = 0; c < h.n; ++c) {
            const int k = (c % order - r % order + order) % order;
            const char element = half_rows[block[r / order][c / order]][k < 20 ? k : order - k];
            h.at(r, c) = int8_t(sign[r / order][c / order] * (element == '+' ? 1 : -1));
        }
    return h;
}

}  // namespace ols

// SPDX-License-Identifier: MIT
// Lighting bases: which lamps are on in which basis row, and how the rows are inverted to single lamps.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "result.hpp"
#include "stage/lamps.hpp"

namespace ols {

// A 0/1 matrix of rows (patterns) over lamps. Inversion: lamp i = scale * sum over rows of weight(row, i) * row image,
// with small integer weights, so that integer counts invert exactly and are scaled once.
struct Basis {
    std::string name;
    int rows = 0, lamps = 0;
    std::vector<uint8_t> on;      // rows x lamps, 0 or 1
    std::vector<int8_t> weights;  // rows x lamps, the integer inversion weights
    double scale = 1;

    bool lit(int row, int lamp) const { return on[size_t(row) * lamps + lamp] != 0; }
    int weight(int row, int lamp) const { return weights[size_t(row) * lamps + lamp]; }
};

// Variance of a recovered lamp when every row image has independent noise of variance 1 (a single lamp a row: 1).
double noise_variance(const Basis& basis, int lamp);

// The names that find_basis knows, for help texts.
std::vector<std::string> basis_names();

// single        one lamp a row (Wenger 5.1)
// s159          159 rows: Sylvester doubling of the Paley-80 Hadamard matrix, first row and three more columns dropped
// hadamard156   156 rows: (J + H)/2 of the normalised Williamson Hadamard matrix of order 156 (Wenger 5.3)
// The error names the bases there are.
Result<Basis> find_basis(const std::string& name);

}  // namespace ols

// SPDX-License-Identifier: MIT
// Lighting bases: how bright each lamp is in each basis row, and how the rows are inverted to images of single lamps.
// To add one: a line in basis_kinds() and its rows in find_basis() (basis.cpp), or a file (basis_file.hpp).
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "result.hpp"
#include "stage/lamps.hpp"

namespace ols {

// A matrix of levels of rows (patterns, a slot each) over the lamps of the sphere, with its recommended inversion.
// Recovered image i = sum over rows of inverse(row, i) * row image; it shows the lamps of `image_lamps[i]`, their mean.
struct Basis {
    std::string name;
    int rows = 0, lamps = 0;
    int level_max = 1;            // 1: on or off; 2^planes - 1: grey
    std::vector<uint8_t> levels;  // rows x lamps, 0 to level_max: the lamp gives level / level_max of its light

    std::vector<std::vector<int>> image_lamps;

    // The inversion as small integers times one scale, so that integer counts invert exactly and are scaled once ...
    std::vector<int8_t> weights;  // rows x images; empty where there are none
    double scale = 1;
    // ... or as it comes; empty where there are integers.
    std::vector<double> matrix;  // rows x images

    // Rank of the levels below the number of images: the images are the shortest that explain the rows, an estimate.
    bool is_estimate = false;

    int images() const { return int(image_lamps.size()); }
    bool has_integers() const { return !weights.empty(); }
    int level(int row, int lamp) const { return levels[size_t(row) * size_t(lamps) + size_t(lamp)]; }
    double light(int row, int lamp) const { return double(level(row, lamp)) / level_max; }
    bool lit(int row, int lamp) const { return level(row, lamp) > 0; }
    int weight(int row, int image) const { return weights[size_t(row) * size_t(images()) + size_t(image)]; }
    double inverse(int row, int image) const {
        return has_integers() ? scale * weight(row, image) : matrix[size_t(row) * size_t(images()) + size_t(image)];
    }
};

// Variance of a recovered image when every row image has independent noise of variance 1 (a single lamp a row: 1).
double noise_variance(const Basis& basis, int image);

// The light that each recovered image stands for: a lamp itself, or the mean direction of several, named by all of them.
std::vector<LightPosition> image_lights(const Basis& basis, const std::vector<LightPosition>& lamps);

// A line a basis, for help texts: its name and what it is.
struct BasisKind {
    std::string name, meaning;
};
const std::vector<BasisKind>& basis_kinds();

// The error lists the bases there are.
Status check_basis_name(const std::string& name);

// `name` is one of basis_kinds() or the path of a basis file (stage/basis_file.hpp; it ends with .csv). `lamps` are
// those of the sphere (without them, the 156 of Wenger's stage). Errors: those of check_basis_name(), and what this basis needs of the lamps.
Result<Basis> find_basis(const std::string& name, const std::vector<LightPosition>& lamps = named_lamps());

}  // namespace ols

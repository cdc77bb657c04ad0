// SPDX-License-Identifier: MIT
// A picture in closed form: a matte bumpy sheet with shadows under each lamp, the rows of a basis of it with the camera's noise, and faults of rows.
#pragma once

#include <algorithm>
#include <cmath>
#include <random>
#include <vector>

#include "develop/parity_samples.hpp"
#include "stage/basis.hpp"

namespace ols {

class LitPicture {
  public:
    static constexpr int width = 80, height = 60;
    static constexpr size_t pixels = size_t(width) * height;

    // `counts`: of a lamp in front of the sheet.
    LitPicture(const std::string& basis_name, double counts) : basis(*find_basis(basis_name)) {
        const auto lights = named_lamps();
        lamps.assign(size_t(basis.lamps), std::vector<double>(pixels));
        for (int lamp = 0; lamp < basis.lamps; ++lamp)
            for (size_t p = 0; p < pixels; ++p) {
                const double x = double(p % width), y = double(p / width);
                const Vec3 normal = normalized({std::sin(x / 9) + (x - 40) / 40, std::cos(y / 7) + (y - 30) / 40, 1.2});
                const double albedo = 0.6 + 0.4 * std::sin(x / 3.1) * std::cos(y / 4.3);
                const Vec3& light = lights[size_t(lamp)].direction;
                // What stands in its way: shadows that pass over the sheet as lamps change.
                const double shadow = 0.65 + 0.35 * std::sin(0.5 * (x * light.x + y * light.y) + 9 * light.z);
                lamps[size_t(lamp)][p] = counts * albedo * shadow * std::max(0.0, dot(normal, light));
            }
    }

    // `factor`: of each lamp's light, in all rows.
    std::vector<double> row(int number, const std::vector<double>& factor = {}) const {
        std::vector<double> sums(pixels);
        for (int lamp = 0; lamp < basis.lamps; ++lamp) {
            const double light = basis.light(number, lamp) * (factor.empty() ? 1 : factor[size_t(lamp)]);
            for (size_t p = 0; light > 0 && p < pixels; ++p) sums[p] += light * lamps[size_t(lamp)][p];
        }
        return sums;
    }
    std::vector<std::vector<double>> rows(const std::vector<double>& factor = {}) const {
        std::vector<std::vector<double>> all;
        for (int number = 0; number < basis.rows; ++number) all.push_back(row(number, factor));
        return all;
    }

    // Exposed: with the noise that the witness expects, of each pixel the same in all rows, and whole counts.
    static std::vector<std::vector<double>> exposed(std::vector<std::vector<double>> rows, unsigned seed) {
        std::mt19937 random(seed);
        std::normal_distribution<double> normal;
        for (size_t p = 0; p < pixels; ++p) {
            double mean = 0;
            for (const auto& one : rows) mean += one[p] / double(rows.size());
            const double sigma = noise().read_counts + noise().shot * std::sqrt(mean);
            for (auto& one : rows) one[p] = std::round(one[p] + sigma * normal(random));
        }
        return rows;
    }

    // The pixel rows from `first` on, of `share` of the picture, change places between two rows.
    static void swap(std::vector<std::vector<double>>& rows, int i, int j, double share = 1) {
        const auto count = ptrdiff_t(share * height) * width;
        std::swap_ranges(rows[size_t(i)].begin(), rows[size_t(i)].begin() + count, rows[size_t(j)].begin());
    }

    static NoiseModel noise() { return {}; }

    ParitySamples samples(const std::vector<std::vector<double>>& rows, int step = 1,
                          const std::vector<int>& lost = {}) const {
        ParitySamples taken(step, width, height, 1, basis.rows);
        RowBand<int32_t> band(rows.size(), pixels);
        for (size_t number = 0; number < rows.size(); ++number)
            std::ranges::transform(rows[number], band.row(number), [](double count) { return int32_t(count); });
        taken.gather(band, {0, size_t(height), size_t(width), 0, 1}, noise(), lost);
        return taken;
    }

    const Basis basis;
    std::vector<std::vector<double>> lamps;  // [lamp][pixel], counts
};

}  // namespace ols

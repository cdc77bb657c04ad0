// SPDX-License-Identifier: MIT
// Associated Legendre functions by the recursion upwards in l, which is stable (Press et al., Numerical Recipes, 6.8).
#include "stage/harmonics.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numbers>

namespace ols {

namespace {

// P of degree l and order m >= 0 at x, without the sign (-1)^m.
double legendre(int l, int m, double x) {
    double diagonal = 1;  // P(m, m) = (2 m - 1)!! (1 - x^2)^(m / 2)
    const double sine = std::sqrt(std::max(0.0, 1 - x * x));
    for (int k = 1; k <= m; ++k) diagonal *= (2 * k - 1) * sine;
    if (l == m) return diagonal;
    double before = diagonal, now = (2 * m + 1) * x * diagonal;
    for (int k = m + 2; k <= l; ++k) {
        const double next = ((2 * k - 1) * x * now - (k + m - 1) * before) / (k - m);
        before = now;
        now = next;
    }
    return now;
}

double normalisation(int l, int m) {
    double ratio = 1;  // (l - m)! / (l + m)!
    for (int k = l - m + 1; k <= l + m; ++k) ratio /= k;
    return std::sqrt((2 * l + 1) / (4 * std::numbers::pi) * ratio);
}

void add_parts(const std::vector<double>& values, HarmonicSign sign, int level_max, HarmonicPattern pattern,
               std::vector<HarmonicPattern>& patterns) {
    const std::string name = pattern.name;
    const auto add = [&](const char* part, auto&& share_of) {
        pattern.name = name + part;
        pattern.levels.clear();
        for (const double value : values)
            pattern.levels.push_back(uint8_t(std::lround(share_of(value / pattern.scale) * level_max)));
        const bool is_lit = std::any_of(pattern.levels.begin(), pattern.levels.end(), [](uint8_t v) { return v > 0; });
        if (is_lit) patterns.push_back(pattern);
    };
    if (sign == HarmonicSign::offset) return add("", [](double y) { return (1 + y) / 2; });
    add("+", [](double y) { return std::max(0.0, y); });
    add("-", [](double y) { return std::max(0.0, -y); });
}

}  // namespace

double real_harmonic(int l, int m, const Vec3& direction) {
    const int order = std::abs(m);
    const double polar = normalisation(l, order) * legendre(l, order, direction.y);
    if (m == 0) return polar;
    const double azimuth = std::atan2(direction.x, direction.z);
    return std::numbers::sqrt2 * polar * (m > 0 ? std::cos(order * azimuth) : std::sin(order * azimuth));
}

std::vector<HarmonicPattern> harmonic_patterns(const std::vector<LightPosition>& lamps, int order, HarmonicSign sign,
                                               int level_max) {
    std::vector<HarmonicPattern> patterns;
    for (int l = 0; l <= order; ++l)
        for (int m = -l; m <= l; ++m) {
            std::vector<double> values;
            for (const auto& lamp : lamps) values.push_back(real_harmonic(l, m, lamp.direction));
            double scale = 0;
            for (const double value : values) scale = std::max(scale, std::abs(value));
            if (scale > 0) add_parts(values, sign, level_max, {fmt::format("Y({},{})", l, m), scale, {}}, patterns);
        }
    return patterns;
}

}  // namespace ols

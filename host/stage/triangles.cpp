// SPDX-License-Identifier: MIT
// Triples by distance.
#include "stage/triangles.hpp"

#include <algorithm>
#include <limits>

namespace ols {

namespace {

double longest_edge(const std::vector<Vec3>& lamps) {
    double loneliest = 0;
    for (size_t i = 0; i < lamps.size(); ++i) {
        double nearest = std::numeric_limits<double>::infinity();
        for (size_t j = 0; j < lamps.size(); ++j)
            if (i != j) nearest = std::min(nearest, length(lamps[i] - lamps[j]));
        loneliest = std::max(loneliest, nearest);
    }
    return 1.3 * loneliest;
}

bool points_north(const std::vector<Vec3>& lamps, const Triangle& triangle) {
    double y[3];
    for (size_t k = 0; k < 3; ++k) y[k] = lamps[size_t(triangle[k])].y;
    std::sort(y, y + 3);
    return y[2] - y[1] > y[1] - y[0];
}

}  // namespace

std::vector<Triangle> all_triangles(const std::vector<Vec3>& lamps) {
    const double edge = longest_edge(lamps);
    const auto near = [&](int a, int b) { return length(lamps[size_t(a)] - lamps[size_t(b)]) < edge; };
    const int count = int(lamps.size());
    std::vector<Triangle> triangles;
    for (int a = 0; a < count; ++a)
        for (int b = a + 1; b < count; ++b)
            for (int c = b + 1; near(a, b) && c < count; ++c)
                if (near(a, c) && near(b, c)) triangles.push_back({a, b, c});
    return triangles;
}

std::vector<Triangle> north_triangles(const std::vector<Vec3>& lamps) {
    std::vector<Triangle> triangles = all_triangles(lamps);
    std::erase_if(triangles, [&](const Triangle& t) { return !points_north(lamps, t); });
    return triangles;
}

}  // namespace ols

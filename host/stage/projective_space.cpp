// SPDX-License-Identifier: MIT
// Points by counting, incidence by inner products modulo q.
#include "stage/projective_space.hpp"

#include <cstddef>
#include <numeric>

namespace ols {

std::vector<std::vector<int>> projective_points(int dimension, int q, int most) {
    std::vector<std::vector<int>> points;
    for (int leading = dimension; leading >= 0; --leading) {
        std::vector<int> point(size_t(dimension) + 1, 0);
        point[size_t(leading)] = 1;
        while (int(points.size()) <= most) {
            points.push_back(point);
            int digit = dimension;
            while (digit > leading && ++point[size_t(digit)] == q) point[size_t(digit--)] = 0;
            if (digit == leading) break;
        }
    }
    return points;
}

bool lies_on(const std::vector<int>& point, const std::vector<int>& plane, int q) {
    return std::inner_product(plane.begin(), plane.end(), point.begin(), 0) % q == 0;
}

}  // namespace ols

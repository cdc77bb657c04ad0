// SPDX-License-Identifier: MIT
// A flow field: where each pixel of one image is found in another.
#pragma once

#include <cstddef>
#include <vector>

namespace ols {

// from(x, y) looks like to(x + u, y + v), in pixels. Rows top to bottom.
struct FlowField {
    int width = 0, height = 0;
    std::vector<float> u, v;

    FlowField() = default;
    FlowField(int w, int h) : width(w), height(h), u(size_t(w) * size_t(h)), v(size_t(w) * size_t(h)) {}
    size_t size() const { return u.size(); }
};

}  // namespace ols

// SPDX-License-Identifier: MIT
// Groups of lamps assembled from strips of the target.
#include "lamp_images.hpp"

#include <algorithm>

#include "image/demosaic.hpp"

namespace ols {

namespace {

constexpr size_t group_bytes = size_t(2) << 30;

// Lamps first .. first + images.size() - 1, one or three channels each.
Status read_group(const TargetReader& target, int first, std::vector<Image>& images) {
    const Target& head = target.head();
    const int planes = head.planes(), rows = target.strip_rows();
    for (int y = 0; y < head.height; y += rows) {
        const auto strip = target.read_box({0, y, head.width, std::min(rows, head.height - y)});
        if (!strip) return strip.error();
        for (size_t k = 0; k < images.size(); ++k)
            for (int c = 0; c < planes; ++c) {
                const auto& plane = strip->lamps[(size_t(first) + k) * planes + c];
                float* out = images[k].data.data() + size_t(y) * head.width * planes + c;
                for (size_t p = 0; p < plane.size(); ++p) out[p * planes] = plane[p];
            }
    }
    return Done{};
}

}  // namespace

Status for_each_lamp_image(const TargetReader& target, int lamps,
                           const std::function<Status(int lamp, const Image& rgb)>& visit) {
    const Target& head = target.head();
    const size_t image_bytes = size_t(head.width) * head.height * head.planes() * sizeof(float);
    const int group = int(std::clamp<size_t>(group_bytes / image_bytes, 1, lamps));
    for (int first = 0; first < lamps; first += group) {
        std::vector<Image> images(std::min(group, lamps - first), Image(head.width, head.height, head.planes()));
        if (auto s = read_group(target, first, images); !s) return s;
        for (size_t k = 0; k < images.size(); ++k)
            if (auto s = visit(first + int(k), as_rgb(images[k], head.cfa)); !s) return s;
    }
    return Done{};
}

}  // namespace ols

// SPDX-License-Identifier: MIT
// Groups of lamps assembled from strips of the target.
#include "lamp_images.hpp"

#include <algorithm>

#include "image/demosaic.hpp"

namespace ols {

namespace {

constexpr size_t group_bytes = size_t(2) << 30, strip_bytes = size_t(512) << 20;
constexpr int tile_rows = 64;

// Lamps first .. first + images.size() - 1, one or three channels each.
Status read_group(const ArchiveReader& archive, const TargetEntry& entry, const Target& head, int lamps, int first,
                  std::vector<Image>& images) {
    const int planes = head.planes();
    const size_t row_bytes = size_t(head.width) * lamps * planes * sizeof(float);
    const int rows = int(std::max<size_t>(strip_bytes / row_bytes / tile_rows, 1)) * tile_rows;
    for (int y = 0; y < head.height; y += rows) {
        const auto strip =
            archive.read_box(entry.camera, entry.index, {0, y, head.width, std::min(rows, head.height - y)});
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

Status for_each_lamp_image(const ArchiveReader& archive, const TargetEntry& entry,
                           const std::function<Status(int lamp, const Image& rgb)>& visit) {
    const auto head = archive.read_head(entry.camera, entry.index);
    if (!head) return head.error();
    const int lamps = int(archive.info().lights.size());
    const size_t image_bytes = size_t(head->width) * head->height * head->planes() * sizeof(float);
    const int group = int(std::clamp<size_t>(group_bytes / image_bytes, 1, lamps));
    for (int first = 0; first < lamps; first += group) {
        std::vector<Image> images(std::min(group, lamps - first), Image(head->width, head->height, head->planes()));
        if (auto s = read_group(archive, entry, *head, lamps, first, images); !s) return s;
        for (size_t k = 0; k < images.size(); ++k)
            if (auto s = visit(first + int(k), as_rgb(images[k], head->cfa)); !s) return s;
    }
    return Done{};
}

}  // namespace ols

// SPDX-License-Identifier: MIT
// Masks as labelling and matting programs write them: white, 1 of 255, or alpha.
#include "photographs/subject_mask.hpp"

#include <fmt/format.h>

#include <algorithm>

#include "image/target.hpp"

namespace ols {

namespace {

bool says_something(const Image& alpha) {
    return std::ranges::any_of(alpha.data, [](float a) { return !(a >= 0.999f); });
}

float brightest(const Image& image, size_t pixel) {
    const float* colors = &image.data[pixel * image.channels];
    return *std::max_element(colors, colors + image.channels);
}

}  // namespace

Result<SubjectMask> read_subject_mask(const std::string& path, int width, int height, const PictureOptions& placing) {
    PictureOptions options;
    options.transfer = Transfer::linear;
    options.turn = placing.turn;
    const auto picture = read_picture(path, options);
    if (!picture) return picture.error();
    const Image& image = picture->light;
    if (image.width != width || image.height != height)
        return fail(fmt::format("mask '{}' is {} x {}, the pictures are {} x {}", path, image.width, image.height,
                                width, height));
    SubjectMask mask;
    const bool by_alpha = picture->alpha && says_something(*picture->alpha);
    const bool by_ones = !by_alpha && picture->largest_code == 1 && picture->last_code > 1;
    if (by_alpha) mask.said.push_back(fmt::format("mask '{}': its alpha says what is inside, not its colours", path));
    if (by_ones)
        mask.said.push_back(
            fmt::format("mask '{}': its largest value is 1 of {:g}, so that all that is not 0 is inside", path,
                        picture->last_code));
    mask.bits.resize(size_t(width) * height);
    size_t inside = 0;
    for (size_t p = 0; p < mask.bits.size(); ++p) {
        const float value = by_alpha ? picture->alpha->data[p] : brightest(image, p);
        const bool is_inside = by_ones ? value > 0 : value >= 0.5f;
        if (!is_inside) mask.bits[p] = mask_outside;
        inside += is_inside;
    }
    if (inside == 0)
        mask.said.push_back(
            fmt::format("warning: nothing is inside mask '{}': {}", path,
                        by_alpha ? "its alpha stays below one half" : "it stays below one half of full scale"));
    return mask;
}

}  // namespace ols

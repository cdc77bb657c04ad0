// SPDX-License-Identifier: MIT
// Matrices in double, applied pixel by pixel.
#include "image/primaries.hpp"

#include <cmath>
#include <opencv2/core.hpp>

namespace ols {

namespace {

// Cone responses of Lam, "Metamerism and Colour Constancy" (1985), as ICC.1 annex E.3 prints them.
const cv::Matx33d bradford(0.8951, 0.2664, -0.1614, -0.7502, 1.7135, 0.0367, 0.0389, -0.0685, 1.0296);

cv::Vec3d xyz_of(Chromaticity c) {
    return {c.x / c.y, 1, (1 - c.x - c.y) / c.y};
}

bool is_white(Chromaticity c) {
    return std::isfinite(c.x) && std::isfinite(c.y) && c.x > 0 && c.y > 0 && c.x + c.y < 1;
}

Error no_colours() {
    return fail("its primaries and white point span no colours");
}

// RGB to XYZ with white (1, 1, 1) at luminance 1.
Result<cv::Matx33d> rgb_to_xyz(const Primaries& p) {
    const cv::Matx33d ends(p.red.x, p.green.x, p.blue.x,  //
                           p.red.y, p.green.y, p.blue.y,  //
                           1 - p.red.x - p.red.y, 1 - p.green.x - p.green.y, 1 - p.blue.x - p.blue.y);
    const double area = cv::determinant(ends);
    if (!is_white(p.white) || !(std::abs(area) > 1e-6) || !std::isfinite(area)) return no_colours();
    const cv::Vec3d lengths = ends.inv() * xyz_of(p.white);
    for (int i = 0; i < 3; ++i)
        if (!(lengths[i] > 0)) return no_colours();
    return ends * cv::Matx33d::diag(lengths);
}

Result<cv::Matx33d> xyz_to_rec709(Chromaticity white) {
    if (!is_white(white)) return no_colours();
    const cv::Vec3d from = bradford * xyz_of(white), to = bradford * xyz_of(rec709_primaries.white);
    const cv::Matx33d adapted =
        bradford.inv() * cv::Matx33d::diag(cv::Vec3d(to[0] / from[0], to[1] / from[1], to[2] / from[2])) * bradford;
    return rgb_to_xyz(rec709_primaries)->inv() * adapted;
}

void multiply(Image& image, const cv::Matx33d& m) {
    for (size_t i = 0; i < image.data.size(); i += size_t(image.channels)) {
        float* p = &image.data[i];
        const cv::Vec3d v = m * cv::Vec3d(p[0], p[1], p[2]);
        for (int c = 0; c < 3; ++c) p[c] = float(v[c]);
    }
}

bool near(Chromaticity a, Chromaticity b) {
    return std::abs(a.x - b.x) <= 1e-4 && std::abs(a.y - b.y) <= 1e-4;
}

}  // namespace

bool are_same(const Primaries& a, const Primaries& b) {
    return near(a.red, b.red) && near(a.green, b.green) && near(a.blue, b.blue) && near(a.white, b.white);
}

bool are_rec709(const Primaries& p) {
    return are_same(p, rec709_primaries);
}

Status convert_to_rec709(Image& rgb, const Primaries& from) {
    const auto to_xyz = rgb_to_xyz(from);
    if (!to_xyz) return to_xyz.error();
    multiply(rgb, *xyz_to_rec709(from.white) * *to_xyz);
    return Done{};
}

Status convert_xyz_to_rec709(Image& xyz, Chromaticity white) {
    const auto matrix = xyz_to_rec709(white);
    if (!matrix) return matrix.error();
    multiply(xyz, *matrix);
    return Done{};
}

Result<std::array<double, 3>> luminance_weights(const Primaries& primaries) {
    const auto to_xyz = rgb_to_xyz(primaries);
    if (!to_xyz) return to_xyz.error();
    return std::array<double, 3>{(*to_xyz)(1, 0), (*to_xyz)(1, 1), (*to_xyz)(1, 2)};
}

}  // namespace ols

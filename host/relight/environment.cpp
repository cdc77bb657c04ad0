// SPDX-License-Identifier: MIT
// Projections of environment maps, and reading them.
#include "relight/environment.hpp"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <numbers>
#include <opencv2/imgcodecs.hpp>

#include "image/exr.hpp"

namespace ols {

namespace {

constexpr double pi = std::numbers::pi;

double latitude(double v) {
    return pi * (0.5 - v);
}

double longitude(EnvConvention convention, double u) {
    return 2 * pi * (convention == EnvConvention::mirrored ? u - 0.5 : 0.5 - u);
}

Vec3 angular_direction(double u, double v) {
    const double x = 2 * u - 1, y = 1 - 2 * v, r = std::min(std::hypot(x, y), 1.0);
    const double across = r > 0 ? std::sin(pi * r) / std::hypot(x, y) : pi;
    return {across * x, across * y, -std::cos(pi * r)};
}

// Steradians per unit of u, v area of an angular probe: sin(theta) dtheta dphi with theta = pi r, and 4 du dv = r dr
// dphi.
double angular_density(double u, double v) {
    const double r = std::hypot(2 * u - 1, 1 - 2 * v);
    if (r >= 1) return 0;
    return r > 0 ? 4 * pi * std::sin(pi * r) / r : 4 * pi * pi;
}

// Four-point Gauss-Legendre in each direction: the density is smooth but for the rim, where it falls to 0 in a kink.
double angular_solid_angle(const EnvPatch& patch) {
    constexpr double node[] = {-0.8611363115940526, -0.3399810435848563, 0.3399810435848563, 0.8611363115940526};
    constexpr double weight[] = {0.3478548451374538, 0.6521451548625461, 0.6521451548625461, 0.3478548451374538};
    const double half_u = (patch.u1 - patch.u0) / 2, half_v = (patch.v1 - patch.v0) / 2;
    const double mid_u = (patch.u0 + patch.u1) / 2, mid_v = (patch.v0 + patch.v1) / 2;
    double sum = 0;
    for (int i = 0; i < 4; ++i)
        for (int j = 0; j < 4; ++j)
            sum += weight[i] * weight[j] * angular_density(mid_u + half_u * node[i], mid_v + half_v * node[j]);
    return sum * half_u * half_v;
}

Result<Image> read_radiance_hdr(const std::string& path) {
    if (!std::filesystem::exists(path)) return fail("cannot open environment map '" + path + "': check the path");
    const cv::Mat bgr = cv::imread(path, cv::IMREAD_UNCHANGED);
    if (bgr.empty() || bgr.type() != CV_32FC3)
        return fail("cannot read '" + path +
                    "' as an environment map: it is no Radiance (.hdr) or OpenEXR (.exr) file");
    Image image(bgr.cols, bgr.rows, 3);
    for (int y = 0; y < image.height; ++y)
        for (int x = 0; x < image.width; ++x)
            for (int c = 0; c < 3; ++c) image.at(x, y, c) = bgr.at<cv::Vec3f>(y, x)[2 - c];
    return image;
}

bool has_suffix(const std::string& path, const std::string& lower_case) {
    if (path.size() < lower_case.size()) return false;
    return std::equal(lower_case.begin(), lower_case.end(), path.end() - std::ptrdiff_t(lower_case.size()),
                      [](char a, char b) { return a == std::tolower(static_cast<unsigned char>(b)); });
}

}  // namespace

Result<EnvConvention> parse_env_convention(const std::string& name) {
    if (name == "openexr") return EnvConvention::openexr;
    if (name == "mirrored") return EnvConvention::mirrored;
    if (name == "angular") return EnvConvention::angular;
    return fail("'" + name + "' is no environment convention: use openexr, mirrored or angular");
}

Vec3 env_direction(EnvConvention convention, double u, double v) {
    if (convention == EnvConvention::angular) return angular_direction(u, v);
    const double lat = latitude(v), lon = longitude(convention, u);
    return {std::sin(lon) * std::cos(lat), std::sin(lat), std::cos(lon) * std::cos(lat)};
}

double env_solid_angle(EnvConvention convention, const EnvPatch& patch) {
    if (convention == EnvConvention::angular) return angular_solid_angle(patch);
    return 2 * pi * (patch.u1 - patch.u0) * (std::sin(latitude(patch.v0)) - std::sin(latitude(patch.v1)));
}

double env_reach(EnvConvention convention, const EnvPatch& patch) {
    const double du = patch.u1 - patch.u0, dv = patch.v1 - patch.v0;
    // Nowhere on a probe is an angle larger than pi times the distance in the picture, whose radius is 1/2 in u and v.
    if (convention == EnvConvention::angular) return pi * std::hypot(du, dv);
    // Half the height along the meridian, then half the width along the patch's longest parallel.
    const double equator = std::clamp(0.5, patch.v0, patch.v1);
    return pi * dv / 2 + pi * du * std::cos(latitude(equator));
}

Environment make_environment(const Image& pixels, EnvConvention convention) {
    Environment environment{Image(pixels.width, pixels.height, 3), convention};
    for (int y = 0; y < pixels.height; ++y) {
        for (int x = 0; x < pixels.width; ++x) {
            bool negative = false, non_finite = false;
            for (int c = 0; c < 3; ++c) {
                float value = pixels.at(x, y, pixels.channels >= 3 ? c : 0);
                non_finite |= !std::isfinite(value);
                negative |= std::isfinite(value) && value < 0;
                if (!std::isfinite(value) || value < 0) value = 0;
                environment.radiance.at(x, y, c) = value;
            }
            environment.clamped_negative += negative;
            environment.clamped_non_finite += non_finite;
        }
    }
    return environment;
}

Result<Environment> read_environment(const std::string& path, std::optional<EnvConvention> convention) {
    const bool hdr = has_suffix(path, ".hdr") || has_suffix(path, ".pic");
    if (!hdr && !convention) {
        const auto cube = is_exr_cube_map(path);
        if (!cube) return cube.error();
        if (*cube)
            return fail("'" + path +
                        "' is a cube map: turn it into a latitude-longitude map with `exrenvmap -latlong`");
    }
    const auto pixels = hdr ? read_radiance_hdr(path) : read_exr(path);
    if (!pixels) return pixels.error();
    const auto layout = convention.value_or(EnvConvention::openexr);
    if (layout == EnvConvention::angular && pixels->width != pixels->height)
        return fail("'" + path +
                    "' is not square, so it is no angular probe: use --env-convention openexr or mirrored");
    return make_environment(*pixels, layout);
}

}  // namespace ols

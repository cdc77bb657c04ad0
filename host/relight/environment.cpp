// SPDX-License-Identifier: MIT
// Projections of environment maps, and reading them.
#include "relight/environment.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <string_view>

#include "image/input_file.hpp"
#include "image/radiance.hpp"

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

// By its first bytes, whatever its name says.
Result<FloatPicture> read_map(const std::string& path, const ExrChoice& choice) {
    auto stream = open_input(path);
    if (!stream) return stream.error();
    char bytes[16] = {};
    stream->read(bytes, sizeof bytes);
    const std::string_view start(bytes, size_t(stream->gcount()));
    if (begins_as_exr(start)) return read_exr_picture(path, choice);
    if (choice.part || choice.layer)
        return fail("'" + path + "' is no OpenEXR file, so it has no parts or layers: leave out --part and --layer");
    if (begins_as_radiance(start)) return read_radiance(path);
    return fail("cannot read '" + path + "' as an environment map: it is " + kind_of_bytes(start) +
                ", and only OpenEXR (.exr) and Radiance (.hdr) hold radiance as it is");
}

bool has_ratio(const Image& image, int width, int height) {
    constexpr double tolerance = 0.01;  // panoramas are cut to whole pixels
    return std::abs(double(image.width) * height / (double(image.height) * width) - 1) < tolerance;
}

// Of texels far from square each covers many lamps, and no camera or renderer makes such maps.
bool is_strip(const Image& image) {
    constexpr int64_t longest = 16;
    return image.width > longest * image.height || image.height > longest * image.width;
}

bool is_cube_shaped(const Image& image) {
    return has_ratio(image, 6, 1) || has_ratio(image, 1, 6) || has_ratio(image, 4, 3) || has_ratio(image, 3, 4);
}

constexpr const char* cube_remedy =
    "turn it into a latitude-longitude map with `exrenvmap -latlong`, or say what it is with --env-convention";

// The layout of a map of which nobody has said it: by its header, else latitude-longitude, and a warning if its shape is another.
Result<EnvConvention> layout_of(const FloatPicture& map, std::vector<std::string>& warnings) {
    const std::string size = std::to_string(map.pixels.width) + " x " + std::to_string(map.pixels.height);
    if (map.layout == StatedLayout::cube) return fail(std::string("is a cube map: ") + cube_remedy);
    if (!map.layout && is_cube_shaped(map.pixels))
        return fail("is " + size + ", the shape of the unfolded faces of a cube: " + cube_remedy);
    if (has_ratio(map.pixels, 1, 1) && !map.layout)
        warnings.push_back(
            "it is square (" + size +
            "), as angular probes are (--env-convention angular; mirror balls are not read), but was taken as "
            "latitude-longitude: say which with --env-convention");
    else if (!has_ratio(map.pixels, 2, 1))
        warnings.push_back(
            "it is " + size +
            " and was taken as latitude-longitude, which is twice as wide as high: check it, or say what it is with "
            "--env-convention");
    return EnvConvention::openexr;
}

void warn_of_alpha(const Image& image, std::vector<std::string>& warnings) {
    if (image.channels != 4) return;
    for (size_t i = 3; i < image.data.size(); i += 4)
        if (image.data[i] != 1) {
            warnings.push_back("its alpha is not used: colours count as they are, multiplied by it");
            return;
        }
}

// What the header says against what the user says, who knows better.
void warn_of_other_layout(const FloatPicture& map, EnvConvention convention, std::vector<std::string>& warnings) {
    if (map.layout == StatedLayout::cube)
        warnings.push_back("its header says cube map, but it was taken as --env-convention says");
    if (map.layout == StatedLayout::latitude_longitude && convention == EnvConvention::angular)
        warnings.push_back("its header says latitude-longitude, but it was taken as an angular probe");
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
    const auto warn = [&](size_t texels, const char* what) {
        if (texels > 0) environment.warnings.push_back(std::to_string(texels) + " texels had " + what + ", taken as 0");
    };
    warn(environment.clamped_negative, "negative values");
    warn(environment.clamped_non_finite, "NaN or Inf");
    return environment;
}

Result<Environment> read_environment(const std::string& path, std::optional<EnvConvention> convention,
                                     const ExrChoice& choice) {
    auto map = read_map(path, choice);
    if (!map) return map.error();
    std::vector<std::string> warnings = std::move(map->said);
    if (convention) warn_of_other_layout(*map, *convention, warnings);
    const auto layout = convention ? Result(*convention) : layout_of(*map, warnings);
    if (!layout) return fail("'" + path + "' " + layout.error().message);
    if (is_strip(map->pixels))
        return fail(
            fmt::format("'{}' is {} x {}, which is no map of a sphere: latitude-longitude is 2:1, an angular probe 1:1",
                        path, map->pixels.width, map->pixels.height));
    if (*layout == EnvConvention::angular && map->pixels.width != map->pixels.height)
        return fail("'" + path +
                    "' is not square, so it is no angular probe: use --env-convention openexr or mirrored");
    warn_of_alpha(map->pixels, warnings);
    Environment environment = make_environment(map->pixels, *layout);
    environment.warnings.insert(environment.warnings.begin(), warnings.begin(), warnings.end());
    return environment;
}

}  // namespace ols

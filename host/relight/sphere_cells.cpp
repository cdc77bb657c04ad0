// SPDX-License-Identifier: MIT
// Spherical Voronoi cells by clipping octants, and their solid angles.
#include "relight/sphere_cells.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <set>

namespace ols {

namespace {

constexpr int octant_side = -1;

// A convex spherical polygon, counter-clockwise from outside. The side that begins at a corner lies on the great circle
// between the cell's lamp and `across`, or on an octant's border.
struct Corner {
    Vec3 direction;
    int across;
};
using Polygon = std::vector<Corner>;

std::array<Polygon, 8> octants() {
    std::array<Polygon, 8> all;
    for (int i = 0; i < 8; ++i) {
        const double x = i & 1 ? -1 : 1, y = i & 2 ? -1 : 1, z = i & 4 ? -1 : 1;
        all[i] = {{{x, 0, 0}, octant_side}, {{0, y, 0}, octant_side}, {{0, 0, z}, octant_side}};
        if (x * y * z < 0) std::swap(all[i][1], all[i][2]);
    }
    return all;
}

// Sutherland and Hodgman's clipping, on the sphere: keeps d with d.normal >= 0. Sides stay shorter than a quarter
// circle, so a crossing is where the chord crosses the plane.
Polygon clipped(const Polygon& polygon, Vec3 normal, int lamp_across) {
    Polygon kept;
    for (size_t i = 0; i < polygon.size(); ++i) {
        const Corner &a = polygon[i], &b = polygon[(i + 1) % polygon.size()];
        const double side_a = dot(a.direction, normal), side_b = dot(b.direction, normal);
        if (side_a >= 0) kept.push_back(a);
        if ((side_a >= 0) == (side_b >= 0)) continue;
        const double t = side_a / (side_a - side_b);
        const Vec3 crossing = normalized(a.direction * (1 - t) + b.direction * t);
        // Leaving the half: the new side runs along the clipping circle. Entering: the old side goes on.
        kept.push_back({crossing, side_a >= 0 ? lamp_across : a.across});
    }
    if (kept.size() < 3) kept.clear();
    return kept;
}

// Van Oosterom and Strackee, "The solid angle of a plane triangle", IEEE Trans. Biomed. Eng. 30(2), 1983, equation 8.
double triangle_solid_angle(Vec3 a, Vec3 b, Vec3 c) {
    return 2 * std::atan2(dot(a, cross(b, c)), 1 + dot(a, b) + dot(b, c) + dot(c, a));
}

double polygon_solid_angle(const Polygon& polygon) {
    double sum = 0;
    for (size_t i = 2; i < polygon.size(); ++i)
        sum += triangle_solid_angle(polygon[0].direction, polygon[i - 1].direction, polygon[i].direction);
    return sum;
}

double angle_between(Vec3 a, Vec3 b) {
    return std::atan2(length(cross(a, b)), dot(a, b));
}

// The angle from the lamp to the farthest point of a polygon's rim. Beyond a quarter circle that point may lie inside a
// side: it is then opposite to where the side's great circle comes closest to the lamp.
double farthest_on_rim(const Polygon& polygon, Vec3 lamp) {
    double farthest = 0;
    for (size_t i = 0; i < polygon.size(); ++i) {
        const Vec3 a = polygon[i].direction, b = polygon[(i + 1) % polygon.size()].direction;
        farthest = std::max(farthest, angle_between(lamp, a));
        const Vec3 pole = cross(a, b), opposite = pole * (dot(lamp, pole) / dot(pole, pole)) - lamp;
        if (dot(cross(a, opposite), pole) > 0 && dot(cross(opposite, b), pole) > 0)
            farthest = std::max(farthest, angle_between(lamp, opposite));
    }
    return farthest;
}

double farthest_in_cell(const std::array<Polygon, 8>& pieces, Vec3 lamp) {
    double farthest = 0;
    for (const Polygon& piece : pieces) farthest = std::max(farthest, farthest_on_rim(piece, lamp));
    return farthest;
}

struct OtherLamp {
    int lamp;
    double angle;
};

std::vector<OtherLamp> others_by_angle(const std::vector<Vec3>& lamps, int lamp) {
    std::vector<OtherLamp> others;
    for (int j = 0; j < int(lamps.size()); ++j)
        if (j != lamp) others.push_back({j, angle_between(lamps[lamp], lamps[j])});
    std::sort(others.begin(), others.end(),
              [](auto a, auto b) { return a.angle != b.angle ? a.angle < b.angle : a.lamp < b.lamp; });
    return others;
}

// The cell in up to eight pieces, one an octant.
std::array<Polygon, 8> cell_pieces(const std::vector<Vec3>& lamps, int lamp, const std::vector<OtherLamp>& others) {
    auto pieces = octants();
    double farthest = std::numbers::pi;
    for (const auto [other, angle] : others) {
        // The bisector is half-way to the other lamp: beyond the cell's farthest point it cuts nothing off, and all
        // lamps that follow are farther still.
        if (angle / 2 > farthest) break;
        const Vec3 normal = normalized(lamps[lamp] - lamps[other]);
        for (Polygon& piece : pieces) piece = clipped(piece, normal, other);
        farthest = farthest_in_cell(pieces, lamps[lamp]);
    }
    return pieces;
}

}  // namespace

Result<SphereCells> SphereCells::make(const std::vector<Vec3>& directions) {
    if (directions.empty()) return fail("there are no lamps to share the sphere among: check the light positions");
    SphereCells cells;
    for (size_t i = 0; i < directions.size(); ++i) {
        const double norm = length(directions[i]);
        if (!(norm > 0) || !std::isfinite(norm))
            return fail(fmt::format("lamp {} has no direction ({}, {}, {}): check the light positions", i,
                                    directions[i].x, directions[i].y, directions[i].z));
        cells.directions_.push_back(directions[i] * (1 / norm));
    }
    for (int i = 0; i < cells.size(); ++i) {
        const Vec3 lamp = cells.directions_[i];
        const auto others = others_by_angle(cells.directions_, i);
        if (!others.empty() && others.front().angle < closest_lamps_rad)
            return fail(
                fmt::format("lamps {} and {} stand in the same direction ({:.6f}, {:.6f}, {:.6f}): merge or "
                            "remove one",
                            i, others.front().lamp, lamp.x, lamp.y, lamp.z));
        const auto pieces = cell_pieces(cells.directions_, i, others);
        double solid_angle = 0;
        std::set<int> across;
        for (const Polygon& piece : pieces) {
            solid_angle += polygon_solid_angle(piece);
            for (const Corner& corner : piece)
                if (corner.across != octant_side) across.insert(corner.across);
        }
        cells.solid_angles_.push_back(solid_angle);
        cells.reaches_.push_back(others.empty() ? std::numbers::pi : farthest_in_cell(pieces, lamp));
        cells.neighbors_.emplace_back();
        for (int other : across)
            cells.neighbors_.back().push_back({other, normalized(lamp - cells.directions_[other])});
    }
    return cells;
}

int SphereCells::nearest(Vec3 direction, int start) const {
    // Each step goes to the nearest neighbour, strictly nearer to the direction, so the walk ends; it ends in the right
    // cell because a convex cell is bounded by its neighbours alone.
    int lamp = start;
    double best = dot(directions_[lamp], direction);
    for (int next = lamp;; lamp = next) {
        for (const Neighbor& neighbor : neighbors_[lamp]) {
            const double cosine = dot(directions_[neighbor.lamp], direction);
            if (cosine > best) best = cosine, next = neighbor.lamp;
        }
        if (next == lamp) return lamp;
    }
}

}  // namespace ols

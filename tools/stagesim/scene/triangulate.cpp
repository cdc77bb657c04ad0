// SPDX-License-Identifier: MIT
// Ear clipping in the plane, on a ring of corners.
#include "scene/triangulate.hpp"

#include <algorithm>
#include <cmath>

namespace ols {

namespace {

struct Point {
    double x = 0, y = 0;

    friend Point operator-(Point a, Point b) { return {a.x - b.x, a.y - b.y}; }
    bool operator==(const Point&) const = default;
};

double cross(Point a, Point b) {
    return a.x * b.y - a.y * b.x;
}

// Polygons are scaled to a size of 1: what turns by less is straight.
constexpr double straight = 1e-13;

// 1 where a, b, c turn left, -1 where they turn right, 0 on a line.
int turn(Point a, Point b, Point c) {
    const double area = cross(b - a, c - a);
    return area > straight ? 1 : area < -straight ? -1 : 0;
}

// Corners moved to the first one and scaled to lie within 1 of it; empty when they are all one point.
std::vector<Vec3> normalised(std::span<const Vec3> polygon) {
    double size = 0;
    for (const Vec3 p : polygon) {
        const Vec3 from_first = p - polygon[0];
        size = std::max({size, std::abs(from_first.x), std::abs(from_first.y), std::abs(from_first.z)});
    }
    std::vector<Vec3> corners;
    if (size == 0) return corners;
    for (const Vec3 p : polygon) {
        const Vec3 from_first = p - polygon[0];
        corners.push_back({from_first.x / size, from_first.y / size, from_first.z / size});
    }
    return corners;
}

bool all_on_a_line(const std::vector<Vec3>& corners) {
    const Vec3 farthest =
        *std::max_element(corners.begin(), corners.end(), [](Vec3 a, Vec3 b) { return dot(a, a) < dot(b, b); });
    return std::all_of(corners.begin(), corners.end(), [&](Vec3 p) { return length(cross(farthest, p)) < 1e-12; });
}

Vec3 newell_normal(const std::vector<Vec3>& corners) {
    Vec3 sum;
    for (size_t i = 0; i < corners.size(); ++i) sum = sum + cross(corners[i], corners[(i + 1) % corners.size()]);
    return sum;
}

// Seen against the normal, so that the polygon turns left.
std::vector<Point> projected(const std::vector<Vec3>& corners, Vec3 normal) {
    const Vec3 n = normalized(normal);
    const Vec3 aside = std::abs(n.x) < 0.6 ? Vec3{1, 0, 0} : Vec3{0, 1, 0};
    const Vec3 u = normalized(cross(aside, n)), v = cross(n, u);
    std::vector<Point> points;
    for (const Vec3 p : corners) points.push_back({dot(p, u), dot(p, v)});
    return points;
}

// Whether all triangles of the fan of the first corner turn left, within half a turn.
bool is_fan(const std::vector<Point>& p) {
    for (size_t i = 2; i < p.size(); ++i)
        if (turn(p[0], p[1], p[i]) <= 0 || turn(p[0], p[i - 1], p[i]) <= 0) return false;
    return true;
}

// Corners without repeats and without ways there and back again (a, b, a), which have no area.
std::vector<uint32_t> outline(const std::vector<Point>& p) {
    std::vector<uint32_t> ring;
    const auto same = [&](size_t i, size_t j) { return p[ring[i]] == p[ring[j]]; };
    for (uint32_t i = 0; i < p.size(); ++i) {
        ring.push_back(i);
        for (;;) {
            const size_t n = ring.size();
            if (n >= 2 && same(n - 1, n - 2))
                ring.pop_back();
            else if (n >= 3 && same(n - 1, n - 3))
                ring.resize(n - 2);
            else
                break;
        }
    }
    // The same across the end.
    for (size_t n; (n = ring.size()) >= 3;) {
        if (same(0, n - 1) || same(0, n - 2))
            ring.pop_back();
        else if (same(1, n - 1))
            ring.erase(ring.begin());
        else
            break;
    }
    return ring;
}

bool edges_cross(const std::vector<Point>& p, const std::vector<uint32_t>& ring) {
    const size_t n = ring.size();
    for (size_t i = 0; i < n; ++i)
        for (size_t j = i + 2; j < n; ++j) {
            const Point a = p[ring[i]], b = p[ring[i + 1]], c = p[ring[j]], d = p[ring[(j + 1) % n]];
            if (turn(a, b, c) * turn(a, b, d) < 0 && turn(c, d, a) * turn(c, d, b) < 0) return true;
        }
    return false;
}

class EarClipper {
  public:
    EarClipper(const std::vector<Point>& points, const std::vector<uint32_t>& ring) : p_(points) {
        const size_t n = ring.size();
        for (size_t i = 0; i < n; ++i) nodes_.push_back({ring[i], (i + n - 1) % n, (i + 1) % n, 0, true});
        left_ = n;
        for (size_t i = 0; i < n; ++i) nodes_[i].roundness = roundness(i);
    }

    // False when no ear is left though there must be one: the polygon is not simple.
    bool clip(std::vector<std::array<uint32_t, 3>>& triangles) {
        while (left_ > 3) {
            const auto best = std::max_element(nodes_.begin(), nodes_.end(), [](const Node& a, const Node& b) {
                return (a.is_there ? a.roundness : -1) < (b.is_there ? b.roundness : -1);
            });
            if (best->roundness > 0) {
                triangles.push_back({nodes_[best->previous].corner, best->corner, nodes_[best->next].corner});
                remove(size_t(best - nodes_.begin()));
            } else if (!remove_straight()) {
                return false;
            }
        }
        const auto last = std::find_if(nodes_.begin(), nodes_.end(), [](const Node& n) { return n.is_there; });
        const Node &before = nodes_[last->previous], &after = nodes_[last->next];
        const int way = turn(p_[before.corner], p_[last->corner], p_[after.corner]);
        if (way > 0) triangles.push_back({before.corner, last->corner, after.corner});
        return way >= 0;
    }

  private:
    struct Node {
        uint32_t corner;
        size_t previous, next;
        double roundness;  // of the ear that it is the tip of; 0: it is none
        bool is_there;
    };

    Point at(size_t node) const { return p_[nodes_[node].corner]; }
    int turn_at(size_t node) const { return turn(at(nodes_[node].previous), at(node), at(nodes_[node].next)); }

    void remove(size_t node) {
        const size_t previous = nodes_[node].previous, next = nodes_[node].next;
        nodes_[node].is_there = false;
        nodes_[node].roundness = 0;
        nodes_[previous].next = next;
        nodes_[next].previous = previous;
        --left_;
        nodes_[previous].roundness = roundness(previous);
        nodes_[next].roundness = roundness(next);
    }

    // A corner in line with its neighbours, which takes no area with it.
    bool remove_straight() {
        for (size_t i = 0; i < nodes_.size(); ++i)
            if (nodes_[i].is_there && turn_at(i) == 0) {
                remove(i);
                return true;
            }
        return false;
    }

    // Twice the area over the square of the longest side, where the corner can be cut off.
    double roundness(size_t node) const {
        const Point a = at(nodes_[node].previous), b = at(node), c = at(nodes_[node].next);
        if (turn(a, b, c) <= 0) return 0;
        for (size_t q = 0; q < nodes_.size(); ++q)
            if (nodes_[q].is_there && q != node && q != nodes_[node].previous && q != nodes_[node].next &&
                turn_at(q) <= 0 && reaches_into(q, a, b, c))
                return 0;
        const auto square = [](Point v) { return v.x * v.x + v.y * v.y; };
        return cross(b - a, c - a) / std::max({square(b - a), square(c - b), square(a - c)});
    }

    // Whether a corner lies in a triangle, or on its edge, or at its corner with an edge that leads into it.
    bool reaches_into(size_t q, Point a, Point b, Point c) const {
        const Point p = at(q);
        const Point before = at(nodes_[q].previous), after = at(nodes_[q].next);
        const auto leads_between = [&](Point from, Point right, Point left) {
            return (turn(from, right, before) > 0 && turn(from, left, before) < 0) ||
                   (turn(from, right, after) > 0 && turn(from, left, after) < 0);
        };
        if (p == a) return leads_between(a, b, c);
        if (p == b) return leads_between(b, c, a);
        if (p == c) return leads_between(c, a, b);
        return turn(a, b, p) >= 0 && turn(b, c, p) >= 0 && turn(c, a, p) >= 0;
    }

    const std::vector<Point>& p_;
    std::vector<Node> nodes_;
    size_t left_;
};

}  // namespace

PolygonShape triangulate(std::span<const Vec3> polygon, std::vector<std::array<uint32_t, 3>>& triangles) {
    if (polygon.size() > polygon_corners_max) return PolygonShape::too_large;
    const std::vector<Vec3> corners = normalised(polygon);
    if (corners.empty() || all_on_a_line(corners)) return PolygonShape::without_area;
    const Vec3 normal = newell_normal(corners);
    if (length(normal) < 1e-12) return PolygonShape::crosses_itself;
    const std::vector<Point> points = projected(corners, normal);
    if (is_fan(points)) {
        for (uint32_t i = 2; i < points.size(); ++i) triangles.push_back({0, i - 1, i});
        return PolygonShape::simple;
    }
    const std::vector<uint32_t> ring = outline(points);
    if (ring.size() < 3) return PolygonShape::without_area;
    if (edges_cross(points, ring)) return PolygonShape::crosses_itself;
    const size_t before = triangles.size();
    if (EarClipper(points, ring).clip(triangles))
        return triangles.size() > before ? PolygonShape::simple : PolygonShape::without_area;
    triangles.resize(before);
    return PolygonShape::crosses_itself;
}

}  // namespace ols

// SPDX-License-Identifier: MIT
// Primary visibility, one tile of the image at a time.
#include "render/visible_points.hpp"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>

#include "scene/texture.hpp"

namespace ols {

namespace {

constexpr int tile_pixels = VisiblePoints::tile_pixels;

struct Point {
    Float3 position, normal, view;
    Float3 smooth;  // normal without the fine relief of the look
    Look look;
    uint32_t pixel = 0;  // within the tile's pixels
    float weight = 0;
    uint32_t object = 0, material = 0;
    int samples = 1;  // whose mean it is
};

Point make_point(const Scene& scene, const SurfaceHit& hit, Float3 ray, BakedLooks* baked) {
    Point point;
    point.position = hit.position;
    point.view = ray * -1.0f;
    point.look = baked ? baked->at(hit) : look_of(scene.materials[hit.material], hit.rest_position, hit.mask);
    point.normal = hit.pose.turn(relieved(hit.rest_normal, point.look.slope));
    point.smooth = hit.normal;
    point.object = hit.object, point.material = hit.material;
    return point;
}

// Adds `b` to the sum `a` if they may be one smooth surface: of one object and material, within `reach_m`, bent by no more
// than 37 degrees, and b in the plane through a's mean: the mean of two sides of a fold would lie inside the flesh, in
// the dark.
bool merge(Point& a, const Point& b, float reach_m) {
    if (a.object != b.object || a.material != b.material) return false;
    const Float3 way = b.position - a.position * (1 / float(a.samples)), facing = normalized(a.smooth);
    if (length(way) > reach_m || dot(facing, b.smooth) < 0.8f) return false;
    if (std::abs(dot(way, normalized(facing + b.smooth))) > 0.2f * length(way)) return false;
    a.smooth = a.smooth + b.smooth;
    a.position = a.position + b.position;
    a.normal = a.normal + b.normal;
    a.view = a.view + b.view;
    a.look.albedo = a.look.albedo + b.look.albedo;
    a.look.roughness += b.look.roughness;
    a.look.f0 += b.look.f0;
    a.weight += b.weight;
    ++a.samples;
    return true;
}

// The mean of what was summed, back on the surface: the mean of points of a bulge lies under it, in its own shadow.
Point mean(Point sum, const Geometry& geometry, Float3 eye, float reach_m) {
    if (sum.samples == 1) return sum;
    const float share = 1 / float(sum.samples);
    sum.position = sum.position * share;
    const auto hit = geometry.intersect(eye, normalized(sum.position - eye));
    if (hit && hit->object == sum.object && length(hit->position - sum.position) < reach_m)
        sum.position = hit->position;
    // Diffuse light is linear in the normal: the mean of normals that differ is shorter, and its light less.
    sum.look.albedo = sum.look.albedo * (share * share * length(sum.normal));
    sum.normal = normalized(sum.normal);
    sum.view = normalized(sum.view);
    sum.look.roughness *= share;
    sum.look.f0 *= share;
    return sum;
}

struct Tile {
    std::vector<Point> points;
    std::vector<uint32_t> pixels;
};

// What is looked at.
struct View {
    const Scene& scene;
    const Geometry& geometry;
    const Pinhole& camera;
    BakedLooks* baked;        // null: looks are exact
    Pinhole::Pixels covered;  // no ray through another pixel meets anything
};

// The points of a pixel; `x`, `y` is its top left corner.
std::vector<Point> trace_pixel(const View& view, int x, int y) {
    const auto& [scene, geometry, camera, baked, covered] = view;
    const int side = int(std::lround(std::sqrt(scene.samples)));
    std::vector<Point> points;
    // A pixel's own width, and more for a surface that tilts away.
    const auto reach_m = [&](Float3 place) {
        return 3 * view.camera.pixel_angle() * length(place - view.camera.position());
    };
    for (int s = 0; s < scene.samples; ++s) {
        const Float3 ray = camera.ray(x + (s % side + 0.5) / side, y + (s / side + 0.5) / side);
        const auto hit = geometry.intersect(camera.position(), ray);
        if (!hit) continue;
        Point point = make_point(scene, *hit, ray, baked);
        point.weight = 1.0f / float(scene.samples);
        const auto merged = [&](Point& p) { return merge(p, point, reach_m(hit->position)); };
        if (scene.merges_samples && std::any_of(points.begin(), points.end(), merged)) continue;
        points.push_back(point);
    }
    for (Point& point : points)
        point = mean(point, geometry, camera.position(), reach_m(point.position * (1 / float(point.samples))));
    return points;
}

Tile trace_tile(const View& view, int width, int tile_x, int tile_y) {
    const Pinhole::Pixels& covered = view.covered;
    Tile tile;
    for (int y = std::max(tile_y, covered.top); y < std::min(tile_y + tile_pixels, covered.bottom); ++y)
        for (int x = std::max(tile_x, covered.left); x < std::min(tile_x + tile_pixels, covered.right); ++x) {
            for (Point& point : trace_pixel(view, x, y)) {
                point.pixel = uint32_t(tile.pixels.size());
                tile.points.push_back(point);
            }
            if (!tile.points.empty() && tile.points.back().pixel == tile.pixels.size())
                tile.pixels.push_back(uint32_t(y * width + x));
        }
    // Fill the last packet with copies that weigh nothing.
    while (tile.points.size() % packet_size != 0) {
        tile.points.push_back(tile.points.back());
        tile.points.back().weight = 0;
    }
    return tile;
}

void append(VisiblePoints& all, const Tile& tile, const Scene& scene) {
    const uint32_t first_pixel = uint32_t(all.pixels.size());
    all.chunks.push_back(
        {uint32_t(all.size()), uint32_t(tile.points.size()), first_pixel, uint32_t(tile.pixels.size())});
    all.pixels.insert(all.pixels.end(), tile.pixels.begin(), tile.pixels.end());
    const auto push = [](std::vector<float>(&arrays)[3], Float3 v) {
        arrays[0].push_back(v.x);
        arrays[1].push_back(v.y);
        arrays[2].push_back(v.z);
    };
    for (const Point& point : tile.points) {
        push(all.position, point.position);
        push(all.normal, point.normal);
        push(all.view, point.view);
        push(all.albedo, point.look.albedo);
        all.roughness.push_back(point.look.roughness);
        all.f0.push_back(point.look.f0);
        all.weight.push_back(point.weight);
        all.pixel.push_back(first_pixel + point.pixel);
        all.on_board.push_back(scene.objects[point.object].is_board);
    }
}

}  // namespace

VisiblePoints find_visible_points(const Scene& scene, const Geometry& geometry, const Pinhole& camera, int width,
                                  int height, BakedLooks* baked) {
    const View view{scene, geometry, camera, baked, camera.cover(geometry.bounds(), width, height)};
    const int across = (width + tile_pixels - 1) / tile_pixels, down = (height + tile_pixels - 1) / tile_pixels;
    std::vector<Tile> tiles(size_t(across) * down);
    tbb::parallel_for(0, across * down, [&](int i) {
        tiles[i] = trace_tile(view, width, i % across * tile_pixels, i / across * tile_pixels);
    });
    VisiblePoints all;
    all.width = width, all.height = height, all.samples = scene.samples;
    for (Tile& tile : tiles) {
        if (!tile.points.empty()) append(all, tile, scene);
        tile = {};
    }
    return all;
}

}  // namespace ols

// SPDX-License-Identifier: MIT
// Primary visibility, one tile of the image at a time.
#include "visible_points.hpp"

#include <tbb/parallel_for.h>

#include <cmath>

#include "texture.hpp"

namespace ols {

namespace {

constexpr int tile_pixels = 16;  // a tile's points (1024 of 64 bytes at 4 samples) stay in the second-level cache

struct Point {
    Float3 position, normal, view;
    Look look;
    uint32_t pixel = 0;  // within the tile's pixels
    float weight = 0;
    bool on_board = false;
};

struct Tile {
    std::vector<Point> points;
    std::vector<uint32_t> pixels;
};

Tile trace_tile(const Scene& scene, const Geometry& geometry, const Pinhole& camera, int width, int height, int samples,
                int tile_x, int tile_y) {
    Tile tile;
    const int side = int(std::lround(std::sqrt(samples)));
    for (int y = tile_y; y < std::min(tile_y + tile_pixels, height); ++y)
        for (int x = tile_x; x < std::min(tile_x + tile_pixels, width); ++x) {
            const size_t before = tile.points.size();
            for (int s = 0; s < samples; ++s) {
                const Float3 ray = camera.ray(x + (s % side + 0.5) / side, y + (s / side + 0.5) / side);
                const auto hit = geometry.intersect(camera.position(), ray);
                if (!hit) continue;
                Point point;
                point.position = hit->position;
                point.view = ray * -1.0f;
                point.look = look_of(scene.materials[hit->material], hit->rest_position, hit->rest_normal, hit->mask);
                point.normal = hit->pose.turn(point.look.normal);
                point.pixel = uint32_t(tile.pixels.size());
                point.weight = 1.0f / float(samples);
                point.on_board = scene.objects[hit->object].is_board;
                tile.points.push_back(point);
            }
            if (tile.points.size() > before) tile.pixels.push_back(uint32_t(y * width + x));
        }
    // Fill the last packet with copies that weigh nothing.
    while (tile.points.size() % packet_size != 0) {
        tile.points.push_back(tile.points.back());
        tile.points.back().weight = 0;
    }
    return tile;
}

void append(VisiblePoints& all, const Tile& tile) {
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
        all.on_board.push_back(point.on_board);
    }
}

}  // namespace

VisiblePoints find_visible_points(const Scene& scene, const Geometry& geometry, const Pinhole& camera, int width,
                                  int height, int samples) {
    const int across = (width + tile_pixels - 1) / tile_pixels, down = (height + tile_pixels - 1) / tile_pixels;
    std::vector<Tile> tiles(size_t(across) * down);
    tbb::parallel_for(0, across * down, [&](int i) {
        tiles[i] = trace_tile(scene, geometry, camera, width, height, samples, i % across * tile_pixels,
                              i / across * tile_pixels);
    });
    VisiblePoints all;
    all.width = width, all.height = height, all.samples = samples;
    for (Tile& tile : tiles) {
        if (!tile.points.empty()) append(all, tile);
        tile = {};
    }
    return all;
}

}  // namespace ols

// SPDX-License-Identifier: MIT
// The sheet is continuous and covers the plane inside its moved border once, counted with orientation (its degree is 1): so each
// point there lies in at least one triangle that is not turned over, and drawing those leaves no hole.
#include "relight/moved_sheet.hpp"

#include <algorithm>
#include <array>
#include <cmath>

namespace ols {

namespace {

constexpr int patch_cells = 16;
constexpr float cut_px = 1;          // corners that part by more are no surface
constexpr float behind_all = -1;     // nearness of what opens in a cut cell
constexpr float edge_slack = 1e-4f;  // of a cell: rounding must not open a seam between two triangles
constexpr float least_area = 1e-6f;  // of a triangle, in pixels, that is drawn

struct Vertex {
    float x, y;  // from the tile's first pixel
    float u, v;  // moved by
    float nearness() const { return u * u + v * v; }
};

// 0 top left, 1 top right, 2 bottom left, 3 bottom right.
using Corners = std::array<Vertex, 4>;

float span(float a, float b, float c, float d) {
    return std::max({a, b, c, d}) - std::min({a, b, c, d});
}

bool is_cut(const Corners& c) {
    return span(c[0].u, c[1].u, c[2].u, c[3].u) > cut_px || span(c[0].v, c[1].v, c[2].v, c[3].v) > cut_px;
}

struct Range {
    int first, last;
};

// Whole numbers of [low, high], but within 0 .. size - 1; first > last where there is none. Limited before they are converted, as
// values may be far outside.
Range pixels_between(float low, float high, int size) {
    const float first = std::clamp(low, 0.0f, float(size)), last = std::clamp(high, -1.0f, float(size - 1));
    const int below = int(first);
    return {below + (float(below) < first), int(last + 1) - 1};
}

// One of a cell's two triangles: a corner, its neighbour in the row and the one in the column.
class Triangle {
  public:
    Triangle(const Vertex& origin, const Vertex& across, const Vertex& down)
        : x_(origin.x), y_(origin.y), ax_(across.x - x_), ay_(across.y - y_), dx_(down.x - x_), dy_(down.y - y_) {
        const float area = ax_ * dy_ - ay_ * dx_;
        if (area > least_area) per_area_ = 1 / area;
    }

    // Whether a point is in it, which needs it not turned over, and then how far across and down, 0 to 1.
    bool find(float x, float y, float& across, float& down) const {
        const float px = x - x_, py = y - y_;
        across = (px * dy_ - py * dx_) * per_area_;
        down = (ax_ * py - ay_ * px) * per_area_;
        if (per_area_ == 0 || across < -edge_slack || down < -edge_slack || across + down > 1 + edge_slack)
            return false;
        across = std::clamp(across, 0.0f, 1.0f);
        down = std::clamp(down, 0.0f, 1.0f);
        return true;
    }

  private:
    float x_, y_, ax_, ay_, dx_, dy_;
    float per_area_ = 0;
};

class CellPainter {
  public:
    CellPainter(SheetTile& tile, int cell_x, int cell_y, const Corners& corners)
        : tile_(tile), cell_x_(cell_x), cell_y_(cell_y), corners_(corners) {}

    void paint_whole() {
        float nearness = 0;
        for (const Vertex& corner : corners_) nearness += corner.nearness() / 4;
        paint_inside([&](int x, int y, float fx, float fy) { put(x, y, nearness, fx, fy); });
    }

    // `half_x` and `half_y`: half the cell's sides before it moved.
    void paint_cut(float half_x, float half_y) {
        int stillest = 0;
        for (int c = 1; c < 4; ++c)
            if (corners_[size_t(c)].nearness() < corners_[size_t(stillest)].nearness()) stillest = c;
        paint_inside([&](int x, int y, float, float) { put_corner(x, y, behind_all, stillest); });
        for (int c = 0; c < 4; ++c) paint_quarter(c, half_x, half_y);
    }

  private:
    void put(int x, int y, float nearness, float fx, float fy) {
        SheetHit& hit = tile_.hits[size_t(y) * size_t(tile_.width) + size_t(x)];
        if (nearness > hit.nearness) hit = {nearness, fx, fy, cell_x_, cell_y_};
    }

    void put_corner(int x, int y, float nearness, int corner) {
        put(x, y, nearness, float(corner & 1), float(corner >> 1));
    }

    // Calls paint(x, y, fx, fy) for the pixels in either triangle.
    template <typename Paint>
    void paint_inside(Paint paint) {
        const auto& [a, b, c, d] = corners_;
        const auto [x0, x1] = pixels_between(std::min({a.x, b.x, c.x, d.x}) - edge_slack,
                                             std::max({a.x, b.x, c.x, d.x}) + edge_slack, tile_.width);
        const auto [y0, y1] = pixels_between(std::min({a.y, b.y, c.y, d.y}) - edge_slack,
                                             std::max({a.y, b.y, c.y, d.y}) + edge_slack, tile_.height);
        if (x0 > x1 || y0 > y1) return;
        const Triangle from_start(a, b, c), from_end(d, c, b);
        for (int y = y0; y <= y1; ++y)
            for (int x = x0; x <= x1; ++x) {
                float across, down;
                if (from_start.find(float(x), float(y), across, down))
                    paint(x, y, across, down);
                else if (from_end.find(float(x), float(y), across, down))
                    paint(x, y, 1 - across, 1 - down);
            }
    }

    // The quarter of the cell that is nearest to a corner, gone with it unchanged.
    void paint_quarter(int corner, float half_x, float half_y) {
        const Vertex& at = corners_[size_t(corner)];
        const float x_end = at.x + ((corner & 1) ? -half_x : half_x), y_end = at.y + ((corner >> 1) ? -half_y : half_y);
        const auto [x0, x1] = pixels_between(std::min(at.x, x_end), std::max(at.x, x_end), tile_.width);
        const auto [y0, y1] = pixels_between(std::min(at.y, y_end), std::max(at.y, y_end), tile_.height);
        for (int y = y0; y <= y1; ++y)
            for (int x = x0; x <= x1; ++x) put_corner(x, y, at.nearness(), corner);
    }

    SheetTile& tile_;
    const int cell_x_, cell_y_;
    const Corners& corners_;
};

// A vertex before it moves: on its pixel's centre, at the rim half a pixel beyond.
float home(int vertex, int pixels) {
    return std::clamp(float(vertex - 1), -0.5f, float(pixels) - 0.5f);
}

}  // namespace

MovedSheet::MovedSheet(const ExposurePath& path)
    : path_(path), width_(path.moved[0].width), height_(path.moved[0].height) {
    for (int y = 0; y <= height_; y += patch_cells)
        for (int x = 0; x <= width_; x += patch_cells) patches_.push_back(patch_at(x, y));
}

int MovedSheet::pixel_x(int vertex) const {
    return std::clamp(vertex - 1, 0, width_ - 1);
}

int MovedSheet::pixel_y(int vertex) const {
    return std::clamp(vertex - 1, 0, height_ - 1);
}

// Between the ends of pieces a vertex is between its places there, so those bound it.
SheetPatch MovedSheet::patch_at(int first_x, int first_y) const {
    SheetPatch patch{first_x,
                     first_y,
                     std::min(first_x + patch_cells, width_ + 1),
                     std::min(first_y + patch_cells, height_ + 1),
                     INFINITY,
                     INFINITY,
                     -INFINITY,
                     -INFINITY,
                     std::vector<float>(path_.pieces()),
                     true};
    for (int y = patch.first_y; y <= patch.end_y; ++y)
        for (int x = patch.first_x; x <= patch.end_x; ++x) {
            const size_t p = size_t(pixel_y(y)) * size_t(width_) + size_t(pixel_x(x));
            for (size_t k = 0; k < path_.moved.size(); ++k) {
                const float u = path_.moved[k].u[p], v = path_.moved[k].v[p];
                patch.still = patch.still && u == 0 && v == 0;
                // A cut cell's quarters stay within half a pixel of their corners.
                patch.left = std::min(patch.left, home(x, width_) + u - 0.5f);
                patch.right = std::max(patch.right, home(x, width_) + u + 0.5f);
                patch.top = std::min(patch.top, home(y, height_) + v - 0.5f);
                patch.bottom = std::max(patch.bottom, home(y, height_) + v + 0.5f);
                if (k == 0) continue;
                const float du = u - path_.moved[k - 1].u[p], dv = v - path_.moved[k - 1].v[p];
                patch.piece_px[k - 1] = std::max(patch.piece_px[k - 1], du * du + dv * dv);
            }
        }
    for (float& length : patch.piece_px) length = std::sqrt(length);
    return patch;
}

void MovedSheet::draw(const SheetPatch& patch, size_t piece, float fraction, SheetTile& tile) const {
    const FlowField &from = path_.moved[piece], &to = path_.moved[piece + 1];
    constexpr int pitch = patch_cells + 1;
    std::array<Vertex, size_t(pitch) * pitch> vertices;
    float left = INFINITY, top = INFINITY, right = -INFINITY, bottom = -INFINITY;
    for (int y = patch.first_y; y <= patch.end_y; ++y)
        for (int x = patch.first_x; x <= patch.end_x; ++x) {
            const size_t p = size_t(pixel_y(y)) * size_t(width_) + size_t(pixel_x(x));
            const float u = from.u[p] + fraction * (to.u[p] - from.u[p]);
            const float v = from.v[p] + fraction * (to.v[p] - from.v[p]);
            const float at_x = home(x, width_) - float(tile.x) + u, at_y = home(y, height_) - float(tile.y) + v;
            vertices[size_t((y - patch.first_y) * pitch + x - patch.first_x)] = {at_x, at_y, u, v};
            left = std::min(left, at_x), right = std::max(right, at_x);
            top = std::min(top, at_y), bottom = std::max(bottom, at_y);
        }
    if (right < -1 || bottom < -1 || left > float(tile.width) || top > float(tile.height)) return;
    for (int y = patch.first_y; y < patch.end_y; ++y)
        for (int x = patch.first_x; x < patch.end_x; ++x) {
            const Vertex* first = &vertices[size_t((y - patch.first_y) * pitch + x - patch.first_x)];
            const Corners corners = {first[0], first[1], first[pitch], first[pitch + 1]};
            CellPainter painter(tile, x, y, corners);
            if (is_cut(corners))
                painter.paint_cut((home(x + 1, width_) - home(x, width_)) / 2,
                                  (home(y + 1, height_) - home(y, height_)) / 2);
            else
                painter.paint_whole();
        }
}

}  // namespace ols

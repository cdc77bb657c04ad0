// SPDX-License-Identifier: MIT
// A picture as a sheet of cells between pixel centres, carried along by its pixels' motion: which place of the sheet each
// pixel of a tile sees at an instant.
#pragma once

#include <vector>

#include "relight/exposure_path.hpp"

namespace ols {

// Where a pixel sees the sheet: inside cell (cell_x, cell_y), whose corners are vertices (cell_x, cell_y) to (cell_x + 1, cell_y
// + 1), at the fractions (fx, fy) of it.
struct SheetHit {
    float nearness;  // of two cells that cover the pixel the one of larger nearness is in front
    float fx, fy;
    int cell_x, cell_y;

    static constexpr float nothing = -2;  // nearness where no cell covers the pixel
};

// Pixels [x, x + width) x [y, y + height).
struct SheetTile {
    int x, y, width, height;
    std::vector<SheetHit> hits;  // row by row
};

// Cells that are moved and drawn together, and what is known of them beforehand.
struct SheetPatch {
    int first_x, first_y, end_x, end_y;  // cells
    float left, top, right, bottom;      // of all pixels that they cover while the shutter is open
    std::vector<float> piece_px;         // of the fastest vertex in each piece
    bool still;                          // nothing of it moves at all
};

// Vertices are the pixels' centres and, so that the sheet covers the whole of the outermost pixels, a rim half a pixel beyond with
// their values and motion: vertex (i, j) stands for pixel (i - 1, j - 1), at the rim for the nearest one.
class MovedSheet {
  public:
    explicit MovedSheet(const ExposurePath& path);

    const std::vector<SheetPatch>& patches() const { return patches_; }
    int pixel_x(int vertex) const;
    int pixel_y(int vertex) const;

    // Adds what the patch shows in the tile at a fraction of a piece of the path.
    void draw(const SheetPatch& patch, size_t piece, float fraction, SheetTile& tile) const;

  private:
    SheetPatch patch_at(int first_x, int first_y) const;

    const ExposurePath& path_;
    int width_, height_;
    std::vector<SheetPatch> patches_;
};

}  // namespace ols

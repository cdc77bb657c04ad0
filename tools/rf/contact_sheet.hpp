// SPDX-License-Identifier: MIT
// A contact sheet: every lamp's image, small, placed where the lamp hangs.
#pragma once

#include <string>
#include <vector>

#include "image/frame.hpp"
#include "stage/lamps.hpp"

namespace ols {

struct SheetCell {
    int row = 0;        // from the top
    double column = 0;  // cells left (-) or right (+) of the middle
};

// Rows of lamps of like elevation, each centred and ordered by azimuth: lamps behind the camera's view of the subject
// are at the ends, those in front in the middle, those on its right side (+x) to the right. Rows are nine tenths of the
// lamps' mean distance apart; empty ones are left out.
std::vector<SheetCell> sheet_layout(const std::vector<LightPosition>& lights);

class ContactSheet {
  public:
    // `image_width` by `image_height` pixels are what add() will get.
    ContactSheet(const std::vector<LightPosition>& lights, int image_width, int image_height);

    // Keeps a smaller copy of a lamp's scene-linear R G B image.
    void add(int lamp, const Image& rgb);

    // R G B, 8-bit sRGB through tone_curve (image/tone.hpp). One exposure for all, so that lamps compare: the brightest
    // half percent of all pixels goes beyond 0.9, plus `exposure_ev`. All are cut to the smallest box that holds what
    // any lamp shows brighter than a thirtieth of that, with a margin. `title` stands at the top.
    struct Picture {
        int width = 0, height = 0;
        std::vector<uint8_t> rgb8;
        double gain = 1;  // what values were multiplied by
    };
    Picture picture(const std::string& title, double exposure_ev) const;

  private:
    std::vector<SheetCell> cells_;
    int kept_width_, kept_height_;
    std::vector<Image> kept_;
};

}  // namespace ols

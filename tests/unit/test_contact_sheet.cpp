// SPDX-License-Identifier: MIT
// Contact sheets: every lamp has a place of its own, where it hangs; exposure is common to all.
// links: ols_rf
#include "rf/contact_sheet.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <set>

using namespace ols;

namespace {

std::vector<LightPosition> stage_lights() {
    std::vector<LightPosition> lights;
    for (const Vec3 d : stage_lamp_directions()) lights.push_back({"", d});
    return lights;
}

uint8_t brightest(const ContactSheet::Picture& picture) {
    return *std::max_element(picture.rgb8.begin(), picture.rgb8.end());
}

}  // namespace

TEST(ContactSheet, the_stage_has_eleven_rows_widest_at_the_equator) {
    std::map<int, int> lamps_of_row;
    for (const auto& cell : sheet_layout(stage_lights())) ++lamps_of_row[cell.row];
    std::vector<int> counts;
    for (const auto& [row, count] : lamps_of_row) counts.push_back(count);
    EXPECT_EQ(counts, (std::vector<int>{1, 5, 10, 15, 20, 20, 20, 20, 20, 15, 10}));
}

TEST(ContactSheet, higher_lamps_stand_higher_and_lamps_at_the_subjects_right_side_stand_right) {
    const auto lights = stage_lights();
    const auto cells = sheet_layout(lights);
    std::set<std::pair<int, double>> places;
    for (size_t i = 0; i < lights.size(); ++i) {
        places.insert({cells[i].row, cells[i].column});
        const Vec3 d = lights[i].direction;
        if (std::abs(d.x) > 0.2) {
            EXPECT_EQ(d.x > 0, cells[i].column > 0) << i;
        }
        for (size_t j = 0; j < lights.size(); ++j)
            if (lights[j].direction.y > d.y + 0.3) {
                EXPECT_LT(cells[j].row, cells[i].row);
            }
    }
    EXPECT_EQ(places.size(), lights.size());
}

TEST(ContactSheet, a_half_dome_and_a_single_lamp_have_a_layout_too) {
    auto lights = stage_lights();
    std::erase_if(lights, [](const auto& light) { return light.direction.y < 0.1; });
    EXPECT_EQ(sheet_layout(lights)[0].row, 0);
    const auto one = sheet_layout({{"", {0, -1, 0}}});
    EXPECT_EQ(one[0].row, 0);
    EXPECT_EQ(one[0].column, 0);
}

TEST(ContactSheet, exposure_follows_the_brightest_lamp_and_not_the_dark_ones) {
    for (const float scale : {0.001f, 1.0f, 500.0f}) {
        ContactSheet sheet({{"", {0, 1, 0}}, {"", {0, 0, 1}}}, 40, 30);
        Image bright(40, 30, 3), dark(40, 30, 3);
        std::fill(bright.data.begin(), bright.data.end(), scale);
        std::fill(dark.data.begin(), dark.data.end(), scale / 1000);
        sheet.add(0, dark);
        sheet.add(1, bright);
        const auto picture = sheet.picture("", 0);
        EXPECT_NEAR(picture.gain * scale, 0.9, 1e-6);
        // 0.9 is 0.811 after the tone curve, code 0.911 in sRGB.
        EXPECT_NEAR(brightest(picture), 232, 1);
        EXPECT_NEAR(sheet.picture("", 1).gain, 2 * picture.gain, 1e-9 * picture.gain);
    }
}

TEST(ContactSheet, pictures_are_cut_to_what_any_lamp_shows) {
    const auto size_with = [](std::initializer_list<std::pair<int, int>> corners) {
        ContactSheet sheet({{"", {0, 1, 0}}, {"", {0, 0, 1}}}, 400, 300);
        int lamp = 0;
        for (const auto& [left, top] : corners) {
            Image image(400, 300, 3);
            for (int y = top; y < top + 60; ++y)
                for (int x = left; x < left + 40; ++x) image.at(x, y, 1) = 2;
            image.at(3, 5, 0) = 2;  // a hot pixel is no subject
            sheet.add(lamp++, image);
        }
        const auto picture = sheet.picture("", 0);
        return std::pair(picture.width, picture.height);
    };
    const auto [narrow_width, narrow_height] = size_with({{100, 100}, {100, 100}});
    const auto [wide_width, wide_height] = size_with({{100, 100}, {260, 200}});
    // The box of both grows by 160 x 100 pixels; there is one column of two rows.
    EXPECT_EQ(wide_width - narrow_width, 160);
    EXPECT_EQ(wide_height - narrow_height, 2 * 100);
}

TEST(ContactSheet, a_take_of_black_or_of_nan_is_drawn_black) {
    ContactSheet sheet({{"", {0, 1, 0}}}, 40, 30);
    Image image(40, 30, 3);
    image.data[7] = std::nanf("");
    sheet.add(0, image);
    const auto picture = sheet.picture("", 0);
    EXPECT_EQ(picture.rgb8.size(), size_t(picture.width) * picture.height * 3);
    EXPECT_EQ(picture.gain, 1);
}

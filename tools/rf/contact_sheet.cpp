// SPDX-License-Identifier: MIT
// Layout, exposure and drawing of contact sheets.
#include "contact_sheet.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <numbers>
#include <opencv2/imgproc.hpp>

#include "image/tone.hpp"

namespace ols {

namespace {

constexpr int sheet_width = 3600, gap = 6, margin = 40, title_height = 64, largest_kept_width = 480;
const cv::Scalar background(16, 16, 18), ink(200, 200, 200), shade(0, 0, 0);

double degrees(double radians) {
    return radians * 180 / std::numbers::pi;
}

cv::Mat mat_of(const Image& rgb) {
    return {rgb.height, rgb.width, CV_32FC3, const_cast<float*>(rgb.data.data())};
}

// Brings the value that half a percent of all samples exceed to 0.9.
double common_gain(const std::vector<Image>& images) {
    std::vector<float> values;
    for (const auto& image : images) values.insert(values.end(), image.data.begin(), image.data.end());
    std::erase_if(values, [](float v) { return !std::isfinite(v); });
    if (values.empty()) return 1;
    const auto bright = values.begin() + std::ptrdiff_t(double(values.size() - 1) * 0.995);
    std::nth_element(values.begin(), bright, values.end());
    return *bright > 0 ? 0.9 / *bright : 1;
}

// The box of what any lamp shows, a twentieth of the picture wider on every side. Single noisy pixels do not count: the
// brightest of all lamps is taken, and of that the median of 5 x 5 pixels.
cv::Rect subject_box(const std::vector<Image>& images, double gain, int width, int height) {
    cv::Mat brightest(height, width, CV_32F, cv::Scalar(0));
    for (const auto& image : images) {
        if (image.data.empty()) continue;
        for (int p = 0; p < width * height; ++p) {
            float& most = brightest.ptr<float>()[p];
            for (int c = 0; c < 3; ++c) most = std::max(most, image.data[size_t(p) * 3 + c]);
        }
    }
    cv::medianBlur(brightest, brightest, 5);
    const cv::Mat shown = brightest > 0.03 / gain;
    cv::Rect box = cv::boundingRect(shown);
    if (box.empty()) return {0, 0, width, height};
    box -= cv::Point(width / 20, height / 20);
    box += cv::Size(width / 10, height / 10);
    return box & cv::Rect(0, 0, width, height);
}

// Light letters on a dark edge, readable on skin and on black.
void write_text(cv::Mat& place, const std::string& text, cv::Point at, double scale) {
    cv::putText(place, text, at, cv::FONT_HERSHEY_SIMPLEX, scale, shade, 3, cv::LINE_AA);
    cv::putText(place, text, at, cv::FONT_HERSHEY_SIMPLEX, scale, ink, 1, cv::LINE_AA);
}

}  // namespace

std::vector<SheetCell> sheet_layout(const std::vector<LightPosition>& lights) {
    const double spacing = degrees(std::sqrt(4 * std::numbers::pi / double(lights.size())));
    std::map<long, std::vector<int>> rows;  // by band of elevation, top first
    for (int i = 0; i < int(lights.size()); ++i) {
        const double from_top = degrees(std::acos(std::clamp(lights[i].direction.y, -1.0, 1.0)));
        rows[std::lround(from_top / (0.9 * spacing))].push_back(i);
    }
    const auto azimuth = [&](int lamp) {
        const Vec3 d = lights[lamp].direction;
        return std::atan2(d.x, d.z);
    };
    std::vector<SheetCell> cells(lights.size());
    int row = 0;
    for (auto& [band, lamps] : rows) {
        std::stable_sort(lamps.begin(), lamps.end(), [&](int a, int b) { return azimuth(a) < azimuth(b); });
        for (size_t k = 0; k < lamps.size(); ++k) cells[lamps[k]] = {row, double(k) - double(lamps.size() - 1) / 2};
        ++row;
    }
    return cells;
}

ContactSheet::ContactSheet(const std::vector<LightPosition>& lights, int image_width, int image_height)
    : cells_(sheet_layout(lights)),
      kept_width_(std::min(image_width, largest_kept_width)),
      kept_height_(std::max(1, int(std::lround(double(kept_width_) * image_height / image_width)))),
      kept_(lights.size()) {}

void ContactSheet::add(int lamp, const Image& rgb) {
    kept_[lamp] = Image(kept_width_, kept_height_, 3);
    cv::Mat small = mat_of(kept_[lamp]);
    cv::resize(mat_of(rgb), small, small.size(), 0, 0, cv::INTER_AREA);
}

ContactSheet::Picture ContactSheet::picture(const std::string& title, double exposure_ev) const {
    const double common = common_gain(kept_), gain = common * std::exp2(exposure_ev);
    const cv::Rect cut = subject_box(kept_, common, kept_width_, kept_height_);

    double widest = 0;
    int rows = 0;
    for (const auto& cell : cells_) widest = std::max(widest, cell.column), rows = std::max(rows, cell.row + 1);
    const int columns = int(2 * widest) + 1;
    const int cell_width = std::clamp((sheet_width - 2 * margin) / columns - gap, 16, std::max(16, cut.width));
    const int cell_height = std::max(1, int(std::lround(double(cell_width) * cut.height / cut.width)));
    const int width = 2 * margin + columns * (cell_width + gap);
    const int height = margin + title_height + rows * (cell_height + gap) + margin;
    cv::Mat sheet(height, width, CV_8UC3, background);
    write_text(sheet, title, {margin, margin + 24}, 0.9);

    const double label_scale = std::clamp(cell_width / 400.0, 0.35, 0.6);
    for (size_t i = 0; i < kept_.size(); ++i) {
        if (kept_[i].data.empty()) continue;
        Image exposed(cell_width, cell_height, 3);
        cv::Mat pixels = mat_of(exposed);
        cv::resize(mat_of(kept_[i])(cut), pixels, pixels.size(), 0, 0, cv::INTER_AREA);
        for (float& v : exposed.data) v *= float(gain);
        auto shown = tone_mapped_rgb8(exposed);
        const int x = int(std::lround(width / 2.0 + cells_[i].column * (cell_width + gap) - cell_width / 2.0));
        const int y = margin + title_height + cells_[i].row * (cell_height + gap);
        cv::Mat place = sheet(cv::Rect(x, y, cell_width, cell_height));
        cv::Mat(cell_height, cell_width, CV_8UC3, shown.data()).copyTo(place);
        write_text(place, fmt::format("{:03}", i), {5, cell_height - 6}, label_scale);
    }
    return {width, height, {sheet.data, sheet.data + sheet.total() * 3}, gain};
}

}  // namespace ols

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

constexpr int sheet_width = 3600, gap = 6, margin = 40, title_height = 64;
const cv::Scalar background(16, 16, 18), ink(200, 200, 200);

double degrees(double radians) {
    return radians * 180 / std::numbers::pi;
}

cv::Mat mat_of(const Image& rgb) {
    return {rgb.height, rgb.width, CV_32FC3, const_cast<float*>(rgb.data.data())};
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
    : cells_(sheet_layout(lights)), thumbs_(lights.size()) {
    double widest = 0;
    for (const auto& cell : cells_) widest = std::max(widest, cell.column);
    const int columns = int(2 * widest) + 1;
    thumb_width_ = std::clamp((sheet_width - 2 * margin) / columns - gap, 16, std::min(image_width, 480));
    thumb_height_ = std::max(1, int(std::lround(double(thumb_width_) * image_height / image_width)));
}

void ContactSheet::add(int lamp, const Image& rgb) {
    thumbs_[lamp] = Image(thumb_width_, thumb_height_, 3);
    cv::Mat small = mat_of(thumbs_[lamp]);
    cv::resize(mat_of(rgb), small, small.size(), 0, 0, cv::INTER_AREA);
}

ContactSheet::Picture ContactSheet::picture(const std::string& title, double exposure_ev) const {
    std::vector<float> values;
    for (const auto& thumb : thumbs_) values.insert(values.end(), thumb.data.begin(), thumb.data.end());
    std::erase_if(values, [](float v) { return !std::isfinite(v); });
    double gain = std::exp2(exposure_ev);
    if (!values.empty()) {
        const auto bright = values.begin() + std::ptrdiff_t(double(values.size() - 1) * 0.995);
        std::nth_element(values.begin(), bright, values.end());
        if (*bright > 0) gain *= 0.9 / *bright;
    }

    double widest = 0;
    int rows = 0;
    for (const auto& cell : cells_) widest = std::max(widest, cell.column), rows = std::max(rows, cell.row + 1);
    const int width = 2 * margin + int(2 * widest + 1) * (thumb_width_ + gap);
    const int height = margin + title_height + rows * (thumb_height_ + gap) + margin;
    cv::Mat sheet(height, width, CV_8UC3, background);
    cv::putText(sheet, title, {margin, margin + 24}, cv::FONT_HERSHEY_SIMPLEX, 0.9, ink, 1, cv::LINE_AA);

    const double label_scale = std::clamp(thumb_width_ / 400.0, 0.3, 0.6);
    for (size_t i = 0; i < thumbs_.size(); ++i) {
        Image exposed = thumbs_[i];
        for (float& v : exposed.data) v *= float(gain);
        auto shown = tone_mapped_rgb8(exposed);
        const int x = int(std::lround(width / 2.0 + cells_[i].column * (thumb_width_ + gap) - thumb_width_ / 2.0));
        const int y = margin + title_height + cells_[i].row * (thumb_height_ + gap);
        cv::Mat place = sheet(cv::Rect(x, y, thumb_width_, thumb_height_));
        cv::Mat(thumb_height_, thumb_width_, CV_8UC3, shown.data()).copyTo(place);
        cv::putText(place, fmt::format("{:03}", i), {4, thumb_height_ - 5}, cv::FONT_HERSHEY_SIMPLEX, label_scale, ink,
                    1, cv::LINE_AA);
    }
    return {width, height, {sheet.data, sheet.data + sheet.total() * 3}, gain};
}

}  // namespace ols

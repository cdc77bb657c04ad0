// SPDX-License-Identifier: MIT
// Tiles pasted into one picture.
#include "align_sheet.hpp"

#include <algorithm>
#include <opencv2/imgproc.hpp>

#include "align_score.hpp"
#include "image/demosaic.hpp"
#include "image/png.hpp"
#include "image/tone.hpp"

namespace ols {

namespace {

constexpr double shown_difference = 0.1;  // of the peak
constexpr int title_height = 18;

// The brightest part of the truth at three quarters, through the preview's tone curve.
cv::Mat picture(const Image& mosaic, Cfa cfa, double peak) {
    Image rgb = as_rgb(mosaic, cfa);
    for (float& v : rgb.data) v *= float(0.75 / peak);
    const std::vector<uint8_t> bytes = tone_mapped_rgb8(rgb);
    return cv::Mat(rgb.height, rgb.width, CV_8UC3, const_cast<uint8_t*>(bytes.data())).clone();
}

cv::Mat difference(const Image& mosaic, const Image& truth, double peak) {
    cv::Mat grey(truth.height, truth.width, CV_8UC3);
    for (size_t p = 0; p < truth.data.size(); ++p) {
        const double off = double(mosaic.data[p] - truth.data[p]) / (shown_difference * peak);
        const auto level = uint8_t(std::clamp(127.5 + 127.5 * off, 0.0, 255.0));
        std::fill_n(grey.data + 3 * p, 3, level);
    }
    return grey;
}

}  // namespace

Status write_align_sheet(const std::string& path, Cfa cfa, const std::vector<SheetBand>& bands, const Box& box,
                         int enlarge) {
    const int width = box.width * enlarge, height = box.height * enlarge, tall = height + title_height;
    cv::Mat sheet(2 * tall * int(bands.size()), width * int(bands.front().pictures.size() + 1), CV_8UC3,
                  cv::Scalar::all(0));
    const auto paste = [&](const cv::Mat& whole, size_t column, size_t row, const std::string& title, int how) {
        const int x = int(column) * width, y = int(row) * tall;
        cv::Mat large;
        cv::resize(whole(cv::Rect(box.x, box.y, box.width, box.height)), large, cv::Size(width, height), 0, 0, how);
        large.copyTo(sheet(cv::Rect(x, y + title_height, width, height)));
        cv::putText(sheet, title, cv::Point(x + 4, y + title_height - 5), cv::FONT_HERSHEY_SIMPLEX, 0.42,
                    cv::Scalar::all(255), 1, cv::LINE_AA);
    };
    for (size_t b = 0; b < bands.size(); ++b) {
        const SheetBand& band = bands[b];
        const double peak = percentile(band.truth.data, 0.999);
        paste(picture(band.truth, cfa, peak), 0, 2 * b, band.name + ": truth", cv::INTER_CUBIC);
        for (size_t i = 0; i < band.pictures.size(); ++i) {
            const SheetPicture& one = band.pictures[i];
            paste(picture(one.relit, cfa, peak), i + 1, 2 * b, one.name, cv::INTER_CUBIC);
            paste(difference(one.relit, band.truth, peak), i + 1, 2 * b + 1, one.name + " - truth", cv::INTER_NEAREST);
        }
    }
    return write_png(path, sheet.cols, sheet.rows, {sheet.data, sheet.total() * 3});
}

}  // namespace ols

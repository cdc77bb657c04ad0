// SPDX-License-Identifier: MIT
// PNG writing through OpenCV's encoder.
#include "image/png.hpp"

#include <cassert>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include "exceptions.hpp"
#include "image/tone.hpp"
#include "image/whole_file.hpp"

namespace ols {

Status write_png(const std::string& path, int width, int height, std::span<const uint8_t> rgb8) {
    assert(rgb8.size() == size_t(width) * height * 3);
    std::vector<uint8_t> encoded;
    try {
        // The encoder takes B G R and does not write to its input.
        const cv::Mat rgb(height, width, CV_8UC3, const_cast<uint8_t*>(rgb8.data()));
        cv::Mat bgr;
        cv::cvtColor(rgb, bgr, cv::COLOR_RGB2BGR);
        cv::imencode(".png", bgr, encoded);
    } catch (const cv::Exception& e) {
        return fail("cannot write '" + path + "': " + words_of(e));
    }
    return write_whole_file(path, std::string_view(reinterpret_cast<const char*>(encoded.data()), encoded.size()));
}

Status write_png_preview(const std::string& path, const Image& scene_linear) {
    return write_png(path, scene_linear.width, scene_linear.height, tone_mapped_rgb8(scene_linear));
}

}  // namespace ols

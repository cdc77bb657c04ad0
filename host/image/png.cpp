// SPDX-License-Identifier: MIT
// PNG writing through OpenCV's encoder.
#include "image/png.hpp"

#include <unistd.h>

#include <cassert>
#include <filesystem>
#include <fstream>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include "image/tone.hpp"

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
        return fail("cannot write '" + path + "': " + e.what());
    }
    const std::string temporary = path + ".part" + std::to_string(getpid());
    std::ofstream file(temporary, std::ios::binary);
    file.write(reinterpret_cast<const char*>(encoded.data()), std::streamsize(encoded.size()));
    file.close();
    std::error_code error;
    if (file) std::filesystem::rename(temporary, path, error);
    if (!file || error) {
        std::error_code ignored;
        std::filesystem::remove(temporary, ignored);
        return fail("cannot write '" + path + "': check that the folder exists and has space");
    }
    return Done{};
}

Status write_png_preview(const std::string& path, const Image& scene_linear) {
    return write_png(path, scene_linear.width, scene_linear.height, tone_mapped_rgb8(scene_linear));
}

}  // namespace ols

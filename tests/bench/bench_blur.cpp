// SPDX-License-Identifier: MIT
// Motion blur: sub-frames of a moved sheet, beside the two usual ways of blurring along flow.
// links: ols_relight opencv_imgproc
#include <cmath>
#include <opencv2/imgproc.hpp>

#include "../unit/blur_scene.hpp"
#include "bench.hpp"
#include "image/compare.hpp"
#include "relight/exposure_path.hpp"
#include "relight/motion_blur.hpp"

using namespace ols;

namespace {

constexpr double fps = 24, half_s = 0.25 / fps;  // 180 degrees
constexpr int line_samples = 32;                 // of the peers; the longest path is 25 pixels

// Calls `visit` with where each pixel is at the middles of equal parts of every piece of its path.
template <typename Visit>
void along_paths(const ExposurePath& path, Visit visit) {
    const size_t pieces = path.pieces(), count = line_samples / pieces;
    for (size_t k = 0; k < pieces; ++k)
        for (size_t n = 0; n < count; ++n) {
            const float f = (float(n) + 0.5f) / float(count);
            FlowField moved = path.moved[k];
            for (size_t p = 0; p < moved.size(); ++p) {
                moved.u[p] += f * (path.moved[k + 1].u[p] - moved.u[p]);
                moved.v[p] += f * (path.moved[k + 1].v[p] - moved.v[p]);
            }
            visit(moved, path.piece_s(k) / double(count) / (2 * half_s));
        }
}

// Gathering: each pixel is the mean of the picture along its own path, backwards.
Image gathered(const Image& sharp, const TargetMotion& motion) {
    const cv::Mat from(sharp.height, sharp.width, CV_32FC3, const_cast<float*>(sharp.data.data()));
    cv::Mat sum = cv::Mat::zeros(from.size(), CV_32FC3), x(from.size(), CV_32F), y(from.size(), CV_32F), seen;
    along_paths(exposure_path(motion, -half_s, half_s), [&](const FlowField& moved, double weight) {
        for (int p = 0; p < int(moved.size()); ++p) {
            x.at<float>(p / sharp.width, p % sharp.width) = float(p % sharp.width) - moved.u[size_t(p)];
            y.at<float>(p / sharp.width, p % sharp.width) = float(p / sharp.width) - moved.v[size_t(p)];
        }
        cv::remap(from, seen, x, y, cv::INTER_LINEAR, cv::BORDER_REPLICATE);
        sum += seen * weight;
    });
    Image result(sharp.width, sharp.height, 3);
    std::copy_n(sum.ptr<float>(), result.data.size(), result.data.begin());
    return result;
}

// Drawing: each pixel is spread over its path, anti-aliased, and every pixel divided by what it got (Brostow and Essa 2001; Wenger
// et al. 2005, section 6.2).
Image drawn(const Image& sharp, const TargetMotion& motion) {
    Image sum(sharp.width, sharp.height, 4);
    const auto add = [&](int x, int y, float weight, const float* color) {
        if (x < 0 || y < 0 || x >= sharp.width || y >= sharp.height) return;
        for (int c = 0; c < 3; ++c) sum.at(x, y, c) += weight * color[c];
        sum.at(x, y, 3) += weight;
    };
    along_paths(exposure_path(motion, -half_s, half_s), [&](const FlowField& moved, double weight) {
        for (int p = 0; p < int(moved.size()); ++p) {
            const float x = float(p % sharp.width) + moved.u[size_t(p)],
                        y = float(p / sharp.width) + moved.v[size_t(p)];
            const int x0 = int(std::floor(x)), y0 = int(std::floor(y));
            const float fx = x - float(x0), fy = y - float(y0), w = float(weight);
            const float* color = &sharp.data[size_t(p) * 3];
            add(x0, y0, w * (1 - fx) * (1 - fy), color);
            add(x0 + 1, y0, w * fx * (1 - fy), color);
            add(x0, y0 + 1, w * (1 - fx) * fy, color);
            add(x0 + 1, y0 + 1, w * fx * fy, color);
        }
    });
    Image result(sharp.width, sharp.height, 3);
    for (size_t p = 0; p < sharp.data.size() / 3; ++p)
        for (size_t c = 0; c < 3; ++c)
            result.data[p * 3 + c] =
                sum.data[p * 4 + 3] > 0 ? sum.data[p * 4 + c] / sum.data[p * 4 + 3] : sharp.data[p * 3 + c];
    return result;
}

void measure_steps(Bench& bench) {
    test::DiscScene scene;
    if (bench.full()) scene.width = 640, scene.height = 480, scene.radius = 130;
    const Image sharp = scene.at(0), truth = scene.brute_force(-half_s, half_s, bench.full() ? 400 : 20);
    const TargetMotion motion = scene.motion(2);
    Image result;
    const auto error = [&] { return 100 * image_difference(result, truth).rms; };
    std::vector<Setting> settings = {{"not blurred", [&] { result = sharp; }, error},
                                     {"gathered along own path", [&] { result = gathered(sharp, motion); }, error},
                                     {"drawn lines", [&] { result = drawn(sharp, motion); }, error}};
    for (const auto& [name, step] :
         {std::pair{"8", 8.0}, {"4", 4.0}, {"2", 2.0}, {"1", 1.0}, {"0.5", 0.5}, {"0.25", 0.25}})
        settings.push_back(
            {name, [&, step] { result = motion_blurred(sharp, motion, fps, {.step_px = step, .threads = 1})->image; },
             error});
    bench.measure({.name = "blur step, px",
                   .set_by = "`rf relight --blur-step`, `MotionBlurOptions::step_px`",
                   .error_unit = "% of white rms",
                   .peer = "drawn lines",
                   .default_setting = "1",
                   .settings = settings});
}

}  // namespace

int main(int argc, char** argv) {
    Bench bench(argc, argv,
                {.name = "blur",
                 .truth = "A textured disc of 260 pixels passes in front of a textured wall on a curved path, 25 "
                          "pixels in a shutter of 180 "
                          "degrees; 640 x 480 in three channels, on one thread. Truth is the mean of 400 sub-frames of "
                          "the scene itself. "
                          "The peers take 32 samples of each path.",
                 .advice = "The default is within a tenth of the limit, which is what a single sharp picture can tell: "
                           "the disc's border to "
                           "half a pixel, and not what is behind it. Take 4 for previews."});
    measure_steps(bench);
    return bench.finish();
}

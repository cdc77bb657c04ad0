// SPDX-License-Identifier: MIT
// Warping a cycle's slots to one target: beside OpenCV, by how straight motion must be, and from flow of lower resolution.
// links: ols_develop
#include <cmath>
#include <opencv2/imgproc.hpp>
#include <random>

#include "bench.hpp"
#include "demultiplex/masked_sample.hpp"
#include "develop/warp.hpp"

using namespace ols;

namespace {

struct Size {
    int width, height, slots;
    double radius() const { return 0.48 * height; }
};

constexpr int groups = 10, band_rows = 8;

// A ball that turns before a wall at rest, by up to 4 pixels from tracking frame to tracking frame and rolling a little; the
// target is one and a half such steps away. In closed form: x, y in the frame's pixels.
cv::Point2d step_at(const Size& size, double x, double y) {
    const double dx = x - size.width / 2.0, dy = y - size.height / 2.0;
    const double depth = 1 - (dx * dx + dy * dy) / (size.radius() * size.radius());
    return depth > 0 ? cv::Point2d(4 * std::sqrt(depth) - 0.006 * dy, 0.006 * dx) : cv::Point2d(0, 0);
}

// step_at() times `scale`, at a resolution `lower` times lower than the frame's.
FlowField field(const Size& size, int lower, double scale) {
    FlowField flow(size.width / lower, size.height / lower);
    for (int y = 0; y < flow.height; ++y)
        for (int x = 0; x < flow.width; ++x) {
            const cv::Point2d step = step_at(size, (x + 0.5) * lower - 0.5, (y + 0.5) * lower - 0.5);
            const size_t at = size_t(y) * size_t(flow.width) + size_t(x);
            flow.u[at] = float(scale * step.x / lower);
            flow.v[at] = float(scale * step.y / lower);
        }
    return flow;
}

constexpr double base_scale = 1.5;

float fraction_of(int slot) {
    return (float(slot % 16) + 0.5f) / 18;
}

// Skin-like texture of 12 bits, differently bright in every slot.
std::vector<std::vector<int16_t>> make_slots(const Size& size) {
    std::mt19937 random(7);
    std::vector<std::vector<int16_t>> slots;
    for (int s = 0; s < size.slots; ++s) {
        cv::Mat noise(size.height, size.width, CV_32F);
        for (auto& value : cv::Mat_<float>(noise)) value = float(random() % 4096);
        cv::GaussianBlur(noise, noise, {}, 1.5);
        std::vector<int16_t> counts;
        for (const float value : cv::Mat_<float>(noise)) counts.push_back(int16_t(std::clamp(value, 0.0f, 4095.0f)));
        slots.push_back(std::move(counts));
    }
    return slots;
}

CountPlane plane(const Size& size, const std::vector<int16_t>& counts) {
    return {counts.data(), {size.width, size.height}, size_t(size.width)};
}

// Band by band as the inversion takes them: all slots' rows of a band stay in the cache.
void warp_slots(const Size& size, const std::vector<std::vector<int16_t>>& slots, const GroupMotion& motion,
                std::vector<int16_t>& band) {
    band.resize(size_t(size.slots) * size_t(band_rows * size.width));
    for (int y = 0; y < size.height; y += band_rows)
        for (int s = 0; s < size.slots; ++s)
            warp_counts(plane(size, slots[size_t(s)]), motion, fraction_of(s), {y, band_rows},
                        &band[size_t(s) * size_t(band_rows * size.width)], size_t(size.width));
}

// Against bilinear interpolation in double precision at the exact positions, where these are within the plane.
double error_of(const Size& size, const std::vector<int16_t>& counts, int slot, const int16_t* warped) {
    double squares = 0;
    int count = 0;
    const double scale = base_scale + double(fraction_of(slot));
    for (int y = 0; y < size.height; ++y)
        for (int x = 0; x < size.width; ++x) {
            const cv::Point2d step = step_at(size, x, y);
            const double px = x + scale * step.x, py = y + scale * step.y;
            if (!(px >= 0 && py >= 0 && px < size.width - 1 && py < size.height - 1)) continue;
            const int ix = int(px), iy = int(py);
            const double fx = px - ix, fy = py - iy;
            const int16_t* const at = &counts[size_t(iy) * size_t(size.width) + size_t(ix)];
            const int16_t* const below = at + size.width;
            const double truth =
                (1 - fy) * ((1 - fx) * at[0] + fx * at[1]) + fy * ((1 - fx) * below[0] + fx * below[1]);
            const int16_t got = warped[size_t(y) * size_t(size.width) + size_t(x)];
            if (got == masked_sample<int16_t>) continue;  // the position was within, by a rounding
            squares += (got - truth) * (got - truth);
            ++count;
        }
    return std::sqrt(squares / count);
}

constexpr int judged_slot = 3;

double error_of(const Size& size, const std::vector<std::vector<int16_t>>& slots, const GroupMotion& motion) {
    const auto& counts = slots[judged_slot];
    std::vector<int16_t> out(counts.size());
    warp_counts(plane(size, counts), motion, fraction_of(judged_slot), out.data(), size_t(size.width));
    return error_of(size, counts, judged_slot, out.data());
}

// OpenCV's fixed-point maps (1/32 pixel) for one slot.
struct FixedMaps {
    cv::Mat whole, weights;

    FixedMaps(const FlowField& base, const FlowField& step, float fraction) {
        cv::Mat x(base.height, base.width, CV_32F), y(base.height, base.width, CV_32F);
        for (int row = 0; row < base.height; ++row)
            for (int column = 0; column < base.width; ++column) {
                const size_t at = size_t(row) * size_t(base.width) + size_t(column);
                x.at<float>(row, column) = float(column) + base.u[at] + fraction * step.u[at];
                y.at<float>(row, column) = float(row) + base.v[at] + fraction * step.v[at];
            }
        cv::convertMaps(x, y, whole, weights, CV_16SC2);
    }
};

cv::Mat remapped(const Size& size, const std::vector<int16_t>& counts, const FixedMaps& maps) {
    const cv::Mat source(size.height, size.width, CV_16S, const_cast<int16_t*>(counts.data()));
    cv::Mat out;
    cv::remap(source, out, maps.whole, maps.weights, cv::INTER_LINEAR);
    return out;
}

Setting remap_setting(const Size& size, const std::vector<std::vector<int16_t>>& slots, const FlowField& base,
                      const FlowField& step, std::vector<FixedMaps> given) {
    const std::string name = given.empty() ? "cv::remap, maps made" : "cv::remap, maps given";
    const auto run = [&size, &slots, &base, &step, given = std::move(given)] {
        for (size_t s = 0; s < slots.size(); ++s)
            static_cast<void>(given.empty() ? remapped(size, slots[s], FixedMaps(base, step, fraction_of(int(s))))
                                            : remapped(size, slots[s], given[s % given.size()]));
    };
    const auto error = [&size, &slots, &base, &step] {
        const cv::Mat out = remapped(size, slots[judged_slot], FixedMaps(base, step, fraction_of(judged_slot)));
        return error_of(size, slots[judged_slot], judged_slot, out.ptr<int16_t>());
    };
    return {name, run, error};
}

void measure_resolutions(Bench& bench, const Size& size, const std::vector<std::vector<int16_t>>& slots) {
    std::vector<std::pair<FlowField, FlowField>> fields;
    for (const int lower : {1, 2, 4}) fields.emplace_back(field(size, lower, base_scale), field(size, lower, 1));
    std::vector<Setting> resolutions;
    for (size_t i = 0; i < fields.size(); ++i) {
        const auto make = [&, i] {
            return GroupMotion(fields[i].first, fields[i].second, SampleGrid{size.width, size.height});
        };
        resolutions.push_back({i == 0   ? "full"
                               : i == 1 ? "half"
                                        : "quarter",
                               [make] {
                                   std::vector<GroupMotion> made;
                                   for (int g = 0; g < groups; ++g) made.push_back(make());
                               },
                               [&, make] { return error_of(size, slots, make()); }});
    }
    bench.measure({.name = "resolution of flow, ten groups made",
                   .set_by = "`GroupMotion`, the fields' size",
                   .error_unit = "counts rms",
                   .peer = "full",
                   .default_setting = "full",
                   .settings = resolutions});
}

}  // namespace

int main(int argc, char** argv) {
    require_freed_planes("bench_warp");
    cv::setNumThreads(1);
    Bench bench(
        argc, argv,
        {.name = "warp",
         .truth =
             "156 slots of 640 x 480, 12 bits, warped to one target by a ball's turning before a wall, each by its "
             "own fraction of a step, in bands of 8 rows. The error is against bilinear interpolation in double "
             "precision at the exact positions; rounding to counts alone makes 0.29. On one core.",
         .advice = "A step is the distance of two samples of a colour, here a pixel. The default tolerance errs less "
                   "than flow does. Flow at half resolution "
                   "is for where its estimate takes the time; its error sits at edges of motion."});
    const Size size = bench.full() ? Size{640, 480, 156} : Size{96, 64, 6};
    const auto slots = make_slots(size);
    const FlowField base = field(size, 1, base_scale), step = field(size, 1, 1);
    std::vector<FixedMaps> given;
    for (int s = 0; s < 4; ++s) given.emplace_back(base, step, fraction_of(s));
    std::vector<int16_t> band;

    std::vector<GroupMotion> motions;
    const std::vector<std::pair<std::string, float>> tolerances{
        {"0", 0.0f}, {"0.02", 0.02f}, {"0.05", 0.05f}, {"0.1", 0.1f}, {"0.2", 0.2f}};
    for (const auto& [name, tolerance] : tolerances) motions.emplace_back(base, step, tolerance);
    std::vector<Setting> settings{remap_setting(size, slots, base, step, given),
                                  remap_setting(size, slots, base, step, {})};
    for (size_t i = 0; i < tolerances.size(); ++i)
        settings.push_back({tolerances[i].first, [&, i] { warp_slots(size, slots, motions[i], band); },
                            [&, i] { return error_of(size, slots, motions[i]); }});
    bench.measure({.name = "tolerance of lines, steps",
                   .set_by = "`GroupMotion`, `tolerance_steps`",
                   .error_unit = "counts rms",
                   .peer = "cv::remap, maps given",
                   .default_setting = "0.1",
                   .settings = settings});

    measure_resolutions(bench, size, slots);
    return bench.finish();
}

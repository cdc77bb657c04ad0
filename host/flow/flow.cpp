// SPDX-License-Identifier: MIT
// What every method needs of its input: sizes that fit, finite values, one exposure; and the methods by name.
#include "flow/flow.hpp"

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>
#include <utility>

#include "flow/brightness_range.hpp"

namespace ols {

namespace {

constexpr int smallest_side = 16;  // pixels: less is less than two patches

cv::Mat mat_of(const Image& image) {
    return cv::Mat(image.height, image.width, CV_32F, const_cast<float*>(image.data.data()));
}

bool sees(float value, float saturation) {
    constexpr float most = std::numeric_limits<float>::max();
    return (value >= -most) & (value <= most) & (value < saturation);  // false of what is no number
}

// The usual image, in one pass that the compiler makes vectors of.
bool sees_all(const Image& image, float saturation) {
    unsigned unseen = 0;
    for (const float value : image.data) unseen += !sees(value, saturation);
    return unseen == 0;
}

// Marks what is not seen and two pixels around it, as far as derivatives reach, and fills it with the mean of what is seen
// nearby. Empty when all is seen.
Image hide_unseen(Image& image, float saturation) {
    constexpr double nearby = 4;  // pixels
    if (sees_all(image, saturation)) return {};
    Image seen(image.width, image.height, 1);
    double sum = 0, count = 0;
    for (size_t p = 0; p < image.data.size(); ++p) {
        seen.data[p] = sees(image.data[p], saturation) ? 1.0f : 0.0f;
        if (seen.data[p] != 0)
            sum += image.data[p], count++;
        else
            image.data[p] = 0;
    }
    const float mean = count > 0 ? float(sum / count) : 0;
    cv::Mat values, weights;
    cv::GaussianBlur(mat_of(image), values, {0, 0}, nearby, nearby, cv::BORDER_REPLICATE);
    cv::GaussianBlur(mat_of(seen), weights, {0, 0}, nearby, nearby, cv::BORDER_REPLICATE);
    constexpr float doubt = 1e-3f;  // of the mean of all, where nothing is near
    for (int y = 0; y < image.height; ++y)
        for (int x = 0; x < image.width; ++x)
            if (seen.at(x, y) == 0)
                image.at(x, y) = (values.at<float>(y, x) + doubt * mean) / (weights.at<float>(y, x) + doubt);
    Image eroded(image.width, image.height, 1);
    cv::Mat target = mat_of(eroded);
    cv::erode(mat_of(seen), target, cv::Mat::ones(5, 5, CV_8U));
    return eroded;
}

// Between the hundredths at either end, of means over 4 x 4 pixels, which noise and glints do not rule; between the extremes
// where a subject is smaller than that and all else even.
BrightnessRange brightness_range(const Image& image) {
    cv::Mat small;
    cv::resize(mat_of(image), small, {image.width / 4, image.height / 4}, 0, 0, cv::INTER_AREA);
    std::vector<float> values(small.begin<float>(), small.end<float>());
    const BrightnessRange range = range_without(values, values.size() / 100);
    return range.high > range.low ? range : range_without(values, 0);
}

// Brings an image to a range of about 0 to 1. Each by its own range: exposures may differ. False where it is even: there is
// nothing to find.
bool equalize_exposure(Image& image) {
    const BrightnessRange range = brightness_range(image);
    const float scale = 1 / (range.high - range.low);
    if (!(range.high > range.low) || !std::isfinite(scale)) return false;
    for (float& v : image.data) v = (v - range.low) * scale;
    return true;
}

Status check(const Image& from, const Image& to, const FlowField* initial) {
    const auto size = [](int w, int h) { return std::to_string(w) + " x " + std::to_string(h); };
    if (from.channels != 1 || to.channels != 1) return fail("flow: images must have one channel: give their luminance");
    if (from.width != to.width || from.height != to.height)
        return fail("flow: images of " + size(from.width, from.height) + " and " + size(to.width, to.height) +
                    " pixels: give two of the same size");
    if (from.width < smallest_side || from.height < smallest_side)
        return fail("flow: images of " + size(from.width, from.height) + " pixels: at least 16 a side are needed");
    if (!initial) return Done{};
    if (initial->width != from.width || initial->height != from.height)
        return fail("flow: an initial flow of " + size(initial->width, initial->height) + " for images of " +
                    size(from.width, from.height) + " pixels: resize it");
    for (const std::vector<float>* plane : {&initial->u, &initial->v})
        if (!std::all_of(plane->begin(), plane->end(), [](float v) { return std::isfinite(v); }))
            return fail(
                "flow: the initial flow has vectors that are no numbers: set them to what surrounds them, or zero");
    return Done{};
}

Status check(const DisFlowOptions& o) {
    if (o.finest_scale < 0 || o.patch_size < 4 || o.patch_stride < 1 || o.patch_stride > o.patch_size ||
        o.iterations < 1)
        return fail(
            "flow: DIS needs finest_scale >= 0, patch_size >= 4, patch_stride from 1 to patch_size, iterations >= 1");
    if (o.refinements < 0 || o.final_refinements < 0 || !(o.smoothness > 0 && o.brightness >= 0 && o.gradient >= 0))
        return fail("flow: DIS needs refinements >= 0, smoothness > 0, weights of brightness and gradient >= 0");
    if (!o.search && o.final_refinements == 0)
        return fail("flow: DIS without search and without final refinements does nothing: ask for one of them");
    return Done{};
}

Status check_detail(const FlowDetail& detail) {
    if (!(detail.share >= 0 && detail.share <= 1) || detail.radius < 1 || !(detail.smoothing >= 0))
        return fail("flow: detail needs a share from 0 to 1, a radius of at least 1 pixel, smoothing >= 0");
    return Done{};
}

// What both of our methods need.
template <typename Options>
Status check_descent(const Options& o) {
    if (o.warps < 1 || o.finest_warps < 1 || o.reweightings < 1 || o.sweeps < 1 || o.coarsest < 4 || o.finest_level < 0)
        return fail(
            "flow: warps, reweightings and sweeps must be at least 1, coarsest at least 4, finest_level at least 0");
    if (!(o.initial_octaves >= 0)) return fail("flow: initial_octaves must be at least 0");
    if (!(o.smoothness > 0)) return fail("flow: smoothness must be above 0: else textureless pixels have no flow");
    return check_detail(o.detail);
}

Status check(const RobustFlowOptions& o) {
    if (!(o.data_sigma > 0 && o.flow_sigma > 0) || o.stages < 1)
        return fail("flow: data_sigma and flow_sigma must be above 0, stages at least 1");
    return check_descent(o);
}

Status check(const BroxFlowOptions& o) {
    if (!(o.ratio >= 0.1 && o.ratio <= 0.98)) return fail("flow: the pyramid's ratio must be from 0.1 to 0.98");
    if (!(o.gradient >= 0 && o.hint >= 0 && o.keep >= 0 && o.hint_radius > 0 && o.keep_threshold > 0))
        return fail("flow: gradient, hint and keep must be at least 0, hint_radius and keep_threshold above 0");
    for (const FlowHint& hint : o.hints)
        if (!std::isfinite(hint.x) || !std::isfinite(hint.y) || !std::isfinite(hint.u) || !std::isfinite(hint.v))
            return fail("flow: a hint has numbers that are not finite: leave it out");
    return check_descent(o);
}

// Where one of them is not seen as a whole, both have what of them is.
FlowPair pair_of(const FlowImage& from, const FlowImage& to) {
    FlowPair pair{from.image, to.image, from.seen, to.seen};
    if (pair.from_seen.data.empty() != pair.to_seen.data.empty()) {
        Image& all = pair.from_seen.data.empty() ? pair.from_seen : pair.to_seen;
        all = Image(from.image.width, from.image.height, 1);
        std::fill(all.data.begin(), all.data.end(), 1.0f);
    }
    return pair;
}

FlowField run(const FlowImage& from, const FlowImage& to, const DisFlowOptions& options, const FlowField* initial) {
    return dis_flow(from.image, to.image, from.seen, options, initial);
}
FlowField run(const FlowImage& from, const FlowImage& to, const RobustFlowOptions& options, const FlowField* initial) {
    return robust_flow(pair_of(from, to), options, initial);
}
FlowField run(const FlowImage& from, const FlowImage& to, const BroxFlowOptions& options, const FlowField* initial) {
    return brox_flow(pair_of(from, to), options, initial);
}

struct NamedMethod {
    std::string name;
    FlowOptions options;
};

std::vector<NamedMethod> methods() {
    return {
        {"dis-ultrafast", {DisFlowOptions{.finest_scale = 2, .patch_stride = 4, .iterations = 12, .refinements = 0}}},
        {"dis-fast", {DisFlowOptions{.finest_scale = 2, .patch_stride = 4, .iterations = 16}}},
        {"brox-quick", {BroxFlowOptions{.warps = 1, .finest_warps = 1, .finest_level = 1}}},
        {"brox-half", {BroxFlowOptions{.finest_level = 1}}},
        {"robust-half", {RobustFlowOptions{.finest_level = 1}}},
        {"dis-medium", {DisFlowOptions{}}},
        {"brox", {BroxFlowOptions{}}},
        {"robust", {RobustFlowOptions{}}},
        {"dis-refined", {DisFlowOptions{.final_refinements = 5}}},
        {"brox-fine", {BroxFlowOptions{.ratio = 0.8, .warps = 3, .finest_warps = 3}}}};
}

// For `initial` flows within about a pixel of the truth: no pyramid.
std::vector<NamedMethod> refinements() {
    return {{"refine-half", {BroxFlowOptions{.finest_warps = 1, .finest_level = 1, .initial_octaves = 0}}},
            {"refine", {BroxFlowOptions{.finest_warps = 1, .initial_octaves = 0}}},
            {"refine-robust", {RobustFlowOptions{.finest_warps = 1, .initial_octaves = 0}}},
            {"refine-variational", {DisFlowOptions{.search = false, .final_refinements = 5}}}};
}

std::vector<std::string> names_of(const std::vector<NamedMethod>& all) {
    std::vector<std::string> names;
    for (const NamedMethod& one : all) names.push_back(one.name);
    return names;
}

}  // namespace

std::vector<std::string> flow_method_names() {
    return names_of(methods());
}

std::vector<std::string> flow_refinement_names() {
    return names_of(refinements());
}

Result<FlowOptions> flow_method(const std::string& name) {
    std::string known;
    for (const std::vector<NamedMethod>& all : {methods(), refinements()})
        for (const NamedMethod& one : all) {
            if (one.name == name) return one.options;
            known += (known.empty() ? "" : ", ") + one.name;
        }
    return fail("no flow method '" + name + "': there are " + known);
}

Result<FlowField> estimate_flow(const Image& from, const Image& to, const FlowOptions& options,
                                const FlowField* initial) {
    if (Status fits = check(from, to, initial); !fits) return fits.error();
    return estimate_flow(flow_image(from, options.saturation), flow_image(to, options.saturation), options, initial);
}

FlowImage flow_image(Image image, float saturation) {
    FlowImage out{std::move(image), {}, false};
    out.seen = hide_unseen(out.image, saturation);
    out.is_even = !equalize_exposure(out.image);
    return out;
}

Result<FlowField> estimate_flow(const FlowImage& from, const FlowImage& to, const FlowOptions& options,
                                const FlowField* initial) {
    if (Status fits = check(from.image, to.image, initial); !fits) return fits.error();
    if (Status sane = std::visit([](const auto& method) { return check(method); }, options.method); !sane)
        return sane.error();
    if (from.is_even || to.is_even) return initial ? *initial : FlowField(from.image.width, from.image.height);
    try {
        return std::visit([&](const auto& method) { return run(from, to, method, initial); }, options.method);
    } catch (const cv::Exception& e) {
        return fail(std::string("flow: OpenCV refuses: ") + e.what());
    }
}

}  // namespace ols

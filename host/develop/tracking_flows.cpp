// SPDX-License-Identifier: MIT
// Walks from the instant to the tracking frames on either side, one flow after the other; both sides run at once.
#include "develop/tracking_flows.hpp"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <limits>
#include <span>
#include <string>

#include "parallel.hpp"

namespace ols {

namespace {

// A mean over reduction x reduction pixels; those without a number do not count.
Image shrunk(const Image& image, int reduction) {
    if (reduction == 1) return image;
    const auto part = [&](int side) { return (side + reduction - 1) / reduction; };
    Image out(part(image.width), part(image.height), 1);
    std::vector<float> sums(size_t(out.width * reduction)), counts(sums.size());
    for (int y = 0; y < out.height; ++y) {
        std::ranges::fill(sums, 0.0f);
        std::ranges::fill(counts, 0.0f);
        for (int j = y * reduction; j < std::min((y + 1) * reduction, image.height); ++j) {
            const float* const row = &image.data[size_t(j) * size_t(image.width)];
            for (size_t i = 0; i < size_t(image.width); ++i) {
                const bool is_number = std::abs(row[i]) <= std::numeric_limits<float>::max();
                sums[i] += is_number ? row[i] : 0.0f;
                counts[i] += is_number ? 1.0f : 0.0f;
            }
        }
        for (size_t x = 0; x < size_t(out.width); ++x) {
            float sum = 0, count = 0;
            for (size_t i = x * size_t(reduction); i < (x + 1) * size_t(reduction); ++i)
                sum += sums[i], count += counts[i];
            out.data[size_t(y) * size_t(out.width) + x] =
                count > 0 ? sum / count : std::numeric_limits<float>::quiet_NaN();
        }
    }
    return out;
}

int reduction_of(const Image& image, int reduced_side) {
    int reduction = 1;
    while (reduced_side > 0 && reduction < 4 && std::min(image.width, image.height) >= 2 * reduction * reduced_side)
        reduction *= 2;
    return reduction;
}

FlowField scaled(const FlowField& flow, double factor) {
    FlowField out = flow;
    for (std::vector<float>* plane : {&out.u, &out.v})
        for (float& v : *plane) v = float(factor * double(v));
    return out;
}

Status first_error(std::span<const std::string> errors) {
    for (const std::string& error : errors)
        if (!error.empty()) return fail(error);
    return Done{};
}

MotionKnot still(double tick, int width, int height) {
    MotionKnot knot{tick, FlowField(width, height), {}, true};
    knot.confidence.assign(knot.flow.size(), 1.0f);
    return knot;
}

}  // namespace

SplitFlow split(const FlowField& between, double share) {
    constexpr int iterations = 5;
    FlowField back(between.width, between.height);  // from the instant to the first: -share between(x')
    for (int i = 0; i < iterations; ++i) {
        // concatenated() adds `back` to what it reads of `between` at x + back.
        const FlowField sum = concatenated(back, between);
        for (size_t p = 0; p < back.size(); ++p) {
            back.u[p] = float(-share) * (sum.u[p] - back.u[p]);
            back.v[p] = float(-share) * (sum.v[p] - back.v[p]);
        }
    }
    return {back, scaled(back, -(1 - share) / share)};
}

TrackingFlows::TrackingFlows(TrackingFlowOptions options) : options_(std::move(options)) {}

Status TrackingFlows::add(double tick, const Image& image, const Image& sigma) {
    assert(image.channels == 1 && (frames_.empty() || tick > frames_.back().tick));
    if (frames_.empty()) reduction_ = reduction_of(image, options_.reduced_side);
    Image small = shrunk(image, reduction_);
    if (frames_.empty()) width_ = small.width, height_ = small.height;
    if (small.width != width_ || small.height != height_) return fail("tracking frames differ in size");
    if (std::min(width_, height_) < 16)
        return fail("frames of " + std::to_string(image.width) + " x " + std::to_string(image.height) +
                    " pixels are too small for motion compensation: at least 16 a side");
    Frame frame{tick, {}, {}, {}, {}};
    if (!sigma.data.empty()) {
        assert(sigma.width == image.width && sigma.height == image.height);
        Image noise = shrunk(sigma, reduction_);
        for (float& v : noise.data) v /= float(reduction_);  // of a mean over reduction^2 pixels
        frame.evenness = evenness_of(small, noise);
        small = without_even_parts(small, *frame.evenness);
    }
    frame.image = flow_image(std::move(small), options_.local.saturation);
    frames_.push_back(std::move(frame));
    return Done{};
}

void TrackingFlows::forget_before(double tick) {
    while (frames_.size() > 1 && frames_[1].tick <= tick) frames_.pop_front();
}

Status TrackingFlows::find_local_flows(size_t first, size_t last) {
    struct Task {
        const FlowImage *from, *to;
        std::optional<FlowField>* flow;
    };
    std::vector<Task> tasks;
    for (size_t i = first; i < last; ++i) {
        Frame &a = frames_[i], &b = frames_[i + 1];
        if (!a.forward) tasks.push_back({&a.image, &b.image, &a.forward});
        if (!a.backward) tasks.push_back({&b.image, &a.image, &a.backward});
    }
    std::vector<std::string> errors(tasks.size());
    for_each_index(options_.threads, tasks.size(), [&](size_t t) {
        auto flow = estimate_flow(*tasks[t].from, *tasks[t].to, options_.local);
        if (flow.ok())
            *tasks[t].flow = std::move(*flow);
        else
            errors[t] = flow.error().message;
    });
    return first_error(errors);
}

// Adds the knots from frame `at`, where `flow` leads and `back` comes from, to frame `end`.
Status TrackingFlows::walk(Walk walk, FlowField flow, FlowField back, MotionPath& path) const {
    const auto& [reference, refined, direction, from, end] = walk;
    for (size_t at = from;; at = direction > 0 ? at + 1 : at - 1) {
        const Frame& here = frames_[at];
        path.push_back({here.tick, flow,
                        reference && reference->evenness && here.evenness
                            ? confidence(flow, back, *reference->evenness, *here.evenness)
                            : confidence(flow, back),
                        false});
        if (at == end) return Done{};
        const Frame &pair = frames_[direction > 0 ? at : at - 1], &next = frames_[direction > 0 ? at + 1 : at - 1];
        const FlowField &away = *(direction > 0 ? pair.forward : pair.backward),
                        &home = *(direction > 0 ? pair.backward : pair.forward);
        flow = concatenated(flow, away);
        back = concatenated(home, back);
        const bool is_near = refined.from < here.tick && here.tick < refined.to;
        if (!reference || !options_.refinement || !is_near) continue;
        auto mended = estimate_flow(reference->image, next.image, *options_.refinement, &flow);
        if (!mended.ok()) return mended.error();
        flow = std::move(*mended);
    }
}

Result<MotionPath> TrackingFlows::path(double instant, const Reach& reach, const Reach& refined) {
    if (frames_.empty()) return fail("no tracking frame of the take was recorded: motion cannot be compensated");
    if (instant < frames_.front().tick || instant > frames_.back().tick)
        return MotionPath{still(instant, width_, height_)};
    const auto last_until = [&](double tick) {  // the first frame where all are later
        size_t i = 0;
        while (i + 1 < frames_.size() && frames_[i + 1].tick <= tick) ++i;
        return i;
    };
    const size_t before = last_until(instant);
    const size_t first = std::min(before, last_until(reach.from));
    size_t last = last_until(reach.to);
    if (frames_[last].tick < reach.to && last + 1 < frames_.size()) ++last;
    const bool is_frame = frames_[before].tick == instant;
    last = std::max(last, is_frame ? before : before + 1);
    if (Status status = find_local_flows(first, last); !status.ok()) return status.error();

    const Frame* const reference = is_frame ? &frames_[before] : nullptr;
    SplitFlow parts;
    double share = 0;
    if (!is_frame) {
        share = (instant - frames_[before].tick) / (frames_[before + 1].tick - frames_[before].tick);
        parts = split(*frames_[before].forward, share);
    }
    MotionPath sides[2];
    std::string errors[2];
    const auto take = [&](size_t side, const Frame* own, size_t end, size_t at, FlowField flow, FlowField back) {
        const Status walked =
            walk({own, refined, side == 0 ? -1 : 1, at, end}, std::move(flow), std::move(back), sides[side]);
        if (!walked.ok()) errors[side] = walked.error().message;
    };
    for_each_index(options_.threads, 2, [&](size_t side) {
        if (is_frame && side == 0 && before > first)
            take(0, reference, first, before - 1, *frames_[before - 1].backward, *frames_[before - 1].forward);
        if (is_frame && side == 1 && before < last)
            take(1, reference, last, before + 1, *frames_[before].forward, *frames_[before].backward);
        if (!is_frame && side == 0)
            take(0, nullptr, first, before, parts.to_first, scaled(*frames_[before].forward, share));
        if (!is_frame && side == 1)
            take(1, nullptr, last, before + 1, parts.to_second, scaled(*frames_[before].backward, 1 - share));
    });
    if (Status done = first_error(errors); !done.ok()) return done.error();
    MotionPath path(std::make_move_iterator(sides[0].rbegin()), std::make_move_iterator(sides[0].rend()));
    path.push_back(still(instant, width_, height_));
    path.insert(path.end(), std::make_move_iterator(sides[1].begin()), std::make_move_iterator(sides[1].end()));
    return path;
}

}  // namespace ols

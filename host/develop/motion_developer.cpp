// SPDX-License-Identifier: MIT
// Flow, planes, rows, inversion, matte, one after the other; each runs on several threads by itself.
#include "develop/motion_developer.hpp"

#include <algorithm>
#include <cassert>
#include <chrono>
#include <cmath>

#include "develop/tracking_image.hpp"
#include "parallel.hpp"

namespace ols {

namespace {

// Adds the time of its life to a sum.
class Stopwatch {
  public:
    explicit Stopwatch(double& seconds) : seconds_(seconds) {}
    ~Stopwatch() { seconds_ += std::chrono::duration<double>(std::chrono::steady_clock::now() - start_).count(); }

  private:
    double& seconds_;
    const std::chrono::steady_clock::time_point start_ = std::chrono::steady_clock::now();
};

// In which nothing moves and nothing is trusted.
MotionPath still_path(double tick, int width, int height) {
    MotionKnot alone{tick, FlowField(width, height), {}, true};
    alone.confidence.assign(alone.flow.size(), 0.0f);
    return {std::move(alone)};
}

// The flows to the knots from the last before -reach to the first after reach, for motion blur.
TargetMotion motion_around(const MotionPath& path, double reach_s, const Target& target) {
    const auto is_instant = [](const MotionKnot& knot) { return knot.is_instant; };
    const auto self = std::ranges::find_if(path, is_instant);
    const auto seconds = [&](const MotionKnot& knot) { return (knot.tick - self->tick) / double(tick_hz); };
    TargetMotion motion;
    for (size_t i = 0; i < path.size(); ++i) {
        if (path[i].is_instant) continue;
        const bool is_needed = std::abs(seconds(path[i])) < reach_s ||
                               (i + 1 < path.size() && std::abs(seconds(path[i + 1])) < reach_s) ||
                               (i > 0 && std::abs(seconds(path[i - 1])) < reach_s);
        if (!is_needed) continue;
        motion.times_s.push_back(seconds(path[i]));
        motion.flows.push_back(resized(path[i].flow, target.width, target.height));
    }
    return motion;
}

// relative_light() of every eighth pair of pixel rows: some thousands of pixels.
template <typename Rows>
std::vector<float> light_of(const Rows& tracking, const Frame& like, const Image& black, size_t instant,
                            const NoiseModel& noise) {
    constexpr size_t rows = 2, apart = 16;
    const int channels = samples_per_pixel(like.cfa);
    std::vector<RowBand<typename Rows::Sum>> bands;
    for (size_t y = 0; y < like.height; y += apart)
        for (int channel = 0; channel < channels; ++channel)
            bands.push_back(
                tracking.load({y, std::min(rows, like.height - y), like.width, channel, channels}, like, black, false));
    return relative_light<typename Rows::Sum>(bands, instant, noise);
}

}  // namespace

MotionDeveloper::MotionDeveloper(const Sequence& sequence, const CameraCalibration& calibration,
                                 const NoiseModel& noise, DevelopOptions options, MotionQuality quality, int every)
    : sequence_(sequence),
      calibration_(calibration),
      noise_(noise),
      options_(options),
      quality_(std::move(quality)),
      every_(every),
      flow_frames_(evenly_apart(sequence, every, quality_.flow_apart_s)),
      developer_(sequence, calibration, noise, std::move(options)),
      flows_([&] {
          TrackingFlowOptions flow = quality_.flow;
          flow.threads = options_.threads;
          return flow;
      }()) {}

MotionDeveloper::~MotionDeveloper() = default;

double MotionDeveloper::instant_of(const TargetFrames& frames, const Sequence& sequence) {
    const auto away = [&](const TargetFrames::Tracking& one) {
        return std::abs(double(one.number) - double(frames.basis.target));
    };
    const auto nearest = std::ranges::min_element(frames.tracking, {}, away);
    return middle_tick(*nearest->frame) +
           (double(frames.basis.target) - double(nearest->number)) * double(sequence.slots.front().period_ticks);
}

TrackingFlows::Reach MotionDeveloper::reach_of(const TargetFrames& frames, bool with_across) {
    TrackingFlows::Reach reach{middle_tick(*frames.frames.front()), middle_tick(*frames.frames.front())};
    const auto include = [&](const Frame& frame) {
        reach.from = std::min(reach.from, middle_tick(frame));
        reach.to = std::max(reach.to, middle_tick(frame));
    };
    for (const auto& frame : frames.frames) include(*frame);
    for (const auto& frame : frames.across)
        if (with_across && frame) include(*frame);
    for (const MatteFrame& one : frames.matte) include(*one.frame);
    return reach;
}

// Those that flow leads to and that no earlier target has asked for. Beside one that was lost its neighbours stand in, and the
// take's first and last are used, or the subject would have to go on as before from farther inside.
std::vector<const TargetFrames::Tracking*> MotionDeveloper::fresh_tracking(const TargetFrames& frames) const {
    const auto order = [&](uint64_t number) { return int64_t(tracking_frames_before(sequence_, number)); };
    const int64_t own = order(frames.basis.target), last = order(sequence_.trigger_count()) - 1;
    const auto is_chosen = [&](int64_t at) {
        const int64_t away = (at - own) % every_;
        return std::ranges::binary_search(flow_frames_, int(away < 0 ? away + every_ : away));
    };
    std::vector<int64_t> lost;
    std::ranges::transform(frames.lost_tracking, std::back_inserter(lost), order);
    const auto is_used = [&](int64_t at) {
        const auto stands_in = [&](int64_t missing) { return std::abs(missing - at) == 1 && is_chosen(missing); };
        return is_chosen(at) || at == 0 || at == last || std::ranges::any_of(lost, stands_in);
    };
    std::vector<const TargetFrames::Tracking*> fresh;
    for (const auto& one : frames.tracking)
        if (is_used(order(one.number)) && (!last_tracking_ || one.number > *last_tracking_)) fresh.push_back(&one);
    return fresh;
}

Result<MotionPath> MotionDeveloper::find_path(const TargetFrames& frames) {
    const Stopwatch watch(times_.flow);
    const auto fresh = fresh_tracking(frames);
    std::vector<Image> images(fresh.size()), noise(fresh.size());
    for_each_index(options_.threads, fresh.size(), [&](size_t i) {
        images[i] = tracking_image(*fresh[i]->frame, calibration_.black, calibration_.flat);
        noise[i] = tracking_noise(*fresh[i]->frame, calibration_.black, calibration_.flat, noise_);
    });
    for (size_t i = 0; i < fresh.size(); ++i) {
        const Status added = flows_.add(middle_tick(*fresh[i]->frame), images[i], noise[i]);
        if (!added.ok()) return added.error();
        last_tracking_ = fresh[i]->number;
    }
    const auto reach = reach_of(frames, quality_.interpolates);
    if (frames.tracking.empty())
        return still_path(reach.from, int(frames.frames[0]->width), int(frames.frames[0]->height));
    flows_.forget_before(reach.from);
    return flows_.path(instant_of(frames, sequence_), reach, reach_of(frames, false));
}

template <typename Sample, typename Sum>
void MotionDeveloper::follow_brightness(const TargetFrames& frames, const MotionPath& path,
                                        const SignalPlanes<Sample>& black, AlignedRows<Sample, Sum>& aligned) const {
    if (!quality_.follows_brightness) return;
    const double instant = std::ranges::find_if(path, &MotionKnot::is_instant)->tick;
    BrightnessKnots knots;
    std::vector<const Frame*> known;
    bool is_own_known = false;
    for (const auto& one : frames.tracking) {
        const double tick = middle_tick(*one.frame);
        if (tick < path.front().tick || tick > path.back().tick) continue;
        if (tick == instant) knots.instant = known.size(), is_own_known = true;
        known.push_back(one.frame.get());
        knots.ticks.push_back(tick);
    }
    // Where the target's own tracking frame was lost, nothing tells its brightness.
    if (!is_own_known || known.size() == 1) return;
    auto tracking = std::make_shared<AlignedRows<Sample, Sum>>();
    tracking->alignment = aligned.alignment;
    tracking->rows.resize(known.size());
    for_each_index(options_.threads, known.size(), [&](size_t k) {
        auto planes = std::make_shared<SignalPlanes<Sample>>(signal_planes<Sample>(*known[k], black, false));
        tracking->rows[k].push_back({.nearer = {std::move(planes), aligned.alignment->place_of(knots.ticks[k])}});
    });
    knots.light = light_of(*tracking, *frames.frames.front(), calibration_.black, knots.instant, noise_);
    aligned.knots = std::move(knots);
    aligned.tracking = std::move(tracking);
    aligned.noise = noise_;
}

// The planes of all frames that the target is made of, those of the last one kept.
template <typename Sample>
void MotionDeveloper::prepare_planes(const TargetFrames& frames, Ready<Sample>& ready) const {
    const Frame& like = *frames.frames.front();
    if (!ready.black) ready.black = black_planes<Sample>(calibration_.black, like.cfa, like.format);
    std::vector<std::pair<uint64_t, const Frame*>> needed;
    for (size_t i = 0; i < frames.frames.size(); ++i) {
        needed.emplace_back(frames.basis.choices[i].number, frames.frames[i].get());
        if (quality_.interpolates && frames.across[i])
            needed.emplace_back(*frames.basis.choices[i].across, frames.across[i].get());
    }
    std::vector<std::shared_ptr<const SignalPlanes<Sample>>> planes(needed.size());
    for_each_index(options_.threads, needed.size(), [&](size_t i) {
        const auto& [number, frame] = needed[i];
        const auto found = ready.planes.find(number);
        planes[i] = found != ready.planes.end() ? found->second
                                                : std::make_shared<SignalPlanes<Sample>>(signal_planes<Sample>(
                                                      *frame, *ready.black, developer_.keeps_clipped()));
    });
    ready.planes.clear();
    for (size_t i = 0; i < needed.size(); ++i) ready.planes[needed[i].first] = std::move(planes[i]);
}

template <typename Sample, typename Sum>
AlignedRows<Sample, Sum> MotionDeveloper::align(const TargetFrames& frames, const MotionPath& path,
                                                std::shared_ptr<const Alignment> alignment, Ready<Sample>& ready) {
    const Stopwatch watch(times_.planes);
    prepare_planes(frames, ready);
    AlignedRows<Sample, Sum> aligned;
    aligned.rows.resize(size_t(sequence_.basis.rows));
    aligned.masks_untrusted = has_prior(options_.estimate);
    const double instant = std::ranges::find_if(path, &MotionKnot::is_instant)->tick;
    // Beyond the path flow would have to go on as it did last, for longer than it is known.
    const auto is_reached = [&](const Frame& frame) {
        return path.front().tick <= middle_tick(frame) && middle_tick(frame) <= path.back().tick;
    };
    std::map<std::pair<size_t, size_t>, std::shared_ptr<const std::vector<float>>> trusts;
    const auto recorded = [&](uint64_t number, const Frame& frame) {
        return typename AlignedRows<Sample, Sum>::Recorded{ready.planes.at(number),
                                                           alignment->place_of(middle_tick(frame))};
    };
    for (size_t i = 0; i < frames.frames.size(); ++i) {
        const LazyBasis::Choice& choice = frames.basis.choices[i];
        typename AlignedRows<Sample, Sum>::Source source{.nearer = recorded(choice.number, *frames.frames[i])};
        if (quality_.interpolates && frames.across[i] && is_reached(*frames.across[i])) {
            auto across = recorded(*choice.across, *frames.across[i]);
            const size_t here = source.nearer.place.interval, there = across.place.interval;
            auto& trust = trusts[{here, there}];
            if (!trust) trust = std::make_shared<std::vector<float>>(trust_across(*alignment, here, there));
            const double near = std::abs(middle_tick(*frames.frames[i]) - instant),
                         far = std::abs(middle_tick(*frames.across[i]) - instant);
            source.across = {std::move(across), trust, float(far / (near + far))};
        }
        aligned.rows[size_t(sequence_.slots[size_t(choice.slot)].row)].push_back(std::move(source));
    }
    aligned.alignment = std::move(alignment);
    follow_brightness(frames, path, *ready.black, aligned);
    return aligned;
}

Result<AlignedFrames> MotionDeveloper::align(const TargetFrames& frames, const MotionPath& path) {
    const Frame& like = *frames.frames.front();
    std::shared_ptr<const Alignment> alignment;
    {
        const Stopwatch watch(times_.flow);
        alignment = std::make_shared<Alignment>(path, int(like.width), int(like.height), like.cfa,
                                                quality_.line_tolerance_steps, options_.threads);
    }
    AlignedFrames aligned;
    aligned.like = frames.frames.front();
    if (fits_shorts(like.format, like.white, calibration_.black))
        aligned.rows = align<int16_t, int16_t>(frames, path, alignment, ready_shorts_);
    else if (like.format == PixelFormat::u16)
        aligned.rows = align<float, int32_t>(frames, path, alignment, ready_floats_);
    else
        aligned.rows = align<float, float>(frames, path, alignment, ready_floats_);
    return aligned;
}

TargetMatte MotionDeveloper::matte_of(const TargetFrames& frames, std::shared_ptr<const Alignment> alignment) {
    if (frames.matte.empty()) return {};
    const Stopwatch watch(times_.matte);
    const Frame& like = *frames.matte.front().frame;
    const int width = int(like.width), height = int(like.height);
    if (!alignment)
        alignment = std::make_shared<Alignment>(still_path(double(like.tick), width, height), width, height, like.cfa,
                                                quality_.line_tolerance_steps, options_.threads);
    const std::vector<double> weights = matte_weights(frames.matte, frames.basis.target, sequence_);
    return mean_matte({frames.matte, weights, std::move(alignment), calibration_, noise_, options_.threads});
}

Result<Target> MotionDeveloper::develop(const TargetFrames& frames, const MotionPath* path) {
    if (frames.frames.empty()) return fail("every basis slot around the target is missing");
    if (!quality_.compensates) {
        RowFrames rows(size_t(sequence_.basis.rows));
        for (size_t i = 0; i < frames.frames.size(); ++i)
            rows[size_t(sequence_.slots[size_t(frames.basis.choices[i].slot)].row)].push_back(frames.frames[i]);
        auto target = [&] {
            const Stopwatch watch(times_.invert);
            return developer_.develop(rows, frames.basis.lost);
        }();
        if (target.ok()) target->matte = matte_of(frames, nullptr);
        return target;
    }
    std::optional<MotionPath> found;
    if (!path) {
        auto searched = find_path(frames);
        if (!searched.ok()) return searched.error();
        found = std::move(*searched);
    }
    auto aligned = align(frames, path ? *path : *found);
    if (!aligned.ok()) return aligned.error();
    auto target = [&] {
        const Stopwatch watch(times_.invert);
        return developer_.develop(*aligned, frames.basis.lost);
    }();
    if (!target.ok()) return target;
    if (quality_.interpolates)
        target->provenance["slots_from_both_sides"] =
            std::visit([](const auto& rows) { return rows.blended_sources(); }, aligned->rows);
    target->motion = motion_around(path ? *path : *found, quality_.motion_reach_s, *target);
    target->matte = matte_of(frames, std::visit([](const auto& rows) { return rows.alignment; }, aligned->rows));
    return target;
}

}  // namespace ols

// SPDX-License-Identifier: MIT
// The card's sequence, its averages, and what they must look like.
#include "take/card.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numeric>

namespace ols {

namespace {

constexpr double share_of_range = 0.6;    // that the card should reach
constexpr double least_share = 0.1;       // below, the flat would be mostly noise
constexpr double least_of_median = 0.05;  // a sample darker than this beside the median does not see the card

// Light on a surface that faces the camera, in units of one lamp that faces it.
double light_on_card(const StageConfig& stage, const CameraConfig& camera) {
    const auto vec = [](const std::array<double, 3>& a) { return Vec3{a[0], a[1], a[2]}; };
    const Vec3 normal = normalized(vec(camera.position_m) - vec(camera.look_at_m));
    double sum = 0;
    for (const LightPosition& lamp : stage.lamps) sum += std::max(0.0, dot(normal, lamp.direction));
    return sum;
}

double exposure_for(const StageConfig& stage, const CardOptions& options) {
    if (options.exposure_us > 0) return options.exposure_us;
    const CameraConfig& camera = stage.cameras[options.camera];
    const double counts_per_us = camera.counts_per_us * options.reflectance * light_on_card(stage, camera);
    return share_of_range * (camera.white - camera.black) / counts_per_us;
}

// One cycle: tracking, matte, and eight card and eight dark slots in an order that no rotation repeats. The card's
// slots are a basis of one row, all lamps.
Sequence card_sequence(const StageConfig& stage, const CardOptions& options) {
    const size_t lamps = stage.lamps.size();
    Sequence sequence;
    sequence.config.cycles = options.cycles;
    sequence.config.basis_exposure_us = exposure_for(stage, options);
    sequence.config.tracking_exposure_us = sequence.config.basis_exposure_us / 2;
    sequence.basis.name = "card";
    sequence.basis.rows = 1;
    sequence.basis.lamps = int(lamps);
    sequence.basis.levels.assign(lamps, 1);
    constexpr SlotKind T = SlotKind::tracking, M = SlotKind::matte, B = SlotKind::basis, D = SlotKind::dark;
    for (const SlotKind kind : {T, M, B, D, B, B, D, D, B, D, D, D, B, B, B, D, D, B}) {
        Slot slot;
        slot.kind = kind;
        slot.row = kind == B ? 0 : -1;
        slot.lit.assign(size_t(stage.lamp_count()), 0);
        if (kind == T || kind == B) std::fill_n(slot.lit.begin(), lamps, uint8_t(1));
        if (kind == M) std::fill(slot.lit.begin() + ptrdiff_t(lamps), slot.lit.end(), uint8_t(1));
        const double exposure_us = kind == T ? sequence.config.tracking_exposure_us : sequence.config.basis_exposure_us;
        slot.exposure_ticks = uint32_t(std::lround(exposure_us * double(ticks_per_us)));
        slot.period_ticks = uint32_t(double(tick_hz) / sequence.config.frame_rate_hz);
        slot.trigger_mask = uint8_t(1 | 1 << stage.cameras[options.camera].trigger);
        sequence.slots.push_back(std::move(slot));
    }
    return sequence;
}

// A running mean of frames, sample by sample.
class Average {
  public:
    explicit Average(const CameraConfig& camera)
        : image_(camera.width, camera.height, samples_per_pixel(camera.cfa)), sums_(image_.data.size(), 0.0) {}

    void add(const Frame& frame) {
        if (frame.format == PixelFormat::u16)
            add_samples<uint16_t>(frame);
        else
            add_samples<float>(frame);
        ++frames_;
    }
    int frames() const { return frames_; }
    uint64_t saturated() const { return saturated_; }
    Image mean() const {
        Image mean = image_;
        for (size_t i = 0; i < sums_.size(); ++i) mean.data[i] = float(sums_[i] / frames_);
        return mean;
    }

  private:
    template <typename Sample>
    void add_samples(const Frame& frame) {
        const size_t row_samples = size_t(image_.width) * size_t(image_.channels);
        for (size_t y = 0; y < size_t(image_.height); ++y) {
            const auto* row = reinterpret_cast<const Sample*>(frame.samples.data() + y * frame.pitch_bytes);
            for (size_t x = 0; x < row_samples; ++x) {
                sums_[y * row_samples + x] += row[x];
                saturated_ += float(row[x]) >= frame.white;
            }
        }
    }

    Image image_;
    std::vector<double> sums_;
    int frames_ = 0;
    uint64_t saturated_ = 0;
};

double mean_of(const Image& image) {
    return std::accumulate(image.data.begin(), image.data.end(), 0.0) / double(image.data.size());
}

Status check_card(const Average& card, const Image& above_black, double range, double exposure_us) {
    if (card.saturated() > 0)
        return fail(fmt::format("the card saturates in {} samples at {:.1f} us: give a shorter --exposure-us",
                                card.saturated(), exposure_us));
    std::vector<float> sorted = above_black.data;
    const auto middle = sorted.begin() + ptrdiff_t(sorted.size() / 2);
    std::nth_element(sorted.begin(), middle, sorted.end());
    if (*middle < least_share * range)
        return fail(
            fmt::format("the card reaches {:.1f} % of the camera's range and should reach {:.0f} %: is it in "
                        "view, and are the lamps on? Otherwise give a longer --exposure-us",
                        100 * *middle / range, 100 * share_of_range));
    const auto outside = std::count_if(above_black.data.begin(), above_black.data.end(),
                                       [&](float value) { return value < least_of_median * *middle; });
    if (outside > 0) return fail(fmt::format("{} samples do not see the card: it must fill the view", outside));
    return Done{};
}

}  // namespace

nlohmann::json CardCalibration::to_json(const std::string& folder) const {
    return {{"calibration", folder},
            {"camera", report.cameras[0].index},
            {"frames", record.frames},
            {"slots_missing", report.missing().total()},
            {"exposure_us", record.card_exposure_us},
            {"black_counts", black_mean},
            {"flat_counts_per_us", flat_mean},
            {"brightest_share", brightest}};
}

std::string CardCalibration::to_text() const {
    return fmt::format(
        "camera {}: {} frames of card and of dark at {:.2f} us; black {:.2f} counts, flat {:.4f} counts a microsecond, "
        "card at {:.0f} % of the range at most",
        report.cameras[0].index, record.frames, record.card_exposure_us, black_mean, flat_mean, brightest * 100);
}

Result<CardCalibration> calibrate_with_card(Board& board, Camera& camera, const StageConfig& stage,
                                            const CardOptions& options, const StopRequest& stop,
                                            const std::function<void(uint64_t, uint64_t)>& progress,
                                            RecordMonitor* monitor) {
    const CameraConfig& config = stage.cameras[options.camera];
    const Sequence sequence = card_sequence(stage, options);
    Average card(config), dark(config);
    const RecordSink sink{[&](std::shared_ptr<const Frame> frame) {
                              const SlotKind kind = sequence.slots[frame->slot].kind;
                              if (kind == SlotKind::basis) card.add(*frame);
                              if (kind == SlotKind::dark) dark.add(*frame);
                          },
                          [](const MissingSlot&) {}, progress};
    const auto report =
        record_take(board, {{camera, options.camera, std::nullopt, sink}}, sequence, stage, stop, monitor);
    if (!report.ok()) return report.error();
    const CameraReport& account = report->cameras[0];
    if (!report->board_end.empty() || account.missing.of(Cause::camera_gone) > 0)
        return fail("the calibration was cut short: " +
                    (account.end.empty() ? report->board_end.text : account.end.text));
    if (card.frames() == 0 || dark.frames() == 0)
        return fail(fmt::format("{} of {} frames could be identified, not enough to calibrate{}{}",
                                card.frames() + dark.frames(), report->slots_total,
                                report->board_end.empty() ? "" : "; " + report->board_end.text,
                                account.unfit_frame.empty() ? "" : "; frames came as " + account.unfit_frame));

    const double exposure_us = double(sequence.slots[2].exposure_ticks) / double(ticks_per_us);
    CameraCalibration planes{dark.mean(), card.mean()};
    Image& flat = planes.flat;
    for (size_t i = 0; i < flat.data.size(); ++i) flat.data[i] -= planes.black.data[i];
    const double range = config.white - config.black;
    if (const Status status = check_card(card, flat, range, exposure_us); !status.ok()) return status.error();
    const float brightest = *std::max_element(flat.data.begin(), flat.data.end());
    const double light = exposure_us * options.reflectance * light_on_card(stage, config);
    for (float& value : flat.data) value = float(value / light);

    CardCalibration result;
    result.report = *report;
    result.record = {options.reflectance, exposure_us, std::min(card.frames(), dark.frames())};
    result.black_mean = mean_of(planes.black);
    result.flat_mean = mean_of(planes.flat);
    result.brightest = brightest / range;
    result.calibration = std::move(planes);
    return result;
}

}  // namespace ols

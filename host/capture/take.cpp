// SPDX-License-Identifier: MIT
// Gathering cycles, developing and writing them behind the recorder.
#include "capture/take.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <numeric>
#include <thread>

#include "capture/event_queue.hpp"
#include "capture/missing_ranges.hpp"

namespace ols {

namespace {

using Clock = std::chrono::steady_clock;

double seconds_since(Clock::time_point start) {
    return std::chrono::duration<double>(Clock::now() - start).count();
}

// A target, or why there is none.
struct Outcome {
    uint32_t cycle = 0;
    std::unique_ptr<Target> target;
    std::string why;
    nlohmann::json detail;
};

nlohmann::json provenance_of(const CycleFrames& frames, const Sequence& sequence) {
    nlohmann::json json = {{"cycle", frames.cycle}, {"witnesses", {"board log", "camera id and time", "optical code"}}};
    int used = 0;
    for (const auto& frame : frames.slots) {
        if (!frame) continue;
        if (used++ == 0) {
            json["first_tick"] = frame->tick;
            json["exposure_ticks"] = frame->exposure_ticks;
        }
        json["last_tick"] = frame->tick;
    }
    json["basis_slots"] = sequence.basis.rows;
    json["frames"] = used;
    json["missing_slots"] = missing_basis_slots(frames, sequence);
    for (size_t s = 0; s < frames.neighbours.size(); ++s)
        if (!frames.neighbours[s].empty()) json["slots_from_neighbours"].push_back(s);
    return json;
}

// Noise variance of a recovered image over that of one row image, mean over lamps, for noise that does not depend on light.
double noise_gain(const Basis& basis) {
    double sum = 0;
    for (int image = 0; image < basis.images(); ++image) sum += noise_variance(basis, image);
    return sum / basis.images();
}

class TakeWriter {
  public:
    TakeWriter(const Sequence& sequence, const StageConfig& stage, const Calibration& calibration,
               const TakeMasks& masks, ArchiveWriter& archive)
        : sequence_(sequence),
          masks_(masks),
          archive_(archive),
          developer_(sequence, calibration.cameras[0], stage.cameras[0].noise, {masks.estimate, stage.lamps}),
          missing_(sequence),
          develop_thread_([this] { develop(); }),
          write_thread_([this] { write(); }) {}

    ~TakeWriter() {
        if (develop_thread_.joinable()) finish();
    }

    void add_frame(std::shared_ptr<const Frame> frame) {
        if (sequence_.slots[frame->slot].kind != SlotKind::basis) return;
        gather(frame->cycle).slots[frame->slot] = std::move(frame);
    }
    void add_missing(const MissingSlot& slot) { missing_.add(slot); }

    // Hands on the cycles whose triggers are all decided, and with neighbours those of the cycle after too.
    void hand_on(uint64_t decided) {
        for (; next_cycle_ < cycles() && (next_cycle_ + 1 + ahead_of(next_cycle_)) * sequence_.slots.size() <= decided;
             ++next_cycle_)
            hand_on_next();
    }

    // Waits until everything handed on is written, and completes the report.
    void finish() {
        to_develop_.close();
        develop_thread_.join();
        to_write_.close();
        write_thread_.join();
    }

    TakeReport report() const { return report_; }
    nlohmann::json missing_json() const { return missing_.to_json(); }

  private:
    uint64_t cycles() const { return uint64_t(sequence_.config.cycles); }
    uint64_t ahead_of(uint64_t cycle) const { return masks_.fill_from_neighbours && cycle + 1 < cycles() ? 1 : 0; }

    void hand_on_next() {
        const auto cycle = uint32_t(next_cycle_);
        if (!masks_.fill_from_neighbours) {
            to_develop_.push(std::move(gather(cycle)));
            gathered_.erase(cycle);
            return;
        }
        CycleFrames frames = gather(cycle);
        frames.neighbours.resize(frames.slots.size());
        for (const int slot : missing_basis_slots(frames, sequence_))
            for (const uint64_t other : {next_cycle_ - 1, next_cycle_ + 1})
                if (const auto kept = gathered_.find(uint32_t(other)); kept != gathered_.end())
                    if (const auto& frame = kept->second.slots[size_t(slot)])
                        frames.neighbours[size_t(slot)].push_back(frame);
        if (cycle > 0) gathered_.erase(cycle - 1);
        to_develop_.push(std::move(frames));
    }

    CycleFrames& gather(uint32_t cycle) {
        CycleFrames& frames = gathered_[cycle];
        frames.cycle = cycle;
        frames.slots.resize(sequence_.slots.size());
        return frames;
    }

    void develop() {
        while (auto frames = to_develop_.pop()) {
            const auto start = Clock::now();
            Outcome outcome{frames->cycle, nullptr, "", provenance_of(*frames, sequence_)};
            auto target = developer_.develop(*frames);
            if (target.ok()) {
                outcome.target = std::make_unique<Target>(std::move(*target));
                outcome.target->index = frames->cycle;
                if (outcome.target->provenance.is_object()) outcome.detail.update(outcome.target->provenance);
                outcome.detail["saturated_pixels"] = count(mask_saturated, *outcome.target, report_.saturated_share);
                outcome.detail["estimated_pixels"] = count(mask_estimated, *outcome.target, report_.estimated_share);
                outcome.detail["unsolved_pixels"] = count(mask_unsolved, *outcome.target, report_.unsolved_share);
                outcome.target->provenance = outcome.detail;
            } else {
                outcome.why = target.error().message;
            }
            frames.reset();  // its memory takes the camera's next frames
            report_.seconds_develop += seconds_since(start);
            to_write_.push(std::move(outcome));
        }
    }

    // The pixels with a mask bit; raises `worst` to their share.
    static int64_t count(MaskBit bit, const Target& target, double& worst) {
        const auto& mask = target.mask;
        const auto pixels = std::count_if(mask.begin(), mask.end(), [bit](uint32_t bits) { return (bits & bit) != 0; });
        worst = std::max(worst, double(pixels) / double(mask.size()));
        return pixels;
    }

    void write() {
        while (auto outcome = to_write_.pop()) {
            const auto start = Clock::now();
            Status status = outcome->target
                                ? archive_.write_target(*outcome->target)
                                : archive_.note_missing_target(0, outcome->cycle, outcome->why, outcome->detail);
            ++(outcome->target && status.ok() ? report_.targets_written : report_.targets_missing);
            if (!status.ok() && report_.write_error.empty())
                report_.write_error = fmt::format("target {}: {}", outcome->cycle, status.error().message);
            report_.seconds_write += seconds_since(start);
        }
    }

    const Sequence& sequence_;
    const TakeMasks masks_;
    ArchiveWriter& archive_;
    Developer developer_;
    MissingRanges missing_;
    std::map<uint32_t, CycleFrames> gathered_;
    uint64_t next_cycle_ = 0;
    TakeReport report_;  // each field is written by one thread, and read when all have ended
    EventQueue<CycleFrames> to_develop_{1};
    EventQueue<Outcome> to_write_{1};
    std::thread develop_thread_, write_thread_;
};

nlohmann::json describe_sequence(const Sequence& sequence) {
    auto kinds = std::string();
    for (const Slot& slot : sequence.slots) kinds += slot_kind_name(slot.kind)[0];
    return {{"basis", sequence.basis.name},
            {"cycles", sequence.config.cycles},
            {"slots", sequence.slots.size()},
            {"kinds", kinds},  // one letter a slot: basis, tracking, matte, dark
            {"frame_rate_hz", sequence.config.frame_rate_hz},
            {"period_ticks", sequence.slots.front().period_ticks},
            {"exposure_us",
             {{"basis", sequence.config.basis_exposure_us},
              {"tracking", sequence.config.tracking_exposure_us},
              {"matte", sequence.config.matte_exposure_us}}},
            {"noise_gain", noise_gain(sequence.basis)}};
}

}  // namespace

std::optional<double> measured_black(const Calibration& calibration) {
    if (calibration.source == "nominal") return std::nullopt;
    const auto& black = calibration.cameras[0].black.data;
    return std::accumulate(black.begin(), black.end(), 0.0) / double(black.size());
}

Result<TakeReport> run_take(Board& board, Camera& camera, const Sequence& sequence, const StageConfig& stage,
                            const Calibration& calibration, const TakeMasks& masks, ArchiveWriter& archive,
                            const std::atomic<bool>& stop, const std::function<void(const Frame&)>& identified,
                            const std::function<void(uint64_t decided, uint64_t total)>& progress) {
    const auto start = Clock::now();
    TakeWriter writer(sequence, stage, calibration, masks, archive);
    const RecordSink sink{[&](std::shared_ptr<const Frame> frame) {
                              identified(*frame);
                              writer.add_frame(std::move(frame));
                          },
                          [&](const MissingSlot& slot) { writer.add_missing(slot); },
                          [&](uint64_t decided, uint64_t total) {
                              writer.hand_on(decided);
                              progress(decided, total);
                          },
                          masks.fill_from_neighbours ? size_t(2) : size_t(0)};
    auto record = record_take(board, camera, sequence, stage, measured_black(calibration), sink, stop);
    writer.finish();
    if (!record.ok()) return record.error();
    TakeReport report = writer.report();
    report.record = *record;
    archive.add_to_manifest({{"sequence", describe_sequence(sequence)},
                             {"board", {{"id", board.id()}, {"firmware", board.info().firmware_version}}},
                             {"calibration", calibration.source},
                             {"identification",
                              {{"slots_total", record->slots_total},
                               {"slots_missing", record->slots_missing},
                               {"missing", writer.missing_json()},
                               {"frames", record->frames},
                               {"frames_discarded", record->frames_discarded},
                               {"duplicates", record->duplicates},
                               {"camera_restarts", record->camera_restarts},
                               {"clock_drift_ppm", record->clock_drift_ppm},
                               {"board_end", record->board_end}}}});
    const Status finished = archive.finish();
    if (!finished.ok() && report.write_error.empty()) report.write_error = finished.error().message;
    report.seconds_total = seconds_since(start);
    return report;
}

}  // namespace ols

// SPDX-License-Identifier: MIT
// Gathering frames, developing and writing them behind the recorder.
#include "take/take.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <numeric>
#include <thread>
#include <variant>

#include "develop/frame_store.hpp"
#include "record/camera_record.hpp"
#include "record/event_queue.hpp"
#include "record/missing_ranges.hpp"

namespace ols {

namespace {

using Clock = std::chrono::steady_clock;

double seconds_since(Clock::time_point start) {
    return std::chrono::duration<double>(Clock::now() - start).count();
}

// What one target is made of, and from which of the take's frames on it needs them.
struct Job {
    uint32_t index = 0;
    std::variant<CycleFrames, TargetFrames> frames;
    std::string lost_by;  // why the first of its slots that is missing is; "" when none is
};

// A target, or why there is none.
struct Outcome {
    uint32_t index = 0;
    std::unique_ptr<Target> target;
    std::string why;
    nlohmann::json detail;
};

const char* const witnesses[] = {"board log", "camera id and time", "optical code"};

nlohmann::json provenance_of(const CycleFrames& frames, const Sequence& sequence) {
    nlohmann::json json = {{"cycle", frames.cycle}, {"witnesses", witnesses}};
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

nlohmann::json provenance_of(const TargetFrames& frames, const Sequence& sequence) {
    const uint64_t length = sequence.slots.size();
    nlohmann::json json = {{"cycle", frames.basis.target / length},
                           {"slot", frames.basis.target % length},
                           {"witnesses", witnesses},
                           {"basis_slots", sequence.basis.rows},
                           {"frames", frames.frames.size() + frames.tracking.size()},
                           {"matte_frames", frames.matte.size()},
                           {"missing_slots", frames.basis.lost}};
    for (const auto& one : frames.tracking)
        if (one.number == frames.basis.target) json["tick"] = one.frame->tick;
    const auto by_tick = [](const auto& frame) { return frame->tick; };
    if (!frames.frames.empty()) {
        json["first_tick"] = std::ranges::min(frames.frames, {}, by_tick)->tick;
        json["last_tick"] = std::ranges::max(frames.frames, {}, by_tick)->tick;
        json["exposure_ticks"] = frames.frames.front()->exposure_ticks;
    }
    for (const auto& choice : frames.basis.choices)
        if (choice.is_stand_in) json["slots_from_neighbours"].push_back(choice.slot);
    for (const uint64_t number : frames.lost_tracking)
        json["tracking_missing"].push_back({{"cycle", number / length}, {"slot", number % length}});
    return json;
}

// Noise variance of a recovered image over that of one row image, mean over lamps, for noise that does not depend on light.
double noise_gain(const Basis& basis) {
    double sum = 0;
    for (int image = 0; image < basis.images(); ++image) sum += noise_variance(basis, image);
    return sum / basis.images();
}

// The targets that a take is to have, in order, each with the frames that it waits for and those it may still use.
struct Plan {
    struct Entry {
        uint64_t target = 0;  // number of a performance's tracking frame, or a cycle
        FrameRange frames;
    };
    std::vector<Entry> entries;

    Plan(const Sequence& sequence, const TakeMasks& masks, const TakeTargets& targets) {
        const uint64_t length = sequence.slots.size(), last = sequence.trigger_count() - 1;
        if (targets.every > 0) {
            for (const uint64_t target : target_numbers(sequence, targets.every))
                entries.push_back({target, frames_around(sequence, target)});
            return;
        }
        const uint64_t beside = masks.fill_from_neighbours ? length : 0;
        for (uint64_t cycle = 0; cycle < uint64_t(sequence.config.cycles); ++cycle) {
            const uint64_t first = cycle * length;
            entries.push_back({cycle, {std::max(first, beside) - beside, std::min(first + length - 1 + beside, last)}});
        }
    }
};

class TakeWriter {
  public:
    TakeWriter(const Sequence& sequence, const StageConfig& stage, const Calibration& calibration,
               const TakeMasks& masks, const TakeTargets& targets, ArchiveWriter& archive)
        : sequence_(sequence),
          masks_(masks),
          is_performance_(targets.every > 0),
          archive_(archive),
          developer_(sequence, calibration.cameras[0], stage.cameras[0].noise, {masks.estimate, stage.lamps}),
          motion_developer_(sequence, calibration.cameras[0], stage.cameras[0].noise, {masks.estimate, stage.lamps},
                            targets.quality, std::max(targets.every, 1)),
          plan_(sequence, masks, targets),
          store_(sequence),
          missing_(sequence),
          develop_thread_([this] { develop(); }),
          write_thread_([this] { write(); }) {}

    ~TakeWriter() {
        if (develop_thread_.joinable()) finish();
    }

    void add_frame(std::shared_ptr<const Frame> frame) {
        const SlotKind kind = sequence_.slots[frame->slot].kind;
        if (next_ == plan_.entries.size() || number_of(*frame, sequence_) < plan_.entries[next_].frames.first) return;
        const bool is_kept = is_performance_ ? kind != SlotKind::dark : kind == SlotKind::basis;
        if (is_kept) store_.add(std::move(frame));
    }
    void add_missing(const MissingSlot& slot) { missing_.add(slot); }

    // Hands on the targets whose frames are all decided.
    void hand_on(uint64_t decided) {
        for (; next_ < plan_.entries.size() && plan_.entries[next_].frames.last < decided; ++next_) {
            const Plan::Entry& entry = plan_.entries[next_];
            const auto index = uint32_t(next_);
            Job job{index, {}, missing_.cause_within(entry.frames.first, entry.frames.last)};
            if (is_performance_)
                job.frames = store_.around(index, entry.target);
            else
                job.frames = store_.cycle(uint32_t(entry.target), masks_.fill_from_neighbours);
            // What no later target needs is let go of before the camera may have to wait.
            const bool is_last = next_ + 1 == plan_.entries.size();
            store_.forget_before(is_last ? sequence_.trigger_count() : plan_.entries[next_ + 1].frames.first);
            to_develop_.push(std::move(job));
        }
    }

    // Waits until everything handed on is written, and completes the report.
    void finish() {
        to_develop_.close();
        develop_thread_.join();
        to_write_.close();
        write_thread_.join();
        report_.seconds_motion = motion_developer_.times();
    }

    TakeReport report() const { return report_; }
    nlohmann::json missing_json() const { return missing_.to_json(); }

  private:
    Result<Target> develop(const CycleFrames& frames) { return developer_.develop(frames); }
    Result<Target> develop(const TargetFrames& frames) { return motion_developer_.develop(frames); }

    void develop() {
        while (auto job = to_develop_.pop()) {
            const auto start = Clock::now();
            Outcome outcome{job->index, nullptr, "", {}};
            outcome.detail =
                std::visit([&](const auto& frames) { return provenance_of(frames, sequence_); }, job->frames);
            auto target = std::visit([&](const auto& frames) { return develop(frames); }, job->frames);
            if (target.ok()) {
                outcome.target = std::make_unique<Target>(std::move(*target));
                describe(*outcome.target, job->index, outcome.detail);
            } else {
                outcome.why = target.error().message;
                if (!job->lost_by.empty()) outcome.why += "; the first was lost because: " + job->lost_by;
            }
            job.reset();  // its memory takes the camera's next frames
            report_.seconds_develop += seconds_since(start);
            to_write_.push(std::move(outcome));
        }
    }

    void describe(Target& target, uint32_t index, nlohmann::json& detail) {
        target.index = index;
        if (target.provenance.is_object()) detail.update(target.provenance);
        detail["saturated_pixels"] = count(mask_saturated, target, report_.saturated_share);
        detail["estimated_pixels"] = count(mask_estimated, target, report_.estimated_share);
        detail["unsolved_pixels"] = count(mask_unsolved, target, report_.unsolved_share);
        if (!target.confidence.empty())
            detail["misaligned_pixels"] = count(mask_misaligned, target, report_.misaligned_share);
        target.provenance = detail;
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
                                : archive_.note_missing_target(0, outcome->index, outcome->why, outcome->detail);
            ++(outcome->target && status.ok() ? report_.targets_written : report_.targets_missing);
            if (!status.ok() && report_.write_error.empty())
                report_.write_error = fmt::format("target {}: {}", outcome->index, status.error().message);
            report_.seconds_write += seconds_since(start);
        }
    }

    const Sequence& sequence_;
    const TakeMasks masks_;
    const bool is_performance_;
    ArchiveWriter& archive_;
    Developer developer_;
    MotionDeveloper motion_developer_;
    const Plan plan_;
    FrameStore store_;
    MissingRanges missing_;
    size_t next_ = 0;    // of the plan
    TakeReport report_;  // each field is written by one thread, and read when all have ended
    EventQueue<Job> to_develop_{1};
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
            {"tick_hz", tick_hz},
            {"period_ticks", sequence.slots.front().period_ticks},
            {"exposure_us",
             {{"basis", sequence.config.basis_exposure_us},
              {"tracking", sequence.config.tracking_exposure_us},
              {"matte", sequence.config.matte_exposure_us}}},
            {"noise_gain", noise_gain(sequence.basis)}};
}

nlohmann::json describe_motion(const Sequence& sequence, const TakeTargets& targets) {
    const double half_cycle_s = 0.5 * double(sequence.cycle_ticks()) / double(tick_hz);
    return {{"quality", targets.quality.name},
            {"tracking_frames_a_target", targets.every},
            {"tracking_rate_hz", tracking_rate_hz(sequence)},
            // Of the basis, before and after a target.
            {"reach_ms", 1e3 * half_cycle_s * (targets.quality.interpolates ? 2 : 1)}};
}

}  // namespace

std::optional<double> measured_black(const Calibration& calibration) {
    if (calibration.source == "nominal") return std::nullopt;
    const auto& black = calibration.cameras[0].black.data;
    return std::accumulate(black.begin(), black.end(), 0.0) / double(black.size());
}

Result<TakeReport> run_take(Board& board, Camera& camera, const Sequence& sequence, const StageConfig& stage,
                            const Calibration& calibration, const TakeMasks& masks, const TakeTargets& targets,
                            ArchiveWriter& archive, const std::atomic<bool>& stop,
                            const std::function<void(const Frame&)>& identified,
                            const std::function<void(uint64_t decided, uint64_t total)>& progress) {
    const auto start = Clock::now();
    TakeWriter writer(sequence, stage, calibration, masks, targets, archive);
    const RecordSink sink{[&](std::shared_ptr<const Frame> frame) {
                              identified(*frame);
                              writer.add_frame(std::move(frame));
                          },
                          [&](const MissingSlot& slot) { writer.add_missing(slot); },
                          [&](uint64_t decided, uint64_t total) {
                              writer.hand_on(decided);
                              progress(decided, total);
                          },
                          targets.every > 0            ? size_t(3)
                          : masks.fill_from_neighbours ? size_t(2)
                                                       : size_t(0)};
    auto record = record_take(board, camera, sequence, stage, measured_black(calibration), sink, stop);
    writer.finish();
    if (!record.ok()) return record.error();
    TakeReport report = writer.report();
    report.record = *record;
    if (targets.every > 0) archive.add_to_manifest({{"motion", describe_motion(sequence, targets)}});
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
                               {"board_end", record->board_end},
                               {"camera_end", record->camera_end},
                               {"camera", camera_record(record->camera, record->camera_counts)}}}});
    const Status finished = archive.finish();
    if (!finished.ok() && report.write_error.empty()) report.write_error = finished.error().message;
    report.seconds_total = seconds_since(start);
    return report;
}

}  // namespace ols

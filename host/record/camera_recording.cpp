// SPDX-License-Identifier: MIT
// Identification, and when a recording is over.
#include "record/camera_recording.hpp"

#include <fmt/format.h>

namespace ols {

namespace {

// After the board's end, looks at a camera that shows no sign of life: a minute. Only then is the rest given up without the
// camera's word; a camera that lives says by its watermark when it has delivered everything, and one whose program has
// ended is known at once.
constexpr int silent_looks_max = Camera::device_patience_ms / CameraReader::pause_ms;
// After the board's end a camera that lives is behind by what its driver keeps, or by what it still renders: its frames are bounded by
// their number. One that gives none for so long, by the wall's clock, never comes to its end; and when the user has stopped the take
// it is not waited for as long, whatever it gives.
constexpr std::chrono::seconds ending_patience(300), stopped_patience(10);
// Frames from behind the last trigger by which those before it have come, be some of them late.
constexpr size_t late_frames_max = 2 * IdentifyOptions{}.reorder_frames;
// A camera that has not seen one trigger cannot tell when the last one was due. By its own clock it is given so long after the
// board's end.
constexpr uint64_t blind_patience_ns = 10'000'000'000;

std::string describe(const Frame& frame) {
    const char* names[] = {"none", "rggb", "bggr", "grbg", "gbrg", "rgb"};
    const char* cfa = size_t(frame.cfa) < std::size(names) ? names[size_t(frame.cfa)] : "unknown";
    return fmt::format("{} x {} pixels, cfa {}", frame.width, frame.height, cfa);
}

}  // namespace

IdentifyOptions identify_options(const Sequence& sequence, uint64_t camera_ns_at_start) {
    IdentifyOptions options;
    options.camera_ns_at_start = camera_ns_at_start;
    options.pending_max = sequence.slots.size() + 2 * options.reorder_frames;
    return options;
}

CameraRecording::CameraRecording(const Sequence& sequence, const RecordedCamera& recorded, size_t place,
                                 uint64_t camera_ns_at_start, const std::atomic<bool>& stop, RecordMonitor& monitor)
    : sequence_(sequence),
      recorded_(recorded),
      place_(place),
      stop_(stop),
      monitor_(monitor),
      identifier_(sequence, identify_options(sequence, camera_ns_at_start)),
      slots_total_(sequence.trigger_count()) {}

void CameraRecording::handle(RecordEvent event) {
    std::visit([this](auto& news) { take(std::move(news)); }, event);
    if (log_ended_ && !finished_ && Clock::now() - last_came_ > (stop_ ? stopped_patience : ending_patience))
        finish({Cause::camera_gone,
                "the camera went on without coming to an end: check it, or the program that reads it"});
    hand_on();
}

CameraReport CameraRecording::report() const {
    CameraReport report = report_;
    report.duplicates = identifier_.placer().duplicates();
    report.restarts = identifier_.placer().camera_restarts();
    report.clock = clock_.relation();
    return report;
}

void CameraRecording::take(FrameNews news) {
    ++report_.frames;
    if (!news.witness.unfit.empty() && report_.unfit_frame.empty()) report_.unfit_frame = describe(*news.frame);
    silent_looks_ = 0;
    look_at_bits(news);
    const uint64_t timestamp_ns = news.witness.stamp.timestamp_ns;
    frames_[news.witness.arrival] = std::move(news.frame);
    identifier_.add_frame(std::move(news.witness));
    if (!log_ended_) return;
    if (!stop_) last_came_ = Clock::now();  // it goes on: patience begins anew
    finish_if_beyond(timestamp_ns);
}

// A duplicate has the same stamp, too, and is the reorder window's to find. Of two frames with the same bits the one that came
// first is taken to be itself.
void CameraRecording::look_at_bits(FrameNews& news) {
    report_.frames_without_noise += news.witness.unfit.empty() && !news.bits.tells;
    const CameraStamp& stamp = news.witness.stamp;
    const auto first = bits_seen_.add(news.bits, {news.witness.arrival, stamp});
    if (!first || (first->stamp.frame_id == stamp.frame_id && first->stamp.timestamp_ns == stamp.timestamp_ns)) return;
    ++report_.stale_buffers;
    news.witness.unfit = {
        Cause::stale,
        fmt::format("stale: the camera's frame {} has, bit for bit, the samples of its frame {}, {} frames before: an "
                    "old buffer was handed out again",
                    stamp.frame_id, first->stamp.frame_id, news.witness.arrival - first->arrival)};
}

void CameraRecording::take(LogNews news) {
    fired_ = std::max(fired_, news.next_counter);
    identifier_.add_log(news.entries, news.next_counter, news.arrivals[place_]);
}

void CameraRecording::take(LogEnd end) {
    identifier_.end_log(end.why);
    log_ended_ = true;
    last_came_ = Clock::now();
    log_end_watermark_ns_ = last_watermark_ns_;
    // A camera that is live may have more to give, and says so at its next pause.
    if (camera_state_.kind != CameraState::live) finish_if_all_came();
}

void CameraRecording::take(CameraPause pause) {
    silent_looks_ = pause.watermark_ns <= last_watermark_ns_ ? silent_looks_ + 1 : 0;
    last_watermark_ns_ = std::max(last_watermark_ns_, pause.watermark_ns);
    camera_state_ = std::move(pause.state);
    disk_drops_ = pause.disk_drops, host_drops_ = pause.host_drops;
    if (log_ended_) finish_if_all_came();  // else the board still tells of triggers whose frames came
}

void CameraRecording::finish_if_all_came() {
    if (has_delivered_all(last_watermark_ns_))
        finish({});
    else if (camera_state_.kind != CameraState::live)
        finish({Cause::camera_gone, camera_state_.why});
    else if (silent_looks_ > silent_looks_max)
        finish({Cause::camera_gone,
                "the camera showed no sign of life for a minute: check it, or the program that reads it"});
}

// A camera that no trigger holds back does not pause. All has come when it has gone beyond the last trigger, by its time or
// by more frames than there are triggers.
void CameraRecording::finish_if_beyond(uint64_t timestamp_ns) {
    if (has_delivered_all(timestamp_ns)) ++frames_beyond_;
    ++frames_after_end_;
    if (frames_beyond_ > late_frames_max || frames_after_end_ > fired_ + late_frames_max) finish({});
}

void CameraRecording::finish(Reason why) {
    identifier_.end_frames(why, disk_drops_, host_drops_);
    report_.end = std::move(why);
    finished_ = true;
}

// By the camera's own word: its watermark, or a frame's time, is past the last trigger that was fired.
bool CameraRecording::has_delivered_all(uint64_t watermark_ns) const {
    if (fired_ == 0) return true;
    const auto last_ns = identifier_.placer().latest_time_of_ns(fired_ - 1);
    return watermark_ns > last_ns.value_or(log_end_watermark_ns_ + blind_patience_ns);
}

void CameraRecording::hand_on() {
    for (Verdict& verdict : identifier_.take_verdicts()) {
        if (verdict.kind == Verdict::missing) {
            report_.missing.add(verdict.slot.why.cause);
            recorded_.sink.missing(verdict.slot);
            continue;
        }
        const auto found = frames_.find(verdict.arrival);
        const std::shared_ptr<Frame> frame = std::move(found->second);
        frames_.erase(found);
        if (verdict.kind == Verdict::discarded) {
            ++report_.frames_discarded;
            report_.discarded.add(verdict.why.cause);
        } else {
            identified(frame, verdict.entry);
        }
    }
    monitor_.change_camera(recorded_.index, [this](CameraProgress& camera) {
        camera.slots_decided = identifier_.decided();
        camera.missing = report_.missing;
        camera.has_ended = finished_;
    });
    recorded_.sink.progress(identifier_.decided(), slots_total_);
}

void CameraRecording::identified(const std::shared_ptr<Frame>& frame, const ols_trigger_log_entry& entry) {
    frame->identified = true;
    frame->cycle = entry.cycle;
    frame->slot = entry.slot;
    frame->tick = entry.rise_ticks;
    frame->exposure_ticks = sequence_.slots[frame->slot].exposure_ticks;
    // A camera that began anew may have another clock: the relation is that of its last one.
    if (const uint64_t restarts = identifier_.placer().camera_restarts(); restarts != clock_restarts_) {
        clock_ = {};
        clock_restarts_ = restarts;
    }
    clock_.add(frame->tick, frame->stamp.timestamp_ns);
    recorded_.sink.frame(frame);
}

}  // namespace ols

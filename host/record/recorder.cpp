// SPDX-License-Identifier: MIT
// Two threads feed one queue, the camera's frames and the board's log; the caller's thread identifies.
#include "record/recorder.hpp"

#include <fmt/format.h>

#include <cmath>
#include <future>
#include <semaphore>
#include <thread>
#include <unordered_map>
#include <variant>

#include "exceptions.hpp"
#include "record/board_log.hpp"
#include "record/event_queue.hpp"
#include "record/frame_bits.hpp"

namespace ols {

namespace {

constexpr int read_pause_ms = 20;
// After the board's end, looks at a camera that shows no sign of life: a minute. Only then is the rest given up without the
// camera's word; a camera that lives says by its watermark when it has delivered everything, and one whose program has
// ended is known at once.
constexpr int silent_looks_max = Camera::device_patience_ms / read_pause_ms;
// After the board's end a camera that lives is behind by what its driver keeps: some tens of frames. One that is not at its end
// after so long, by the wall's clock, never will be; nor is it waited for as long when the user has stopped the take.
constexpr std::chrono::seconds ending_patience(300), stopped_patience(10);
// Frames from behind the last trigger by which those before it have come, be some of them late.
constexpr size_t late_frames_max = 2 * IdentifyOptions{}.reorder_frames;
// A camera that has not seen one trigger cannot tell when the last one was due. By its own clock it is given so long after the
// board's end.
constexpr uint64_t blind_patience_ns = 10'000'000'000;

IdentifyOptions options_for(const Sequence& sequence, uint64_t camera_ns_at_start = 0) {
    IdentifyOptions options;
    options.camera_ns_at_start = camera_ns_at_start;
    options.pending_max = sequence.slots.size() + 2 * options.reorder_frames;
    return options;
}

struct FrameNews {
    std::shared_ptr<Frame> frame;
    FrameWitness witness;
    FrameBits bits;  // of a whole frame
};
struct CameraPause {
    uint64_t watermark_ns;  // everything before it has been read
    CameraState state;
};
using Event = std::variant<FrameNews, CameraPause, LogNews, LogEnd>;

// Whether the samples are there, so that they can be looked at at all, and of the stage's size and colour filter.
bool is_whole(const Frame& frame, const CameraConfig& config) {
    const size_t sample_bytes = frame.format == PixelFormat::u16 ? sizeof(uint16_t) : sizeof(float);
    return frame.width == uint32_t(config.width) && frame.height == uint32_t(config.height) &&
           frame.cfa == config.cfa &&
           frame.pitch_bytes >= frame.width * size_t(samples_per_pixel(frame.cfa)) * sample_bytes &&
           frame.pitch_bytes % sample_bytes == 0 && frame.samples.size() >= size_t(frame.pitch_bytes) * frame.height;
}

std::string describe(const Frame& frame) {
    const char* names[] = {"none", "rggb", "bggr", "grbg", "gbrg", "rgb"};
    const char* cfa = size_t(frame.cfa) < std::size(names) ? names[size_t(frame.cfa)] : "unknown";
    return fmt::format("{} x {} pixels, cfa {}, {} bytes", frame.width, frame.height, cfa, frame.samples.size());
}

// Reads the camera into the queue until told to end. The number of frames in memory is bounded here, where they enter.
class CameraReader {
  public:
    CameraReader(Camera& camera, const CameraConfig& config, std::optional<double> black_counts, size_t frames_max,
                 EventQueue<Event>& queue)
        : camera_(camera),
          config_(config),
          black_counts_(black_counts),
          bits_(config),
          room_(std::make_shared<Room>(ptrdiff_t(frames_max))),
          queue_(queue) {
        thread_ = std::thread([this] {
            const Status done = guarded("the camera cannot be read", [this] { return read(), Status(Done{}); });
            if (!done) queue_.push(CameraPause{0, {CameraState::gone, done.error().message}});
        });
    }
    ~CameraReader() {
        end_ = true;
        thread_.join();
    }
    const std::atomic<uint64_t>& arrivals() const { return arrivals_; }

  private:
    using Room = std::counting_semaphore<>;

    void read() {
        while (!end_) {
            if (!room_->try_acquire_for(std::chrono::milliseconds(read_pause_ms))) continue;
            CameraState state = camera_.state();
            const bool is_live = state.kind == CameraState::live;
            const uint64_t watermark_ns = camera_.watermark_ns();
            auto frame = camera_.read(read_pause_ms);
            if (frame) {
                enqueue(std::move(*frame));
                continue;
            }
            room_->release();
            queue_.push(CameraPause{watermark_ns, std::move(state)});
            if (!is_live) return;
        }
    }

    void enqueue(Frame frame) {
        FrameNews news;
        news.witness.arrival = arrivals_++;
        news.witness.stamp = frame.stamp;
        if (!is_whole(frame, config_)) {
            news.witness.unfit = "its size or format is not the stage's";
        } else {
            news.witness.summary = summarize_frame(frame, black_counts_.value_or(frame.black), config_.noise);
            news.bits = bits_.read(frame);
        }
        news.frame = std::shared_ptr<Frame>(new Frame(std::move(frame)), [room = room_](Frame* last) {
            delete last;
            room->release();
        });
        queue_.push(std::move(news));
    }

    Camera& camera_;
    const CameraConfig& config_;
    const std::optional<double> black_counts_;
    const BitsReader bits_;
    const std::shared_ptr<Room> room_;  // frames may outlive the reader
    EventQueue<Event>& queue_;
    std::atomic<uint64_t> arrivals_ = 0;
    std::atomic<bool> end_ = false;
    std::thread thread_;
};

// The caller's side: identification and its account.
class Recording {
  public:
    Recording(const Sequence& sequence, const RecordSink& sink, uint64_t camera_ns_at_start,
              const std::atomic<bool>& stop)
        : sequence_(sequence),
          sink_(sink),
          stop_(stop),
          identifier_(sequence, options_for(sequence, camera_ns_at_start)) {
        report_.slots_total = sequence.trigger_count();
    }

    void handle(Event event) {
        std::visit([this](auto& news) { take(std::move(news)); }, event);
        if (log_ended_ && !finished_ && Clock::now() - log_end_ > (stop_ ? stopped_patience : ending_patience))
            finish("the camera went on without coming to an end: check it, or the program that reads it");
        hand_on();
    }
    bool finished() const { return finished_; }
    RecordReport report() const {
        RecordReport report = report_;
        report.duplicates = identifier_.placer().duplicates();
        report.camera_restarts = identifier_.placer().camera_restarts();
        return report;
    }

  private:
    using Clock = std::chrono::steady_clock;

    void take(FrameNews news) {
        ++report_.frames;
        if (!news.witness.unfit.empty() && report_.unfit_frame.empty()) report_.unfit_frame = describe(*news.frame);
        silent_looks_ = 0;
        look_at_bits(news);
        const uint64_t timestamp_ns = news.witness.stamp.timestamp_ns;
        frames_[news.witness.arrival] = std::move(news.frame);
        identifier_.add_frame(std::move(news.witness));
        if (log_ended_) finish_if_beyond(timestamp_ns);
    }
    // A duplicate has the same stamp, too, and is the reorder window's to find. Of two frames with the same bits the one that came
    // first is taken to be itself.
    void look_at_bits(FrameNews& news) {
        report_.frames_without_noise += news.witness.unfit.empty() && !news.bits.tells;
        const CameraStamp& stamp = news.witness.stamp;
        const auto first = bits_seen_.add(news.bits, {news.witness.arrival, stamp});
        if (!first || (first->stamp.frame_id == stamp.frame_id && first->stamp.timestamp_ns == stamp.timestamp_ns))
            return;
        ++report_.stale_buffers;
        news.witness.unfit = fmt::format(
            "stale: the camera's frame {} has, bit for bit, the samples of its frame {}, {} frames before: an old "
            "buffer was handed out again",
            stamp.frame_id, first->stamp.frame_id, news.witness.arrival - first->arrival);
    }
    void take(LogNews news) {
        fired_ = std::max(fired_, news.next_counter);
        identifier_.add_log(news.entries, news.next_counter, news.arrivals);
    }
    void take(LogEnd end) {
        report_.board_end = end.why;
        identifier_.end_log(end.why);
        log_ended_ = true;
        log_end_ = Clock::now();
        log_end_watermark_ns_ = last_watermark_ns_;
        // A camera that is live may have more to give, and says so at its next pause.
        if (camera_state_.kind != CameraState::live) finish_if_all_came();
    }
    void take(CameraPause pause) {
        report_.clock_drift_ppm = identifier_.placer().drift_ppm().value_or(report_.clock_drift_ppm);
        silent_looks_ = pause.watermark_ns <= last_watermark_ns_ ? silent_looks_ + 1 : 0;
        last_watermark_ns_ = std::max(last_watermark_ns_, pause.watermark_ns);
        camera_state_ = std::move(pause.state);
        if (log_ended_) finish_if_all_came();  // else the board still tells of triggers whose frames came
    }
    void finish_if_all_came() {
        if (has_delivered_all(last_watermark_ns_))
            finish("");
        else if (camera_state_.kind != CameraState::live)
            finish(camera_state_.why);
        else if (silent_looks_ > silent_looks_max)
            finish("the camera showed no sign of life for a minute: check it, or the program that reads it");
    }
    // A camera that no trigger holds back does not pause. All has come when it has gone beyond the last trigger, by its time or
    // by more frames than there are triggers.
    void finish_if_beyond(uint64_t timestamp_ns) {
        if (has_delivered_all(timestamp_ns)) ++frames_beyond_;
        ++frames_after_end_;
        if (frames_beyond_ > late_frames_max || frames_after_end_ > fired_ + late_frames_max) finish("");
    }
    void finish(std::string why) {
        identifier_.end_frames(why);
        report_.camera_end = std::move(why);
        finished_ = true;
    }

    // By the camera's own word: its watermark, or a frame's time, is past the last trigger that was fired.
    bool has_delivered_all(uint64_t watermark_ns) const {
        if (fired_ == 0) return true;
        const auto last_ns = identifier_.placer().latest_time_of_ns(fired_ - 1);
        return watermark_ns > last_ns.value_or(log_end_watermark_ns_ + blind_patience_ns);
    }

    void hand_on() {
        for (Verdict& verdict : identifier_.take_verdicts()) {
            if (verdict.kind == Verdict::missing) {
                ++report_.slots_missing;
                sink_.missing(verdict.slot);
                continue;
            }
            const auto found = frames_.find(verdict.arrival);
            const std::shared_ptr<Frame> frame = std::move(found->second);
            frames_.erase(found);
            if (verdict.kind == Verdict::discarded) {
                ++report_.frames_discarded;
                continue;
            }
            frame->identified = true;
            frame->cycle = verdict.entry.cycle;
            frame->slot = verdict.entry.slot;
            frame->tick = verdict.entry.rise_ticks;
            frame->exposure_ticks = sequence_.slots[frame->slot].exposure_ticks;
            sink_.frame(frame);
        }
        sink_.progress(identifier_.decided(), report_.slots_total);
    }

    const Sequence& sequence_;
    const RecordSink& sink_;
    const std::atomic<bool>& stop_;
    Identifier identifier_;
    std::unordered_map<uint64_t, std::shared_ptr<Frame>> frames_;  // by arrival, until their verdict
    BitsSeen bits_seen_;
    RecordReport report_;
    uint64_t fired_ = 0, last_watermark_ns_ = 0, log_end_watermark_ns_ = 0;
    int silent_looks_ = 0;
    uint64_t frames_after_end_ = 0, frames_beyond_ = 0;  // of the log; of these, from behind the last trigger
    CameraState camera_state_;
    bool log_ended_ = false, finished_ = false;
    Clock::time_point log_end_;
};

// The camera's time at its start. A start that the camera does not answer ends when the user wants to stop.
Result<uint64_t> start_unless(Camera& camera, const std::atomic<bool>& stop) {
    auto started = std::async(std::launch::async, [&] { return camera.start(); });
    while (started.wait_for(std::chrono::milliseconds(read_pause_ms)) != std::future_status::ready)
        if (stop) camera.stop();
    return started.get();
}

// A camera that delivers, until this goes.
struct StartedCamera {
    StartedCamera(Camera& started, const std::atomic<bool>& stop)
        : camera(started), time_ns(start_unless(started, stop)) {}
    ~StartedCamera() { camera.stop(); }
    StartedCamera(const StartedCamera&) = delete;
    Camera& camera;
    const Result<uint64_t> time_ns;
};

}  // namespace

Status start_board(Board& board, const Sequence& sequence, const StageConfig& stage) {
    if (board.info().tick_hz != tick_hz)
        return fail(
            fmt::format("the board's clock runs at {} Hz and not at {}: flash the firmware of this release: "
                        "make flash",
                        uint32_t(board.info().tick_hz), tick_hz));
    if (const auto status = board.status(); !status.ok())
        return status.error();
    else if (status->state == OLS_STATE_FAULT)
        return fail("the board has a latched fault, " + fault_text(*status) +
                    "; when the cause is gone, run `stagectl status --clear-fault`");
    const auto program = encode_program(sequence, stage);
    if (Status s = board.load(program, uint16_t(sequence.slots.size()), uint16_t(stage.chain_bits),
                              uint32_t(sequence.config.cycles), sequence.config.playback);
        !s.ok())
        return s;
    if (Status s = board.arm(sequence.config.playback); !s.ok()) return s;
    Status started = board.start();
    if (!started.ok()) board.tell_to_stop();  // it may play without its answer having come
    return started;
}

size_t frames_in_flight(const Sequence& sequence, size_t cycles_kept) {
    return (3 + cycles_kept) * sequence.slots.size() + 4 * options_for(sequence).reorder_frames;
}

Result<RecordReport> record_take(Board& board, Camera& camera, const Sequence& sequence, const StageConfig& stage,
                                 std::optional<double> black_counts, const RecordSink& sink,
                                 const std::atomic<bool>& stop) {
    const CameraConfig& config = stage.cameras[0];
    if (const Status status = camera.set_up(config); !status.ok()) return status.error();
    const CameraCounts counts_before = camera.counts();
    const StartedCamera started(camera, stop);
    if (!started.time_ns.ok()) return started.time_ns.error();
    if (stop) return fail("stopped before the take began");
    if (const Status status = start_board(board, sequence, stage); !status.ok()) return status.error();

    const size_t in_flight = frames_in_flight(sequence, sink.cycles_kept);
    EventQueue<Event> queue(in_flight + 64);
    Recording recording(sequence, sink, *started.time_ns, stop);
    const auto why_stop = [&]() -> std::string {
        if (stop) return "the take was stopped";
        const CameraState state = camera.state();
        return state.kind == CameraState::live ? "" : "the take was stopped: " + state.why;
    };
    {
        CameraReader reader(camera, config, black_counts, in_flight, queue);
        BoardLog log(
            board, PlayBounds(sequence), reader.arrivals(), why_stop,
            [&](LogNews news) { queue.push(std::move(news)); }, [&](LogEnd end) { queue.push(std::move(end)); });
        while (!recording.finished()) recording.handle(std::move(*queue.pop()));
        queue.close();
    }
    RecordReport report = recording.report();
    report.camera = camera.info();
    report.camera_counts = camera.counts().since(counts_before);
    return report;
}

}  // namespace ols

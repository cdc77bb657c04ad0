// SPDX-License-Identifier: MIT
// The board's log goes to every camera's recording, each of which has a queue and threads of its own.
#include "record/recorder.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <deque>
#include <future>
#include <thread>

#include "exceptions.hpp"
#include "record/board_log.hpp"
#include "record/camera_reader.hpp"
#include "record/camera_recording.hpp"

namespace ols {

namespace {

// The camera's time at its start. A start that the camera does not answer ends when the user wants to stop.
Result<uint64_t> start_unless(Camera& camera, const std::atomic<bool>& stop) {
    auto started = std::async(std::launch::async, [&] { return camera.start(); });
    while (started.wait_for(std::chrono::milliseconds(CameraReader::pause_ms)) != std::future_status::ready)
        if (stop) camera.stop();
    return started.get();
}

// A camera that delivers, until this goes.
struct StartedCamera {
    StartedCamera(Camera& started, const std::shared_ptr<FrameRoom>& room, const std::atomic<bool>& stop)
        : camera((started.borrow_from(room), started)), time_ns(start_unless(started, stop)) {}
    ~StartedCamera() {
        camera.stop();
        camera.borrow_from(nullptr);
    }
    StartedCamera(const StartedCamera&) = delete;
    Camera& camera;
    const Result<uint64_t> time_ns;
};

// A camera that is being recorded: from its start to its report.
class CameraTake {
  public:
    CameraTake(const RecordedCamera& recorded, size_t place, const Sequence& sequence, const std::atomic<bool>& stop,
               std::shared_ptr<FrameRoom> room, RecordMonitor& monitor)
        : recorded_(recorded),
          place_(place),
          sequence_(sequence),
          stop_(stop),
          monitor_(monitor),
          beat_(monitor.stages().add(fmt::format("camera {} identification", recorded.index))),
          room_(std::move(room)),
          counts_before_(recorded.camera.counts()),
          started_(recorded.camera, room_, stop) {
        monitor.add_camera(recorded.index, room_);
    }
    ~CameraTake() {
        if (thread_.joinable()) thread_.join();
    }
    const Result<uint64_t>& time_ns() const { return started_.time_ns; }
    CameraState state() const {
        if (has_failed_) return {CameraState::gone, failure_.error().message};
        return recorded_.camera.state();
    }
    uint64_t arrivals() const { return reader_->arrivals(); }

    void begin(const CameraConfig& config) {
        recording_.emplace(sequence_, recorded_, place_, *started_.time_ns, stop_, monitor_);
        reader_.emplace(recorded_.camera, config,
                        CameraReaderOptions{recorded_.black_counts, room_, recorded_.sink.waits_for_disk}, queue_,
                        monitor_, recorded_.index);
        thread_ = std::thread([this] {
            failure_ = guarded("its frames cannot be taken", [this] { return identify(), Status(Done{}); });
            has_failed_ = !failure_.ok();
            beat_.beat(StageActivity::ended);
            queue_.close();
        });
    }
    void tell(RecordEvent news) { queue_.push(std::move(news)); }

    CameraReport finish() {
        thread_.join();
        reader_.reset();
        CameraReport report = recording_->report();
        if (has_failed_) report.end = {Cause::camera_gone, failure_.error().message};
        report.index = recorded_.index;
        report.camera = recorded_.camera.info();
        report.counts = recorded_.camera.counts().since(counts_before_);
        return report;
    }

  private:
    void identify() {
        while (!recording_->finished()) {
            beat_.beat(StageActivity::waits_for_input);
            RecordEvent event = std::move(*queue_.pop());
            beat_.beat();
            recording_->handle(std::move(event));
        }
    }

    const RecordedCamera& recorded_;
    const size_t place_;
    const Sequence& sequence_;
    const std::atomic<bool>& stop_;
    RecordMonitor& monitor_;
    StageBeat& beat_;
    const std::shared_ptr<FrameRoom> room_;
    const CameraCounts counts_before_;
    const StartedCamera started_;
    RecordQueue queue_{SIZE_MAX};
    std::optional<CameraRecording> recording_;
    std::optional<CameraReader> reader_;
    Status failure_ = Done{};
    std::atomic<bool> has_failed_ = false;
    std::thread thread_;
};

Result<std::shared_ptr<FrameRoom>> room_of(const RecordedCamera& recorded, const Sequence& sequence,
                                           const StageConfig& stage) {
    if (recorded.sink.room) return recorded.sink.room;
    FrameRoom::Options options;
    options.frames_max = frames_in_flight(sequence);
    options.frame_bytes = stage.cameras[recorded.index].frame_bytes();
    return FrameRoom::create(options);
}

}  // namespace

Status arm_board(Board& board, const Sequence& sequence, const StageConfig& stage) {
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
    return board.arm(sequence.config.playback);
}

Status start_armed_board(Board& board) {
    Status started = board.start();
    if (!started.ok()) board.tell_to_stop();  // it may play without its answer having come
    return started;
}

Status start_board(Board& board, const Sequence& sequence, const StageConfig& stage) {
    if (const Status armed = arm_board(board, sequence, stage); !armed.ok()) return armed;
    return start_armed_board(board);
}

size_t frames_in_flight(const Sequence& sequence, size_t cycles_kept) {
    return (3 + cycles_kept) * sequence.slots.size() + 4 * identify_options(sequence).reorder_frames;
}

Result<RecordReport> record_take(Board& board, const std::vector<RecordedCamera>& cameras, const Sequence& sequence,
                                 const StageConfig& stage, const StopRequest& stop, RecordMonitor* monitor,
                                 bool is_armed) {
    RecordMonitor own_monitor;
    if (!monitor) monitor = &own_monitor;
    for (const RecordedCamera& recorded : cameras)
        if (const Status status = recorded.camera.set_up(stage.cameras[recorded.index]); !status.ok())
            return status.error();
    std::deque<CameraTake> takes;
    for (const RecordedCamera& recorded : cameras) {
        auto room = room_of(recorded, sequence, stage);
        if (!room.ok()) return room.error();
        takes.emplace_back(recorded, takes.size(), sequence, stop.wanted, std::move(*room), *monitor);
        if (!takes.back().time_ns().ok()) return takes.back().time_ns().error();
    }
    if (stop.wanted) return fail("stopped before the take began");
    const Status status = is_armed ? start_armed_board(board) : start_board(board, sequence, stage);
    if (!status.ok()) return status.error();

    for (size_t i = 0; i < cameras.size(); ++i) takes[i].begin(stage.cameras[cameras[i].index]);
    // With no camera left nobody would see what the board plays.
    const auto why_stop = [&]() -> Reason {
        if (Reason asked = stop.reason(); !asked.empty()) return asked;
        std::string why;
        for (const CameraTake& take : takes) {
            const CameraState state = take.state();
            if (state.kind == CameraState::live) return {};
            why += (why.empty() ? "" : "; ") + state.why;
        }
        return {Cause::camera_gone, "the take was stopped: " + why};
    };
    const auto arrivals = [&] {
        std::vector<uint64_t> counts;
        for (const CameraTake& take : takes) counts.push_back(take.arrivals());
        return counts;
    };
    RecordReport report{sequence.trigger_count(), {}, {}, {}};
    monitor->change_board([&](BoardProgress& board) { board.triggers_planned = report.slots_total; });
    {
        BoardLog log(
            board, PlayBounds(sequence), arrivals, why_stop,
            [&](const LogNews& news) {
                for (CameraTake& take : takes) take.tell(news);
            },
            [&](const LogEnd& end) {
                report.board_end = end.why;
                for (CameraTake& take : takes) take.tell(end);
            },
            {}, monitor);
        for (CameraTake& take : takes) report.cameras.push_back(take.finish());
        report.host_clock = log.host_clock();
    }
    return report;
}

}  // namespace ols

// SPDX-License-Identifier: MIT
// A whole take in one process: a board that plays by the frames that its camera has exposed, and a camera whose pictures have the
// light of their slots. No clock of the machine decides anything.
#pragma once

#include <cmath>
#include <condition_variable>
#include <deque>
#include <random>

#include "device/camera.hpp"
#include "device/delivery_count.hpp"
#include "played_board.hpp"
#include "take/take.hpp"

namespace ols::test {

// Each lamp lights a spot of the picture; noise is the paper's camera's.
class PlayedScene {
  public:
    PlayedScene(const Sequence& sequence, const CameraConfig& camera) : camera_(camera) {
        const int width = camera.width, height = camera.height;
        for (const Slot& slot : sequence.slots) {
            std::vector<double>& mean = means_.emplace_back(size_t(width * height), 0.0);
            for (size_t lamp = 0; lamp < slot.lit.size(); ++lamp) {
                if (!slot.lit[lamp]) continue;
                const bool matte = lamp >= 156;
                const double x = matte ? 2 + double(lamp - 156) : double(int(lamp) * 7 % width);
                const double y = matte ? 1 : double(int(lamp) * 5 % height);
                for (int p = 0; p < width * height; ++p) {
                    const double dx = p % width - x, dy = p / width - y;
                    mean[size_t(p)] += (matte ? 0.5 : 0.4) * std::exp(-(dx * dx + dy * dy) / 20);
                }
            }
            for (double& one : mean) one *= slot.exposure_ticks / 125.0;
        }
    }

    // The frame of one trigger; the same each time.
    void expose(uint64_t trigger, Frame& frame) const {
        std::mt19937 random{uint32_t(trigger)};
        std::normal_distribution<double> gauss;
        auto* samples = reinterpret_cast<uint16_t*>(frame.samples.data());
        for (const double mean : means_[trigger % means_.size()]) {
            const double counts = camera_.black + mean + (2.68 + 0.492 * std::sqrt(mean)) * gauss(random);
            *samples++ = uint16_t(std::clamp(std::lround(counts), 0L, 4095L));
        }
    }

  private:
    const CameraConfig camera_;
    std::vector<std::vector<double>> means_;  // counts above black, of each slot
};

// Exposes as fast as it is read, and at most `room` frames ahead; the board fires with it. With `drops` it does not wait for room.
class PlayedCamera : public Camera {
  public:
    struct Options {
        size_t room = 8;
        // Before each exposure, with its trigger's number; may wait.
        std::function<void(uint64_t)> before = [](uint64_t) {};
        bool drops = false;
    };

    PlayedCamera(const Sequence& sequence, const CameraConfig& camera, Options options)
        : sequence_(sequence), scene_(sequence, camera), options_(std::move(options)) {
        CameraInfo& info = info_;
        info.name = "played camera", info.link = "memory", info.setup = camera;
    }
    PlayedCamera(const Sequence& sequence, const CameraConfig& camera) : PlayedCamera(sequence, camera, Options()) {}
    ~PlayedCamera() override { end(); }

    uint64_t exposed() const { return exposed_; }
    bool is_full() const {
        const std::lock_guard lock(mutex_);
        return waiting_.size() >= options_.room;
    }
    // The board's clock: what has been exposed.
    uint64_t ticks() const {
        return exposed_ == 0 ? 0 : PlayedBoard::first_rise_ticks + (exposed_ - 1) * period_ticks() + period_ticks() / 2;
    }
    // Exposes from the board's start on, to the end or until it is stopped.
    void play(PlayedBoard& board) {
        thread_ = std::thread([&] {
            while (!board.started_ticks() && !ended_) std::this_thread::yield();
            for (uint64_t n = 0; n < sequence_.trigger_count() && !ended_; ++n) {
                options_.before(n);
                expose(n);
                if (board.triggers_fired() <= n) return;  // it was stopped
            }
            ++exposed_;  // the clock goes on beyond the last
        });
    }
    void end() {
        ended_ = true;
        changed_.notify_all();
        if (thread_.joinable()) thread_.join();
    }

    CameraInfo info() const override { return info_; }
    Status set_up(const CameraSetup&) override { return Done{}; }
    Result<uint64_t> start() override {
        delivery_.start(clock_begin_ns);
        return clock_begin_ns;
    }
    void stop() override {}
    std::optional<Frame> read(int timeout_ms) override {
        std::unique_lock lock(mutex_);
        changed_.wait_for(lock, std::chrono::milliseconds(timeout_ms), [&] { return !waiting_.empty(); });
        if (waiting_.empty()) return std::nullopt;
        const uint64_t trigger = waiting_.front();
        waiting_.pop_front();
        changed_.notify_all();
        lock.unlock();
        Frame frame = picture(trigger);
        (void)delivery_.take(frame.stamp);
        return frame;
    }
    uint64_t watermark_ns() const override {
        const std::lock_guard lock(mutex_);
        return waiting_.empty() ? clock_begin_ns + ticks() * 8 : 0;
    }
    CameraCounts counts() const override {
        CameraCounts counts = delivery_.counts();
        counts.dropped = dropped_;
        return counts;
    }
    CameraState state() const override { return {}; }

  private:
    static constexpr uint64_t clock_begin_ns = 3'000'000'000;

    uint64_t period_ticks() const { return sequence_.slots.front().period_ticks; }
    void expose(uint64_t trigger) {
        std::unique_lock lock(mutex_);
        if (!options_.drops) changed_.wait(lock, [&] { return waiting_.size() < options_.room || ended_; });
        ++exposed_;
        if (waiting_.size() < options_.room)
            waiting_.push_back(trigger);
        else
            ++dropped_;
        changed_.notify_all();
    }
    Frame picture(uint64_t trigger) {
        Frame frame = new_frame();
        frame.stamp = {trigger + 1, clock_begin_ns + (PlayedBoard::first_rise_ticks + trigger * period_ticks()) * 8};
        frame.width = uint32_t(info_.setup.width), frame.height = uint32_t(info_.setup.height);
        frame.cfa = info_.setup.cfa;
        frame.pitch_bytes = frame.width * 2;
        frame.samples.resize(size_t(frame.pitch_bytes) * frame.height);
        scene_.expose(trigger, frame);
        return frame;
    }

    const Sequence& sequence_;
    const PlayedScene scene_;
    const Options options_;
    CameraInfo info_;
    mutable std::mutex mutex_;
    std::condition_variable changed_;
    std::deque<uint64_t> waiting_;  // triggers
    std::atomic<uint64_t> exposed_ = 0, dropped_ = 0;
    std::atomic<bool> ended_ = false;
    DeliveryCount delivery_;
    std::thread thread_;
};

// What a take needs, small: one camera of 16 x 16 pixels.
struct PlayedTake {
    explicit PlayedTake(const std::string& basis, int cycles, PlayedCamera::Options camera_options = {})
        : description(describe(basis, cycles)),
          camera(description.sequence, description.stage.cameras[0], std::move(camera_options)),
          model([this] { return camera.ticks(); }, description.sequence.slots.front().period_ticks),
          board(std::move(*Board::connect(model.connect()))) {}

    // One target a cycle, into an archive or another sink.
    template <typename Sink>
    Result<TakeReport> run(Sink& sink, TakeMonitor* monitor = nullptr) {
        TakeSinks sinks{{{sink, {}}}, identified, progress};
        sinks.monitor = monitor;
        camera.play(model);
        auto report = run_take(description, {board, {&camera}}, sinks, stop);
        camera.end();
        return report;
    }

    static TakeDescription describe(const std::string& basis, int cycles) {
        StageConfig stage = default_stage();
        stage.cameras[0].width = stage.cameras[0].height = 16;
        stage.cameras[0].cfa = Cfa::none;
        SequenceConfig config;
        config.basis = basis;
        config.cycles = cycles;
        config.basis_exposure_us = basis == "single" ? 412 : 100;
        return {*compile_sequence(config, stage), stage, nominal_calibration(stage), {}};
    }

    TakeDescription description;
    PlayedCamera camera;
    PlayedBoard model;
    Board board;
    StopRequest stop;
    std::function<void(const Frame&)> identified = [](const Frame&) {};
    std::function<void(uint64_t, uint64_t)> progress = [](uint64_t, uint64_t) {};
};

}  // namespace ols::test

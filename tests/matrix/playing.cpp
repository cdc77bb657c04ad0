// SPDX-License-Identifier: MIT
// Two threads: the recorder's, as in any take, and the stage's, which makes time pass.
#include "playing.hpp"

#include <condition_variable>
#include <deque>
#include <thread>

#include "camera_link.hpp"
#include "host_board.hpp"
#include "lit_frames.hpp"
#include "record/recorder.hpp"

namespace ols::test {

namespace {

constexpr uint64_t camera_ahead_ns = 77'000'000'000;  // of the board's clock
constexpr double camera_drift = 23e-6;
// The stage waits while so many triggers are not decided; a cycle and what waits for its proof are fewer.
constexpr uint64_t undecided_max = 450;
// The board's log keeps 1024.
constexpr uint64_t log_unread_max = 500;
// From one stall's end to the next: what waits in the camera's buffers has been read, or nobody could tell which stall it was.
constexpr uint64_t apart = 1200;
// Frames that the recorder holds (frames_in_flight) before it reads no more, and some.
constexpr uint64_t held_max = 700;

// What the recorder hands on, and a gate before it that can be closed.
class Account {
  public:
    explicit Account(Played& played) : played_(played) {}

    RecordSink sink() {
        return {[this](const std::shared_ptr<const Frame>& frame) { keep(*frame); },
                [this](const MissingSlot& slot) {
                    played_.missing.push_back({slot.counter, cause_name(slot.why.cause), slot.why.text});
                },
                [this](uint64_t decided, uint64_t) { decided_ = decided; }, nullptr,
                [this] {
                    // Asked for when the recorder finds no room.
                    if (is_closed_) is_full_ = true;
                    return disk_waits_.load();
                }};
    }
    uint64_t decided() const { return decided_; }
    // Whether the recorder has found that the gate leaves it no room.
    const std::atomic<bool>& is_full() const { return is_full_; }
    void close_gate(bool disk) {
        const std::lock_guard lock(mutex_);
        is_closed_ = true;
        disk_waits_ = disk;
    }
    void open_gate() {
        const std::lock_guard lock(mutex_);
        is_closed_ = is_full_ = disk_waits_ = false;
        opened_.notify_all();
    }

  private:
    void keep(const Frame& frame) {
        std::unique_lock lock(mutex_);
        opened_.wait(lock, [this] { return !is_closed_; });
        const uint64_t trigger = frame.cycle * played_.sequence.slots.size() + frame.slot;
        played_.kept.emplace_back(trigger,
                                  LitFrames::trigger_of(reinterpret_cast<const uint16_t*>(frame.samples.data())));
    }

    Played& played_;
    std::mutex mutex_;
    std::condition_variable opened_;
    std::atomic<bool> is_closed_ = false, is_full_ = false, disk_waits_ = false;
    std::atomic<uint64_t> decided_ = 0;
};

class Stage {
  public:
    Stage(const Scenario& scenario, HostBoard& board, CameraLink& link, Account& account, const CameraConfig& camera,
          Played& played)
        : scenario_(scenario),
          board_(board),
          link_(link),
          account_(account),
          played_(played),
          light_(played.sequence, camera, scenario.seed),
          camera_(camera) {
        link_.set_now(camera_time_ns(0));
    }

    // Until `is_over`.
    void run(const std::atomic<bool>& is_over) {
        while (!board_.has_started() && !is_over) {
            link_.serve();
            rest();
        }
        played_.lit = light_.lit_slots();
        start_us_ = board_.now_us();
        const uint64_t end = played_.sequence.trigger_count();
        for (uint64_t n = 0; n < end && !is_over && expose(n); ++n) after(n);
        account_.open_gate();
        for (; !held_.empty(); held_.pop_front()) send(held_.front().trigger, held_.front().shot);
        board_.run_out();
        // The camera's time goes on, so that it is known that nothing more comes.
        for (uint64_t more_ns = 0; !is_over; more_ns += 20'000'000) {
            link_.set_now(last_ns_ + more_ns);
            rest();
        }
    }

  private:
    struct Held {
        uint64_t trigger;
        Shot shot;
        int64_t frames_left;
    };

    static void rest() { std::this_thread::sleep_for(std::chrono::microseconds(200)); }
    // By its own clock, at so many ticks of the board's.
    uint64_t camera_time_ns(uint64_t ticks) const {
        const auto own_ns = int64_t(camera_ahead_ns + uint64_t(double(ticks) * 8 * (1 + camera_drift)));
        return uint64_t(own_ns + jumped_ns_);
    }

    // False when the board fires no more.
    bool expose(uint64_t n) {
        keep_pace(n);
        if (n == played_.injection.board_ends_at + 1) board_.fail(scenario_.board);
        const auto rise_ticks = board_.fire(n);
        if (!rise_ticks) return false;
        ++played_.fired;
        const auto found = played_.injection.strikes.find(n);
        const bool is_struck = found != played_.injection.strikes.end();
        const Strike strike = is_struck ? found->second : Strike{};
        const auto is = [&](FaultKind kind) { return is_struck && strike.kind == kind; };
        if (is(FaultKind::clock_jump)) jumped_ns_ += strike.amount;
        if (is(FaultKind::restart)) next_id_ = 1;
        last_ns_ = camera_time_ns(start_us_ * 125 + *rise_ticks);
        link_.set_now(last_ns_);
        if (is(FaultKind::miss_trigger)) return true;
        Shot shot{{next_id_++, last_ns_}, uint32_t(camera_.width), uint32_t(camera_.height), {}};
        shot.samples = light_.expose(n, !is(FaultKind::no_light));
        if (is(FaultKind::stale_buffer) && !last_samples_.empty()) shot.samples = last_samples_;
        if (is(FaultKind::bad_time)) shot.stamp.timestamp_ns += 150'000;
        if (is(FaultKind::wrong_size)) {
            shot.height -= 2;
            shot.samples.resize(size_t(shot.width) * shot.height);
        }
        if (is(FaultKind::lose_frame) || is(FaultKind::cut_frame))
            link_.lose(shot, strike.kind == FaultKind::cut_frame, account_.is_full());
        else if (is(FaultKind::late_within) || is(FaultKind::late_beyond))
            held_.push_back({n, std::move(shot), strike.amount});
        else if (is(FaultKind::swap_next))
            held_.push_back({n, std::move(shot), 1});
        else
            deliver(n, shot, is(FaultKind::twice) ? 2 : 1);
        return true;
    }

    void send(uint64_t trigger, const Shot& shot) {
        if (link_.send(shot, account_.is_full())) {
            if (shot.height == uint32_t(camera_.height)) last_samples_ = shot.samples;
            return;
        }
        ++found_no_room_;
        played_.without_room.push_back(trigger);
    }

    void deliver(uint64_t trigger, const Shot& shot, int times) {
        for (int n = 0; n < times; ++n) send(trigger, shot);
        for (size_t i = 0; i < held_.size();) {
            if (--held_[i].frames_left > 0) {
                ++i;
                continue;
            }
            const Held late = std::move(held_[i]);
            held_.erase(held_.begin() + ptrdiff_t(i));
            send(late.trigger, late.shot);
        }
    }

    // Closes and opens the gate as stalls begin and end.
    void after(uint64_t n) {
        if (stall_ && (found_no_room_ >= stall_->frames || n >= stall_until_)) {
            played_.stalled.emplace_back(stall_from_, n);
            played_.stalls_of_disk.push_back(stall_->disk);
            stall_.reset();
            stall_ended_at_ = n;
            account_.open_gate();
        }
        const auto begins = played_.injection.stalls.find(n);
        if (stall_ || begins == played_.injection.stalls.end() || n < stall_ended_at_ + apart) return;
        stall_ = begins->second;
        stall_from_ = n;
        // A link that does not tell loses what is beyond all that is held.
        stall_until_ = n + held_max + uint64_t(link_.room() + stall_->frames);
        found_no_room_ = 0;
        account_.close_gate(stall_->disk);
    }

    // Virtual pace, but for stalls: whoever records is not outrun, be this machine as slow as it may. Where nothing is decided for long it
    // is what was injected that cannot be decided, and time goes on until something is.
    void keep_pace(uint64_t n) {
        for (int rests = 0; n >= board_.log_wanted_from() + log_unread_max ||
                            (!stall_ && n >= account_.decided() + undecided_max && account_.decided() != given_up_at_);
             ++rests) {
            if (rests > 500) given_up_at_ = account_.decided();
            rest();
        }
    }

    const Scenario& scenario_;
    HostBoard& board_;
    CameraLink& link_;
    Account& account_;
    Played& played_;
    LitFrames light_;
    const CameraConfig& camera_;
    std::vector<uint16_t> last_samples_;
    std::deque<Held> held_;
    uint64_t start_us_ = 0, last_ns_ = 0, next_id_ = 1;
    int64_t jumped_ns_ = 0;
    std::optional<Stall> stall_;
    uint64_t stall_ended_at_ = 0, stall_from_ = 0, stall_until_ = 0, given_up_at_ = UINT64_MAX;
    int found_no_room_ = 0;
};

std::unique_ptr<CameraLink> make_link(const std::string& name, const Scenario& scenario, const std::string& work) {
    if (name == "gige") return make_gige_link(scenario);
    if (name == "v4l2") return make_v4l2_link(scenario);
    return make_ring_link(scenario, work);
}

nlohmann::json describe(const RecordReport& report) {
    const CameraReport& camera = report.cameras.front();
    return {{"board_end", report.board_end.text},
            {"camera_end", camera.end.text},
            {"frames", camera.frames},
            {"dropped", camera.counts.dropped},
            {"missing_ids", camera.counts.missing_ids},
            {"underrun", camera.counts.underrun},
            {"duplicates", camera.duplicates},
            {"restarts", camera.restarts},
            {"discarded", camera.discarded.to_json()}};
}

}  // namespace

Result<Played> play_take(const Scenario& scenario, const std::string& link_name, int take, const std::string& work) {
    SequenceConfig config;
    config.basis = scenario.basis;
    config.cycles = scenario.cycles;
    config.basis_exposure_us = scenario.basis == "single" ? 412 : 100;
    StageConfig stage = default_stage();
    CameraConfig& camera = stage.cameras.front();
    camera.width = scenario.width, camera.height = scenario.height, camera.cfa = Cfa::none;
    auto sequence = compile_sequence(config, stage);
    if (!sequence.ok()) return sequence.error();
    Played played;
    played.sequence = std::move(*sequence);
    played.injection = draw_injection(scenario, played.sequence, take);

    HostBoard host_board;
    auto board = Board::connect(host_board.connect());
    if (!board.ok()) return board.error();
    const auto link = make_link(link_name, scenario, work);
    for (const FaultSpec& fault : scenario.faults)
        if (!link->can(fault.kind))
            return fail(std::string("no camera at a link like ") + link_name + " does " + fault_kind_name(fault.kind));
    Account account(played);
    Stage world(scenario, host_board, *link, account, camera, played);
    std::atomic<bool> is_over = false;
    std::thread world_thread([&] { world.run(is_over); });
    Result<RecordReport> report = fail("");
    {
        auto driver = link->open();
        StopRequest stop;
        if (driver.ok())
            report = record_take(*board, {{**driver, 0, {}, account.sink()}}, played.sequence, stage, stop);
        else
            report = driver.error();
    }
    is_over = true;
    account.open_gate();
    world_thread.join();
    if (!report.ok()) return report.error();
    played.report = describe(*report);
    return played;
}

}  // namespace ols::test

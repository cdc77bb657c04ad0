// SPDX-License-Identifier: MIT
// Conductor: the daemon's states, and the thread that does what was asked for: it alone uses the board and the cameras.
#pragma once

#include <atomic>
#include <chrono>
#include <condition_variable>
#include <functional>
#include <future>
#include <map>
#include <memory>
#include <mutex>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <thread>

#include "daemon/events.hpp"
#include "daemon/stage_devices.hpp"
#include "daemon/states.hpp"
#include "daemon/stuck_watch.hpp"
#include "daemon/take_plan.hpp"
#include "take/card.hpp"
#include "take/stage_watch.hpp"
#include "take/take_monitor.hpp"

namespace ols {

// A take or a calibration that runs.
struct RunningTake {
    std::string name, archive, activity;  // "take" or "calibration"
    double seconds_planned = 0;
    uint64_t target_bytes = 0;  // of one target's file at most
    std::chrono::steady_clock::time_point began;
    TakeMonitor monitor;
    mutable std::atomic<bool> dark_is_told = false;
};

// Of all takes and calibrations since the start.
struct TakeTotals {
    struct OfCamera {
        uint64_t frames = 0;
        CauseCounts missing;
    };
    std::map<uint32_t, OfCamera> cameras;
    uint64_t triggers = 0, targets_written = 0, targets_missing = 0;

    void add(const TakeProgress& progress);
    void know(const StageConfig& stage);  // its cameras, of which nothing came yet
};

// What the daemon is, at one moment.
struct Snapshot {
    DaemonState state = DaemonState::idle;
    std::string fault, devices, sequence, waits_for;
    bool fault_is_latched = false;  // stays until it is cleared
    bool is_busy = false;           // something that was asked for is under way
    nlohmann::json plan;            // of what is armed or running
    nlohmann::json last_take;       // what became of it
    std::shared_ptr<const RunningTake> take;
    TakeTotals totals;  // without the running one's
};

// Functions may be called from any thread; one thing is done at a time, and what comes meanwhile is refused with what it is.
class Conductor {
  public:
    // `stage` was read from the file `config_path`. Returns when the devices have been looked at.
    Conductor(std::string config_path, StageConfig stage, EventLog& events);
    ~Conductor();

    Result<nlohmann::json> arm(const TakeRequest& request);
    // Returns when light is about to come, or the arm button is awaited; how it ends is told by events. A stage that is armed
    // otherwise is armed anew.
    Result<nlohmann::json> record(const TakeRequest& request);
    Result<nlohmann::json> swap(const std::string& sequence_name);
    // Returns when it has begun.
    Result<nlohmann::json> calibrate(const CardOptions& card);
    Result<nlohmann::json> clear_fault();
    Result<nlohmann::json> reload();

    // Ends the light at once and returns when the board has confirmed that it is dark. `by`: who or what asked. The error says that it
    // has not, and what to do.
    Result<nlohmann::json> stop(const std::string& by);

    // Looks at what runs, from the main thread: tells its progress and the board's dark, and ends it where the disk comes to its
    // reserve. The name of a stage of the pipeline that works and has not advanced for `stuck_after`; empty when all do.
    std::string follow(std::chrono::seconds stuck_after);

    // Ends a running take for a reason of the daemon's own: it finishes what it has.
    void end_take(EventKind kind, const std::string& why);

    Snapshot snapshot() const;
    StageConfig stage() const;  // in force

    // Ends the light, finishes what is held, and ends the thread. `progress` is called every so often meanwhile.
    void shut_down(const std::function<void()>& progress);

  private:
    using Clock = std::chrono::steady_clock;
    // Between two looks at devices that nobody uses. The board's heartbeat, without which an armed board goes dark, is some seconds.
    static constexpr std::chrono::milliseconds look_pause{500};
    using Outcome = Result<nlohmann::json>;
    using Reply = std::shared_ptr<std::promise<Outcome>>;

    // Runs `job` in the thread, and returns what it replies, which may be before it ends. Refused while another is under way, and where
    // the state does not allow `method` when its turn comes.
    Outcome run(const std::string& method, const std::string& what, std::function<void(const Reply&)> job);
    // The two halves of that. `lock` is held, and nothing is under way.
    std::future<Outcome> begin_job(const std::string& what, std::function<void(const Reply&)> job);
    static Outcome reply_of(std::future<Outcome> replied, const std::string& what);
    void work();
    void look_at_devices();
    Status hold_devices();
    Status darken_found();
    void give_up(const std::string& why);

    Status arm_now(const TakeRequest& request);
    void record_now(const TakeRequest& request, const Reply& reply);
    Status wait_for_button(StageWatch& watch);
    Result<TakeReport> run_planned(TakePlan& plan, std::vector<PlannedArchive>& archives, StageWatch& watch,
                                   const Reply& reply, nlohmann::json& watched);
    void end_record(const Result<TakeReport>& report, const std::vector<PlannedArchive>& archives,
                    const nlohmann::json& watched);
    void calibrate_now(CardOptions card, const Reply& reply);
    Outcome darken(const std::string& by, Clock::time_point asked);

    // Only from the state `from`, where one is given.
    void change_state(DaemonState state, const std::string& text = "", std::optional<DaemonState> from = {});
    void enter_fault(const std::string& why, bool is_latched);
    void begin_take(std::shared_ptr<RunningTake> take);
    void say_notes(const std::vector<std::string>& notes);

    // What follow() has seen of the running take.
    struct Followed {
        std::shared_ptr<const RunningTake> take;
        uint64_t missing = 0;  // slots, that were told
        Clock::time_point next_progress, next_missing;
        StuckWatch stages;
    };
    void tell_progress(const TakeProgress& progress, Clock::time_point now);
    void tell_dark(const RunningTake& take);
    void watch_disk(const TakeProgress& progress);

    const std::string config_path_;
    EventLog& events_;
    StopRequest stop_;

    mutable std::mutex mutex_;
    std::condition_variable changed_;
    StageConfig stage_;
    Snapshot now_;
    std::function<void()> job_;  // that waits or runs
    std::string job_name_;
    bool ends_ = false;

    // The thread's own.
    std::optional<StageDevices> devices_;
    std::optional<TakePlan> plan_;  // of what is armed
    Clock::time_point next_look_;
    bool has_failed_in_light_ = false;  // since the last look at the devices: what that finds gone was gone in light
    std::thread thread_;

    Followed followed_;  // the main thread's own
};

}  // namespace ols

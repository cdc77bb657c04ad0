// SPDX-License-Identifier: MIT
// The main thread: signals, systemd's watchdog, and the look at what runs.
#include "daemon/daemon.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <poll.h>
#include <systemd/sd-daemon.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <csignal>
#include <filesystem>

#include "daemon/http_server.hpp"
#include "daemon/journal_log.hpp"
#include "daemon/local_server.hpp"

namespace ols {

namespace {

constexpr int look_ms = 100;
// A target of many pixels in quality final takes a minute of one stage of the pipeline, on a slow machine.
constexpr std::chrono::seconds stuck_after(120);
constexpr uint64_t ending_extension_us = 30'000'000;  // systemd waits for as long from each call on

int signal_pipe[2] = {-1, -1};

void pass_on(int signal_number) {
    const int error = errno;
    const char byte = char(signal_number);
    (void)!::write(signal_pipe[1], &byte, 1);
    errno = error;
}

// SIGTERM, SIGINT and SIGHUP as they come. By handlers and a pipe: libraries have threads of their own before main(), in which no mask of
// ours would hold a signal back.
class Signals {
  public:
    Signals() {
        if (::pipe2(signal_pipe, O_CLOEXEC | O_NONBLOCK) != 0) return;
        struct sigaction action {};
        action.sa_handler = pass_on;
        action.sa_flags = SA_RESTART;
        for (const int number : {SIGTERM, SIGINT, SIGHUP}) sigaction(number, &action, nullptr);
    }

    // 0: none within `timeout_ms`.
    int wait(int timeout_ms) {
        pollfd ready{signal_pipe[0], POLLIN, 0};
        (void)::poll(&ready, 1, timeout_ms);
        char byte;
        return ::read(signal_pipe[0], &byte, 1) == 1 ? int(byte) : 0;
    }
};

// The state as `systemctl status` shows it.
class ShownState {
  public:
    // Where it differs from what was said last.
    void show(const Snapshot& now) {
        std::string text = state_name(now.state);
        if (!now.fault.empty()) text += ": " + now.fault;
        if (now.take) text += ": " + now.take->name;
        std::ranges::replace(text, '\n', ' ');
        if (text == said_) return;
        sd_notifyf(0, "STATUS=%s", text.c_str());
        said_ = std::move(text);
    }

  private:
    std::string said_;
};

// The first signal ends the light and lets what is held be finished; a second one ends at once.
void shut_down(Conductor& conductor, Signals& signals, ShownState& shown) {
    conductor.shut_down([&] {
        if (conductor.follow(stuck_after).empty())
            sd_notifyf(0, "EXTEND_TIMEOUT_USEC=%llu\nWATCHDOG=1", static_cast<unsigned long long>(ending_extension_us));
        shown.show(conductor.snapshot());
        const int signal = signals.wait(0);
        if (signal == SIGTERM || signal == SIGINT) ::_exit(1);
    });
}

void run_until_told(Conductor& conductor, EventLog& events, Signals& signals, ShownState& shown) {
    bool is_stuck = false, reload_waits = false;
    for (;;) {
        const int signal = signals.wait(look_ms);
        if (signal == SIGTERM || signal == SIGINT) return;
        if (signal == SIGHUP && !std::exchange(reload_waits, true) &&
            !find_method("reload")->is_allowed(conductor.snapshot().state))
            events.add(EventKind::note, "the configuration is read anew when nothing runs and nothing is armed");
        const Snapshot now = conductor.snapshot();
        if (reload_waits && find_method("reload")->is_allowed(now.state) && !now.is_busy) {
            const auto known_wrong = events.counts()[EventKind::configuration_wrong];
            // What is wrong with it is an event; without one something else came between.
            reload_waits = !conductor.reload() && events.counts()[EventKind::configuration_wrong] == known_wrong;
        }
        const std::string stuck = conductor.follow(stuck_after);
        if (!stuck.empty() && !is_stuck)
            events.add(
                EventKind::pipeline_stuck,
                fmt::format(
                    "{} has not advanced for {} s: systemd will start the daemon anew; finished targets are kept",
                    stuck, stuck_after.count()));
        is_stuck = !stuck.empty();
        if (!is_stuck) sd_notify(0, "WATCHDOG=1");
        shown.show(now);
    }
}

}  // namespace

Status check_configuration(const std::string& path) {
    const auto stage = read_stage(path);
    if (!stage) return stage.error();
    return check_daemon(*stage, false);
}

Status run_daemon(const DaemonOptions& options) {
    Signals signals;
    auto stage = read_stage(options.config_path);
    if (!stage) return stage.error();
    if (const Status fits = check_daemon(*stage, true); !fits) return fits;
    const DaemonSetup setup = stage->daemon;
    std::error_code ignored;
    std::filesystem::create_directories(std::filesystem::path(setup.socket).parent_path(), ignored);
    EventLog events(make_log());
    Conductor conductor(options.config_path, std::move(*stage), events);
    Api api(conductor, events, options.program_version);
    auto local = LocalServer::listen(setup, api, events);
    if (!local) return local.error();
    std::unique_ptr<HttpServer> http;
    if (setup.http_port > 0) {
        auto listening = HttpServer::listen(setup, api, events);
        if (!listening) return listening.error();
        http = std::move(*listening);
    }
    std::string where = "'" + setup.socket + "'";
    if (http) where += fmt::format(" and http://127.0.0.1:{} (token in '{}')", setup.http_port, token_file_of(setup));
    events.add(EventKind::daemon_started, options.program_version + " listens at " + where);
    sd_notify(0, "READY=1");
    ShownState shown;
    run_until_told(conductor, events, signals, shown);
    sd_notify(0, "STOPPING=1");
    events.add(EventKind::daemon_stopping, "told to end: the light goes out, and what was recorded is finished");
    shut_down(conductor, signals, shown);
    return Done{};
}

}  // namespace ols

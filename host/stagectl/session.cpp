// SPDX-License-Identifier: MIT
// Opening the stage, stopping, and progress.
#include "stagectl/session.hpp"

#include <fmt/format.h>
#include <unistd.h>

#include <chrono>
#include <csignal>
#include <optional>
#include <thread>

#include "device/usb_device.hpp"

namespace ols {

namespace {

StopRequest stop_request;

void request_stop(int signal_number) {
    stop_request.wanted = true;
    std::signal(signal_number, SIG_DFL);
}

constexpr uint32_t retry_ms = 100;

// Between two tries. A board that is plugged in ends it at once where the system tells of it; elsewhere it is found by the next try.
class RetryPause {
  public:
    explicit RetryPause(const std::string& board_link) {
        if (!board_link.starts_with("usb:")) return;
        if (auto bus = open_usb_bus(); bus.ok()) usb_ = std::move(*bus);
    }
    void wait() {
        if (usb_) return usb_->wait_for_change(retry_ms);
        std::this_thread::sleep_for(std::chrono::milliseconds(retry_ms));
    }

  private:
    std::unique_ptr<UsbBus> usb_;
};

// What `open` gives, tried again while it fails, the wait is not over and the user does not stop it.
template <typename Open>
auto open_within(double wait_s, const std::string& board_link, Open open) {
    const auto deadline = std::chrono::steady_clock::now() + std::chrono::duration<double>(wait_s);
    auto opened = open();
    if (!opened.ok() && wait_s > 0)
        fmt::print(stderr, "stagectl: {}: waiting, {:g} s at most\n", opened.error().message, wait_s);
    std::optional<RetryPause> pause;
    while (!opened.ok() && !stop_request.wanted && std::chrono::steady_clock::now() < deadline) {
        if (!pause) pause.emplace(board_link);
        pause->wait();
        opened = open();
    }
    return opened;
}

std::string board_link(const LinkOptions& options, const StageConfig& stage) {
    return options.board.empty() ? stage.board : options.board;
}

Result<Board> connect_board(const std::string& link, const LinkOptions& options) {
    Patience patience(int(options.patience_s * 1e3), &stop_request.wanted);
    auto transfer = open_transfer(link, patience.begin_exchange());
    if (!transfer.ok()) return transfer.error();
    return Board::connect(std::move(*transfer), patience);
}

// The number and source of each camera to open.
Result<std::vector<std::pair<uint32_t, std::string>>> camera_sources(const LinkOptions& options,
                                                                     const StageConfig& stage,
                                                                     std::optional<uint32_t> only) {
    const size_t count = stage.cameras.size();
    if (only && *only >= count)
        return fail(fmt::format("there is no camera {}: the stage has 0 to {}", *only, count - 1));
    if (!options.cameras.empty() && options.cameras.size() != (only ? 1 : count))
        return fail(
            fmt::format("--camera is given {} times and {} {} to be opened: give one source for each, in the order "
                        "of the stage's [[camera]]",
                        options.cameras.size(), only ? 1 : count, only || count == 1 ? "camera is" : "cameras are"));
    std::vector<std::pair<uint32_t, std::string>> sources;
    for (uint32_t c = only.value_or(0); c < (only ? *only + 1 : count); ++c) {
        const std::string& source = options.cameras.empty() ? stage.cameras[c].source : options.cameras[only ? 0 : c];
        if (source.empty()) return fail("which camera? give --camera, or a source in the stage's [[camera]]");
        for (const auto& [number, earlier] : sources)
            if (earlier == source)
                return fail(
                    fmt::format("cameras {} and {} are both {}: each needs a source of its own", number, c, source));
        sources.emplace_back(c, source);
    }
    return sources;
}

Error which_board() {
    return fail("which board? give --board, or a link in the stage's [board]");
}

}  // namespace

void LinkOptions::add_to(CLI::App& verb, bool with_camera) {
    verb.add_option("--stage", stage_path, "stage.toml; without it, the default stage");
    verb.add_option(
        "--board", board,
        "the board, usb:, usb:SERIAL, socket:PATH, can:IFACE or can-socket:PATH; otherwise stage.toml's [board] link");
    if (with_camera)
        verb.add_option("--camera", cameras,
                        "the camera, aravis:SERIAL, v4l2:/dev/video0, ring:PATH or fake:RATE; once for each [[camera]] "
                        "of the stage, "
                        "in their order; "
                        "otherwise stage.toml's camera sources")
            ->allow_extra_args(false);
    verb.add_option("--wait", wait_s,
                    "seconds to wait for what is not there yet, as a board to be plugged in or a virtual stage that "
                    "still renders")
        ->check(CLI::NonNegativeNumber);
    verb.add_option("--patience", patience_s,
                    "seconds of the wall's clock that the board may take for one answer before it is given up")
        ->check(CLI::Range(0.1, 3600.0))
        ->capture_default_str();
}

Result<StageConfig> open_stage(const LinkOptions& options) {
    if (options.stage_path.empty()) return default_stage();
    return read_stage(options.stage_path);
}

Result<Board> open_board(const LinkOptions& options, const StageConfig& stage) {
    const std::string link = board_link(options, stage);
    if (link.empty()) return which_board();
    return open_within(options.wait_s, link, [&] { return connect_board(link, options); });
}

Result<StageSession> open_session(const LinkOptions& options, std::optional<uint32_t> only) {
    auto stage = open_stage(options);
    if (!stage.ok()) return stage.error();
    const auto sources = camera_sources(options, *stage, only);
    if (!sources.ok()) return sources.error();
    const std::string link = board_link(options, *stage);
    if (link.empty()) return which_board();
    // All anew at each try: a ring that an earlier virtual stage left behind is not the one that comes with the board.
    return open_within(options.wait_s, link, [&]() -> Result<StageSession> {
        StageSession session{*stage, nullptr, {}};
        for (const auto& [index, source] : *sources) {
            auto camera = open_camera(source, index);
            if (!camera.ok()) return camera.error();
            session.cameras.push_back(std::move(*camera));
        }
        auto board = connect_board(link, options);
        if (!board.ok()) return board.error();
        session.board = std::make_unique<Board>(std::move(*board));
        return session;
    });
}

StopRequest& stop_on_signal() {
    std::signal(SIGINT, request_stop);
    std::signal(SIGTERM, request_stop);
    return stop_request;
}

void say(const std::vector<std::string>& sentences) {
    for (const std::string& sentence : sentences) fmt::print(stderr, "stagectl: {}\n", sentence);
}

Status wait_for_arm(StageWatch& watch) {
    say({"waiting for the arm button"});
    return watch.wait_for_arm();
}

Error because_of(const StopRequest& stop, const Error& error) {
    const std::string why = stop.why();
    return why.empty() ? error : fail(error.message + ": " + why);
}

void show_progress(const char* label, uint64_t done, uint64_t total) {
    static const bool terminal = isatty(STDERR_FILENO);
    static int shown = -1;
    const int percent = total ? int(done * 100 / total) : 100;
    if (!terminal || percent == shown) return;
    shown = percent;
    // Not fmt::print, which throws: no take ends because its terminal went away.
    std::fprintf(stderr, "\r%s %3d %%%s", label, percent, percent == 100 ? "\n" : "");
}

}  // namespace ols

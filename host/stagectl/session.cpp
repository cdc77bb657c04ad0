// SPDX-License-Identifier: MIT
// Opening the stage, stopping, and progress.
#include "stagectl/session.hpp"

#include <fmt/format.h>
#include <unistd.h>

#include <csignal>

namespace ols {

namespace {

std::atomic<bool> stop_requested = false;
static_assert(std::atomic<bool>::is_always_lock_free, "set in a signal handler");

void request_stop(int signal_number) {
    stop_requested = true;
    std::signal(signal_number, SIG_DFL);
}

}  // namespace

void LinkOptions::add_to(CLI::App& verb, bool with_camera) {
    verb.add_option("--stage", stage_path, "stage.toml; without it, the default stage");
    verb.add_option("--board", board,
                    "the board, usb:, usb:SERIAL or socket:PATH; otherwise stage.toml's [board] link");
    if (with_camera)
        verb.add_option("--camera", camera, "the camera, ring:PATH or fake:RATE; otherwise stage.toml's camera source");
}

Result<StageConfig> open_stage(const LinkOptions& options) {
    if (options.stage_path.empty()) return default_stage();
    return read_stage(options.stage_path);
}

Result<Board> open_board(const LinkOptions& options, const StageConfig& stage) {
    const std::string link = options.board.empty() ? stage.board : options.board;
    if (link.empty()) return fail("which board? give --board, or a link in the stage's [board]");
    auto transfer = open_transfer(link);
    if (!transfer.ok()) return transfer.error();
    return Board::connect(std::move(*transfer));
}

Result<StageSession> open_session(const LinkOptions& options) {
    auto stage = open_stage(options);
    if (!stage.ok()) return stage.error();
    if (stage->cameras.size() != 1)
        return fail(
            fmt::format("the stage has {} cameras and a take is recorded from one: keep one [[camera]] in "
                        "the stage",
                        stage->cameras.size()));
    const std::string source = options.camera.empty() ? stage->cameras[0].source : options.camera;
    if (source.empty()) return fail("which camera? give --camera, or a source in the stage's [[camera]]");
    auto camera = open_camera(source);
    if (!camera.ok()) return camera.error();
    auto board = open_board(options, *stage);
    if (!board.ok()) return board.error();
    return StageSession{std::move(*stage), std::make_unique<Board>(std::move(*board)), std::move(*camera)};
}

const std::atomic<bool>& stop_on_signal() {
    std::signal(SIGINT, request_stop);
    std::signal(SIGTERM, request_stop);
    return stop_requested;
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

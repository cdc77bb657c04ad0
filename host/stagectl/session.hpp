// SPDX-License-Identifier: MIT
// What the verbs that play share: the stage with its board and camera opened, a stop flag set by Ctrl-C, a progress bar.
#pragma once

#include <CLI/CLI.hpp>
#include <atomic>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "device/board.hpp"
#include "device/camera.hpp"
#include "record/stop_request.hpp"
#include "stage/stage.hpp"
#include "take/stage_watch.hpp"

namespace ols {

// --stage, --board, --camera, --wait and --patience.
struct LinkOptions {
    std::string stage_path, board;
    std::vector<std::string> cameras;  // sources, in the order of the stage's
    double wait_s = 0;
    double patience_s = Patience::exchange_ms / 1e3;

    void add_to(CLI::App& verb, bool with_camera);

    // Neither stage nor devices: what a verb does is the daemon's to do.
    bool names_nothing() const { return stage_path.empty() && board.empty() && cameras.empty(); }
};

struct StageSession {
    StageConfig stage;
    std::unique_ptr<Board> board;
    std::vector<std::unique_ptr<Camera>> cameras;  // in the order asked for
};

// The default stage without --stage.
Result<StageConfig> open_stage(const LinkOptions& options);

// Options win over stage.toml. Errors say which of them is missing. What is not there yet is tried again until wait_s is over.
Result<Board> open_board(const LinkOptions& options, const StageConfig& stage);
// Opens the stage's cameras, or only the one of a number.
Result<StageSession> open_session(const LinkOptions& options, std::optional<uint32_t> only = {});

// Is asked at the first SIGINT or SIGTERM, which also ends every wait for the board within Patience::stop_ms, as any other reason to
// stop does; the second signal ends the program at once.
StopRequest& stop_on_signal();

// Prints sentences to standard error.
void say(const std::vector<std::string>& sentences);

// Says that it waits, and waits for the arm button.
Status wait_for_arm(StageWatch& watch);

// The error with the reason for a stop, where there was one.
Error because_of(const StopRequest& stop, const Error& error);

// Draws "label 42 %" on a terminal, nothing elsewhere; ends the line at the last.
void show_progress(const char* label, uint64_t done, uint64_t total);

// Runs a verb: prints its error and makes it exit code 1.
template <typename F>
int report_errors(F verb) {
    const Result<int> exit_code = verb();
    if (exit_code.ok()) return *exit_code;
    std::fprintf(stderr, "stagectl: %s\n", exit_code.error().message.c_str());
    return 1;
}

}  // namespace ols

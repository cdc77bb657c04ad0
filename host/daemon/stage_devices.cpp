// SPDX-License-Identifier: MIT
// Opening, looking at, and darkening what the stage names.
#include "daemon/stage_devices.hpp"

#include <fmt/format.h>

namespace ols {

Result<StageDevices> StageDevices::open(const StageConfig& stage, const StopRequest& stop) {
    StageDevices devices;
    for (uint32_t index = 0; index < stage.cameras.size(); ++index) {
        const std::string& source = stage.cameras[index].source;
        if (source.empty())
            return fail(fmt::format(
                "the stage names no source for camera {}: add it to its [[camera]], as \"aravis:SERIAL\"", index));
        auto camera = open_camera(source, index);
        if (!camera.ok()) return camera.error();
        devices.cameras_.push_back(std::move(*camera));
    }
    auto board = open_board(stage, stop);
    if (!board.ok()) return board.error();
    devices.board_ = std::make_unique<Board>(std::move(*board));
    return devices;
}

Result<Board> StageDevices::open_board(const StageConfig& stage, const StopRequest& stop) {
    if (stage.board.empty()) return fail("the stage names no board: add [board] link to it, as \"usb:\"");
    Patience patience(Patience::exchange_ms, &stop.wanted);
    auto transfer = open_transfer(stage.board, patience.begin_exchange());
    if (!transfer.ok()) return transfer.error();
    return Board::connect(std::move(*transfer), patience);
}

Status StageDevices::look(bool armed) {
    const auto status = board_->status();
    if (!status.ok()) return status.error();
    if (status->boot_nonce != board_->info().boot_nonce)
        return fail(board_->name() + " was reset: clear the fault with `stagectl status --clear-fault`");
    if (status->state == OLS_STATE_FAULT)
        return fail("the board has a latched fault, " + fault_text(*status) +
                    "; when the cause is gone, `stagectl status --clear-fault`");
    if (status->state == OLS_STATE_PLAYING || status->state == OLS_STATE_WAITING)
        return fail(fmt::format("{} is {}, and no take runs: another program uses it", board_->name(),
                                ols::state_name(status->state)));
    if (armed && status->state != OLS_STATE_ARMED)
        return fail(fmt::format("{} was armed and is {}: another program has used it", board_->name(),
                                ols::state_name(status->state)));
    for (const auto& camera : cameras_)
        if (const CameraState state = camera->look(); state.kind != CameraState::live) return fail(state.why);
    return Done{};
}

Status StageDevices::make_dark(Board& board) {
    // A board that has nothing to stop refuses; what it does then tell is what counts.
    (void)board.stop();
    const auto status = board.status();
    if (!status.ok()) return status.error();
    if (status->state == OLS_STATE_PLAYING || status->state == OLS_STATE_WAITING)
        return fail(fmt::format("{} was told to stop and is still {}", board.name(), ols::state_name(status->state)));
    return Done{};
}

std::vector<Camera*> StageDevices::cameras() const {
    std::vector<Camera*> cameras;
    for (const auto& camera : cameras_) cameras.push_back(camera.get());
    return cameras;
}

std::string StageDevices::account() const {
    const auto& info = board_->info();
    std::string text = fmt::format("{} ({}), firmware {}", board_->name(), info.board, info.firmware_version);
    for (size_t index = 0; index < cameras_.size(); ++index) {
        const CameraInfo camera = cameras_[index]->info();
        text += fmt::format("; camera {}: {}, {}", index, camera.name, camera.link);
    }
    return text;
}

}  // namespace ols

// SPDX-License-Identifier: MIT
// The sequencer board, asked as `stagectl status` asks it.
#include <fmt/format.h>

#include "doctor/check_up.hpp"
#include "doctor/shipped.hpp"

namespace ols {

namespace {

Findings skip_rest(const std::string& why) {
    return {skipped(Check::board_firmware, why), skipped(Check::board_fault, why)};
}

Finding check_firmware(const CheckUp& up, Board& board) {
    // connect() refuses any other message layout; what is left are two firmwares that speak alike.
    const std::string version = board.info().firmware_version;
    Finding finding{
        Check::board_firmware,
        up.board_link,
        CheckVerdict::ok,
        fmt::format("{} ({}), chain of {} bits", version, board.info().board, uint16_t(board.info().chain_bits)),
        fmt::format("{}, this release's, and a chain of the stage's {} bits", shipped_firmware, up.stage.chain_bits),
        {}};
    if (up.stage.chain_bits != int(uint16_t(board.info().chain_bits))) {
        finding.verdict = CheckVerdict::fail;
        finding.commands = {
            "ls build/firmware    # an image for this board's chain? make flash BOARD=NAME; or [chain] bits in "
            "stage.toml"};
    } else if (version != shipped_firmware) {
        finding.verdict = CheckVerdict::warn;
        finding.commands = {"make flash    # in the source folder"};
    }
    return finding;
}

Finding check_fault(const CheckUp& up, Board& board) {
    Finding finding{Check::board_fault,
                    up.board_link,
                    CheckVerdict::ok,
                    "",
                    "idle, no fault latched: it plays nothing until a fault is "
                    "cleared, and one that plays belongs to another take",
                    {}};
    const auto status = board.status();
    if (!status.ok()) {
        finding.verdict = CheckVerdict::fail;
        finding.found = status.error().message;
        finding.commands = {"stagectl status --board " + up.board_link};
        return finding;
    }
    finding.found = fmt::format("{}, fault: {}", state_name(status->state), fault_text(*status));
    if (status->state == OLS_STATE_FAULT) {
        finding.verdict = CheckVerdict::fail;
        finding.commands = {
            fmt::format("stagectl status --board {} --clear-fault    # once its cause is gone", up.board_link)};
    } else if (status->state == OLS_STATE_PLAYING || status->state == OLS_STATE_WAITING ||
               status->state == OLS_STATE_ARMED) {
        finding.verdict = CheckVerdict::warn;
        finding.commands = {"ps -C stagectl    # whose take is it? end that, or wait"};
    }
    return finding;
}

}  // namespace

Findings check_board(const CheckUp& up) {
    if (up.board_link.empty()) {
        const std::string why = "which board? give --board, or a link in the stage's [board]";
        Findings findings = {skipped(Check::board_link, why)};
        for (Finding& finding : skip_rest("no board is named")) findings.push_back(std::move(finding));
        return findings;
    }
    Finding link{Check::board_link, up.board_link, CheckVerdict::ok, "", "a board that answers", {}};
    auto board = up.open_board();
    Findings findings;
    if (!board.ok()) {
        link.verdict = CheckVerdict::fail;
        link.found = board.error().message;
        link.commands = {
            fmt::format("stagectl status --board {} --wait 30    # and plug it in, or off and on", up.board_link),
            "sudo systemctl stop stagectl    # if the daemon has it"};
        findings = {link};
        for (Finding& finding : skip_rest("the board does not answer")) findings.push_back(std::move(finding));
        return findings;
    }
    link.found = fmt::format("{} answers, number {}", board->name(), board->id());
    return {link, check_firmware(up, *board), check_fault(up, *board)};
}

}  // namespace ols

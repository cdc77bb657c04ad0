// SPDX-License-Identifier: MIT
// stagectl flash: writes a firmware image to a board.
#include <fmt/format.h>

#include <nlohmann/json.hpp>

#include "device/board_flash.hpp"
#include "device/boot_drive.hpp"
#include "program.hpp"
#include "stagectl/session.hpp"
#include "stagectl/verbs.hpp"

namespace ols {

namespace {

struct Options {
    std::string image, board, drive;
    bool force_board = false, json = false;
};

Result<std::string> serial_of(const std::string& board) {
    constexpr std::string_view scheme = "usb:";
    if (board.empty()) return std::string();
    if (board.starts_with(scheme)) return board.substr(scheme.size());
    return fail("'" + board + "' cannot be flashed: a board is flashed by USB, --board usb:SERIAL");
}

nlohmann::json to_json(const ImageLabel& label) {
    return {{"board", label.board}, {"firmware", label.version}};
}

Result<int> flash_drive(const Options& options, const FirmwareImage& image) {
    if (!options.force_board)
        return fail(fmt::format("a drive cannot say whether its board is a '{}': if you are sure, add --force-board",
                                image.label.board));
    const Status written = write_boot_drive(options.drive, image.uf2);
    if (!written.ok()) return written.error();
    if (options.json)
        print_json({{"drive", options.drive}, {"image", to_json(image.label)}});
    else
        fmt::print(
            "wrote {} {} to the drive; the board restarts by itself: check it with stagectl status --board usb:\n",
            image.label.board, image.label.version);
    return 0;
}

Result<int> run(const Options& options) {
    const auto image = read_uf2(options.image);
    if (!image.ok()) return image.error();
    if (!options.drive.empty()) return flash_drive(options, *image);
    FlashRequest request;
    const auto serial = serial_of(options.board);
    if (!serial.ok()) return serial.error();
    request.serial = *serial;
    request.force_board = options.force_board;
    request.find_drive = find_boot_drive;
    auto bus = open_usb_bus();
    if (!bus.ok()) return bus.error();
    const auto report =
        flash_board(**bus, *image, request, [](size_t done, size_t total) { show_progress("flashing", done, total); });
    if (!report.ok()) return report.error();
    if (options.json)
        print_json({{"board", "usb:" + report->serial}, {"image", to_json(report->label)}});
    else
        fmt::print("board usb:{} runs {} {}\n", report->serial, report->label.board, report->label.version);
    return 0;
}

}  // namespace

void add_flash_verb(CLI::App& app, int& exit_code) {
    auto options = std::make_shared<Options>();
    CLI::App* verb = app.add_subcommand("flash", "write a firmware image to a board");
    verb->footer(
        "Example: stagectl flash build/firmware/pico/stage.uf2 --board usb:e6614103e7452d2f\n"
        "The board leaves its firmware for its boot loader by itself, unless a program is armed or plays. An image "
        "for\n"
        "another board is refused. Interrupted? The board stays dark; run the same command again.");
    verb->add_option("image", options->image, "the image, a .uf2 file")->required();
    verb->add_option("--board", options->board,
                     "a running board, usb:SERIAL; otherwise the only board that is plugged in");
    verb->add_option("--drive", options->drive,
                     "copy to the BOOTSEL drive mounted there instead (needs --force-board)");
    verb->add_flag("--force-board", options->force_board,
                   "the board is in BOOTSEL mode, new or with foreign firmware: it is the one the image is for");
    verb->add_flag("--json", options->json, "print as JSON what was written where");
    verb->callback([options, &exit_code] { exit_code = report_errors([&] { return run(*options); }); });
}

}  // namespace ols

// SPDX-License-Identifier: MIT
// Cameras, opened and set up as a take does it; no frame is asked for.
#include <fmt/format.h>

#include "doctor/check_up.hpp"

namespace ols {

namespace {

std::string size_text(const CameraSetup& setup) {
    return fmt::format("{} x {}, {} bits", setup.width, setup.height, setup.bits);
}

// A command that shows what there is.
std::string look_command(const CameraPlace& camera) {
    switch (camera.kind) {
        case CameraPlace::v4l2: return "v4l2-ctl --list-devices    # which there are";
        case CameraPlace::ring: return "ls -l " + camera.name + "    # does the program that fills it run?";
        default: return "arv-tool-0.8    # which there are; docs/cameras.md, \"Set up\"";
    }
}

Findings check_camera(const CheckUp& up, const CameraPlace& place) {
    if (place.kind == CameraPlace::none && place.source.empty()) {
        const std::string why = "no source: give --camera, or source in the stage's [[camera]]";
        return {skipped(Check::camera_link, why, place.title()),
                skipped(Check::camera_setup, "no source", place.title())};
    }
    Finding link{Check::camera_link,
                 place.title(),
                 CheckVerdict::ok,
                 "",
                 "a camera that is there and that no other program has",
                 {}};
    auto camera = open_camera(place.source, uint32_t(place.number));
    if (!camera.ok()) {
        link.verdict = CheckVerdict::fail;
        link.found = camera.error().message;
        link.commands = {look_command(place)};
        return {link, skipped(Check::camera_setup, "the camera could not be opened", place.title())};
    }
    Finding setup{
        Check::camera_setup,
        place.title(),
        CheckVerdict::ok,
        "",
        fmt::format("{}, and whatever else the stage's [[camera]] asks for", size_text(up.stage.cameras[place.number])),
        {}};
    const Status accepted = (*camera)->set_up(up.stage.cameras[place.number]);
    const CameraInfo info = (*camera)->info();
    link.found = fmt::format("{} ({})", info.name, place.source);
    setup.found = fmt::format("{}; {}", size_text(info.setup), info.link);
    if (!accepted.ok()) {
        setup.verdict = CheckVerdict::fail;
        setup.found = accepted.error().message;
        setup.commands = {"${EDITOR:-nano} stage.toml    # the keys that are named; docs/cameras.md"};
    }
    return {link, setup};
}

}  // namespace

Findings check_cameras(const CheckUp& up) {
    Findings findings;
    for (const CameraPlace& camera : up.cameras)
        for (Finding& finding : check_camera(up, camera)) findings.push_back(std::move(finding));
    if (findings.empty())
        findings = {skipped(Check::camera_link, "the stage has no camera"),
                    skipped(Check::camera_setup, "the stage has no camera")};
    return findings;
}

}  // namespace ols

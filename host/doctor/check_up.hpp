// SPDX-License-Identifier: MIT
// What is looked at: the machine, the stage, and what it asks for; and the checks, a function a family of them.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "device/aravis_camera.hpp"
#include "device/board.hpp"
#include "doctor/finding.hpp"
#include "doctor/machine.hpp"
#include "doctor/needs.hpp"

namespace ols {

// A camera of the stage, by its source.
struct CameraPlace {
    enum Kind { none, ring, v4l2, fake, aravis, gige, usb3 } kind = none;  // aravis: which of the two is not known
    size_t number = 0;                                                     // in the stage
    std::string source;
    std::string name;     // behind the scheme: a path, a serial number
    std::string address;  // of gige, "192.168.0.2"

    bool may_be_gige() const { return kind == gige || kind == aravis; }
    bool may_be_usb3() const { return kind == usb3 || kind == aravis; }
    std::string title() const { return "camera " + std::to_string(number); }
};

// Sources are in the order of the stage's cameras, "" where none is known; `listing` is what Aravis finds.
std::vector<CameraPlace> place_cameras(const std::vector<std::string>& sources,
                                       const std::vector<AravisListing>& listing);

struct CheckUp {
    const Machine& machine;
    StageConfig stage;
    StageNeeds needs;
    std::string board_link;  // "" none is known
    std::vector<CameraPlace> cameras;
    std::string takes_folder, spill_folder;  // "" not given
    double disk_s = 3;                       // for which a disk is written to, and read again
    bool is_quick = false;                   // nothing that takes more than a second or two is measured

    std::function<Result<Board>()> open_board;
    // Of what takes long: what is done, and how far it is.
    std::function<void(const char* what, uint64_t done, uint64_t total)> progress = [](auto...) {};
};

Findings check_permissions(const CheckUp& up);
Findings check_network(const CheckUp& up);
Findings check_disks(const CheckUp& up);
Findings check_memory(const CheckUp& up);
Findings check_processor(const CheckUp& up);
Findings check_clock(const CheckUp& up);
Findings check_board(const CheckUp& up);
Findings check_cameras(const CheckUp& up);
Findings check_gpio(const CheckUp& up);
Findings check_can(const CheckUp& up);

// All of them, in the order of check_names.
Findings check_all(const CheckUp& up);

}  // namespace ols

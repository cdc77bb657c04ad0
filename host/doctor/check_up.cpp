// SPDX-License-Identifier: MIT
// Which cameras are where, and all families one after the other.
#include "doctor/check_up.hpp"

#include <arpa/inet.h>

#include <algorithm>

namespace ols {

namespace {

bool is_address(const std::string& name) {
    in_addr address{};
    return inet_pton(AF_INET, name.c_str(), &address) == 1;
}

// An address may lie where nothing is listed, behind a router; no name is the only camera that there is.
void place_by_aravis(CameraPlace& camera, const std::vector<AravisListing>& listing) {
    camera.kind = CameraPlace::aravis;
    if (is_address(camera.name)) {
        camera.kind = CameraPlace::gige;
        camera.address = camera.name;
        return;
    }
    const auto found = std::ranges::find_if(listing, [&camera](const AravisListing& listed) {
        return camera.name.empty() || camera.name == listed.serial || camera.name == listed.id ||
               camera.name == listed.address;
    });
    if (found == listing.end() || (camera.name.empty() && listing.size() > 1)) return;
    if (found->protocol == "USB3Vision") camera.kind = CameraPlace::usb3;
    if (found->protocol != "GigEVision") return;
    camera.kind = CameraPlace::gige;
    camera.address = found->address;
}

}  // namespace

std::vector<CameraPlace> place_cameras(const std::vector<std::string>& sources,
                                       const std::vector<AravisListing>& listing) {
    std::vector<CameraPlace> cameras;
    for (const std::string& source : sources) {
        CameraPlace camera;
        camera.number = cameras.size();
        camera.source = source;
        camera.name = source.substr(std::min(source.find(':') + 1, source.size()));
        if (source.starts_with("ring:")) camera.kind = CameraPlace::ring;
        if (source.starts_with("v4l2:")) camera.kind = CameraPlace::v4l2;
        if (source.starts_with("fake:")) camera.kind = CameraPlace::fake;
        if (source.starts_with("aravis:")) place_by_aravis(camera, listing);
        cameras.push_back(camera);
    }
    return cameras;
}

Findings check_all(const CheckUp& up) {
    Findings all;
    for (const auto family : {check_permissions, check_network, check_disks, check_memory, check_processor, check_clock,
                              check_board, check_cameras, check_gpio, check_can})
        for (Finding& finding : family(up)) all.push_back(std::move(finding));
    return all;
}

}  // namespace ols

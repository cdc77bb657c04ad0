// SPDX-License-Identifier: MIT
// The kinds of camera by their schemes, and what a set-up is checked for.
#include "device/camera.hpp"

#include <fmt/format.h>

#include "device/aravis_camera.hpp"
#include "device/fake_camera.hpp"
#include "device/ring_camera.hpp"
#include "device/v4l2_camera.hpp"

namespace ols {

namespace {

const char* text_of(Cfa cfa) {
    const char* names[] = {"none", "rggb", "bggr", "grbg", "gbrg", "rgb"};
    return size_t(cfa) < std::size(names) ? names[size_t(cfa)] : "unknown";
}
const char* text_of(TriggerActivation activation) {
    return activation == TriggerActivation::rising_edge ? "rising_edge" : "falling_edge";
}
const char* text_of(ExposureMode mode) {
    return mode == ExposureMode::trigger_width ? "trigger_width" : "timed";
}
std::string text_of(const std::string& text) {
    return '"' + text + '"';
}
template <typename Number>
requires std::is_arithmetic_v<Number> Number text_of(Number number) {
    return number;
}

}  // namespace

Status check_setup(const std::string& camera, const CameraSetup& wanted, const CameraSetup& accepted,
                   const std::set<std::string>& lacks) {
    std::string problems;
    const auto compare = [&](const char* key, const auto& want, const auto& have) {
        if (want == have) return;
        problems += problems.empty() ? "" : "; ";
        if (lacks.contains(key))
            problems += fmt::format("it has no {}, leave it out", key);
        else
            problems += fmt::format("{} is {} and not {}", key, text_of(have), text_of(want));
    };
    compare("width", wanted.width, accepted.width);
    compare("height", wanted.height, accepted.height);
    compare("cfa", wanted.cfa, accepted.cfa);
    compare("bits", wanted.bits, accepted.bits);
    compare("trigger_source", wanted.trigger_source, accepted.trigger_source);
    compare("trigger_activation", wanted.trigger_activation, accepted.trigger_activation);
    compare("trigger_delay_us", wanted.trigger_delay_us, accepted.trigger_delay_us);
    compare("exposure_mode", wanted.exposure_mode, accepted.exposure_mode);
    if (wanted.exposure_mode == ExposureMode::timed && accepted.exposure_mode == ExposureMode::timed)
        compare("exposure_us", wanted.exposure_us, accepted.exposure_us);
    for (const auto& [name, value] : wanted.controls) {
        const auto control = accepted.controls.find(name);
        if (control == accepted.controls.end())
            problems += fmt::format("{}it has no control \"{}\"", problems.empty() ? "" : "; ", name);
        else
            compare(("control " + text_of(name)).c_str(), value, control->second);
    }
    if (problems.empty()) return Done{};
    return fail(camera + " is not as the stage's [[camera]] says: " + problems);
}

Result<std::unique_ptr<Camera>> open_camera(const std::string& source, uint32_t index) {
    using Open = Result<std::unique_ptr<Camera>> (*)(const std::string& rest, uint32_t index);
    constexpr std::pair<std::string_view, Open> schemes[] = {{"aravis:", open_aravis_camera},
                                                             {"v4l2:", open_v4l2_camera},
                                                             {"ring:", open_ring_camera},
                                                             {"fake:", open_fake_camera}};
    for (const auto& [scheme, open] : schemes)
        if (source.starts_with(scheme)) return open(source.substr(scheme.size()), index);
    return fail("'" + source +
                "' is no camera: write aravis:SERIAL, or aravis: for the only GigE or USB3 camera; v4l2:/dev/video0; "
                "ring:PATH; or fake:RATE for one without hardware");
}

}  // namespace ols

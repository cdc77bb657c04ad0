// SPDX-License-Identifier: MIT
// In the order of the kernel's documents (Documentation/userspace-api/media/v4l): format (vidioc-g-fmt.rst), frame rate
// (vidioc-g-parm.rst), exposure (ext-ctrls-camera.rst), controls.
#include "device/v4l2_setup.hpp"

#include <fmt/format.h>

#include <cerrno>
#include <cmath>
#include <cstring>
#include <set>

#include "device/camera.hpp"
#include "device/v4l2_controls.hpp"
#include "device/v4l2_format.hpp"

namespace ols {

namespace {

constexpr double exposure_step_us = 100;  // V4L2_CID_EXPOSURE_ABSOLUTE counts in these
constexpr uint32_t rate_asked_hz = 100'000;

Error format_error(const std::string& name, const char* call, int error) {
    if (error == EBUSY)
        return fail(
            name +
            " is busy: another program streams from it, or holds its buffers; end that one (fuser -v says which)");
    return fail(fmt::format("{} takes no pixel format ({}: {}): see `v4l2-ctl --all` and dmesg", name, call,
                            std::strerror(error)));
}

// What the driver makes of the wanted format, which it may change (vidioc-g-fmt.rst: "drivers ... adjust parameters").
Result<v4l2_pix_format> set_format(V4l2Device& device, const std::string& name, const CameraSetup& wanted,
                                   uint32_t fourcc) {
    v4l2_format format{};
    format.type = V4L2_BUF_TYPE_VIDEO_CAPTURE;
    format.fmt.pix.width = uint32_t(wanted.width);
    format.fmt.pix.height = uint32_t(wanted.height);
    format.fmt.pix.pixelformat = fourcc;
    format.fmt.pix.field = V4L2_FIELD_NONE;
    if (const int error = device.ioctl(VIDIOC_S_FMT, &format); error != 0)
        return format_error(name, "VIDIOC_S_FMT", error);
    format = {};
    format.type = V4L2_BUF_TYPE_VIDEO_CAPTURE;
    if (const int error = device.ioctl(VIDIOC_G_FMT, &format); error != 0)
        return format_error(name, "VIDIOC_G_FMT", error);
    return format.fmt.pix;
}

// The highest that there is: what the board's triggers ask for must not be held up. "" where the driver has no rates.
std::string choose_rate(V4l2Device& device) {
    v4l2_streamparm parameters{};
    parameters.type = V4L2_BUF_TYPE_VIDEO_CAPTURE;
    parameters.parm.capture.timeperframe = {1, rate_asked_hz};
    if (device.ioctl(VIDIOC_S_PARM, &parameters) != 0) return "";
    const v4l2_fract interval = parameters.parm.capture.timeperframe;
    if (interval.numerator == 0 || !(parameters.parm.capture.capability & V4L2_CAP_TIMEPERFRAME)) return "";
    return fmt::format(", at most {:.4g} frames/s", double(interval.denominator) / double(interval.numerator));
}

void set_exposure(V4l2Controls& controls, const CameraSetup& wanted, CameraSetup& accepted) {
    if (wanted.exposure_mode != ExposureMode::timed || !controls.has(V4L2_CID_EXPOSURE_ABSOLUTE)) return;
    if (controls.has(V4L2_CID_EXPOSURE_AUTO)) {
        const auto mode = controls.set(V4L2_CID_EXPOSURE_AUTO, V4L2_EXPOSURE_MANUAL);
        if (!mode.ok() || *mode != V4L2_EXPOSURE_MANUAL) return;
    }
    const auto steps = controls.set(V4L2_CID_EXPOSURE_ABSOLUTE, std::llround(wanted.exposure_us / exposure_step_us));
    if (!steps.ok()) return;
    accepted.exposure_mode = ExposureMode::timed;
    accepted.exposure_us = double(*steps) * exposure_step_us;
}

// What changes pictures by itself spoils them for the inversion.
std::string automatic_controls(const V4l2Controls& controls) {
    std::string text;
    const std::pair<uint32_t, const char*> known[] = {{V4L2_CID_AUTOGAIN, "gain"},
                                                      {V4L2_CID_AUTO_WHITE_BALANCE, "white balance"},
                                                      {V4L2_CID_HUE_AUTO, "hue"},
                                                      {V4L2_CID_AUTOBRIGHTNESS, "brightness"}};
    for (const auto& [id, word] : known)
        if (controls.get(id).value_or(0) != 0) text += (text.empty() ? ", automatic " : " and ") + std::string(word);
    if (const auto mode = controls.get(V4L2_CID_EXPOSURE_AUTO); mode && *mode != V4L2_EXPOSURE_MANUAL)
        text += (text.empty() ? ", automatic " : " and ") + std::string("exposure");
    return text;
}

// Rows one after the other, from the top, all of them in one picture.
Status check_picture(const std::string& name, const v4l2_pix_format& pix, const V4l2Setup& made) {
    if (pix.field != V4L2_FIELD_NONE)
        return fail(fmt::format("{} gives interlaced pictures (field {}): choose another input or mode of it", name,
                                pix.field));
    if (pix.sizeimage < made.picture_bytes)
        return fail(
            fmt::format("{} says that {} x {} pixels of {} take {} bytes, and they take {}: its driver is wrong", name,
                        pix.width, pix.height, fourcc_text(pix.pixelformat), pix.sizeimage, made.picture_bytes));
    return Done{};
}

std::string joined(const std::string& a, const std::string& b) {
    return a.empty() || b.empty() ? a + b : a + "; " + b;
}

}  // namespace

Result<V4l2Setup> set_up_v4l2(V4l2Device& device, const std::string& name, const CameraSetup& wanted) {
    const auto offered = offered_formats(device);
    if (offered.empty())
        return fail(name +
                    " offers no pixel format: where another program feeds it (v4l2loopback), start that one first; "
                    "otherwise see `v4l2-ctl --list-formats-ext`");
    const auto chosen = choose_format(offered, wanted.cfa, wanted.bits);
    const auto pix = set_format(device, name, wanted, chosen.value_or(nearest_format(offered, wanted.cfa)));
    if (!pix.ok()) return pix.error();
    const auto layout = layout_of_fourcc(pix->pixelformat);
    V4l2Setup made;
    made.setup.width = int(pix->width);
    made.setup.height = int(pix->height);
    made.setup.cfa = layout ? layout->cfa : wanted.cfa;
    made.setup.bits = layout ? layout->bits : wanted.bits;
    made.text = fourcc_text(pix->pixelformat) + choose_rate(device);
    V4l2Controls controls(device);
    set_exposure(controls, wanted, made.setup);
    std::string problems = controls.set_named(wanted.controls);
    made.setup.controls = wanted.controls;  // what is wrong with them has been said
    made.text += automatic_controls(controls);

    std::set<std::string> lacks = {"trigger_source", "trigger_activation", "trigger_delay_us"};
    if (!controls.has(V4L2_CID_EXPOSURE_ABSOLUTE)) lacks.insert("exposure_mode");
    const Status fits = check_setup(name, wanted, made.setup, lacks);
    if (!layout || made.setup.cfa != wanted.cfa || made.setup.bits != wanted.bits)
        problems = joined(problems, fmt::format("its pixel format is {}{}; it offers {}", fourcc_text(pix->pixelformat),
                                                chosen && *chosen != pix->pixelformat
                                                    ? ", which its driver made of " + fourcc_text(*chosen)
                                                    : "",
                                                describe_formats(offered)));
    const bool asks_trigger = !wanted.trigger_source.empty() || wanted.trigger_delay_us != 0 ||
                              wanted.trigger_activation != TriggerActivation::rising_edge;
    if (asks_trigger) {
        const std::string own = controls.names("trigger");
        problems = joined(problems, "V4L2 has no words for triggers: " +
                                        (own.empty() ? "this driver has no control for them either"
                                                     : "set this driver's own in `controls`: " + own));
    }
    if (!fits.ok()) return fail(joined(fits.error().message, problems));
    if (!problems.empty()) return fail(name + " is not as the stage's [[camera]] says: " + problems);

    made.layout = *layout;
    const size_t row_samples = size_t(pix->width) * size_t(samples_per_pixel(layout->cfa));
    const size_t least = packed_row_bytes(*layout, row_samples);
    made.row_bytes = pix->bytesperline != 0 ? pix->bytesperline : least;
    if (made.row_bytes < least)
        return fail(
            fmt::format("{} says that a row of {} pixels of {} takes {} bytes, and it takes {}: its driver is wrong",
                        name, pix->width, fourcc_text(pix->pixelformat), made.row_bytes, least));
    made.picture_bytes = made.row_bytes * (pix->height - 1) + least;
    if (const Status whole = check_picture(name, *pix, made); !whole.ok()) return whole.error();
    return made;
}

}  // namespace ols

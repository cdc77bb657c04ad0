// SPDX-License-Identifier: MIT
// A V4L2 device's controls by their names: set, read back, and refused with what each of them takes.
#pragma once

#include <map>
#include <optional>
#include <string>
#include <vector>

#include "device/v4l2_device.hpp"

namespace ols {

class V4l2Controls {
  public:
    // VIDIOC_QUERY_EXT_CTRL (vidioc-queryctrl.rst); none for a driver without them. Of a device that outlives this.
    explicit V4l2Controls(V4l2Device& device);

    bool has(uint32_t id) const;

    // The value that is in force after it was asked to be this one, or the nearest that the control takes. Errors name it.
    Result<int64_t> set(uint32_t id, int64_t value);

    // The value in force; nothing where the device has no such control or does not tell.
    std::optional<int64_t> get(uint32_t id) const;

    // Sets controls by name (the driver's, "Exposure Time, Absolute", or v4l2-ctl's, "exposure_time_absolute"): a number, true or
    // false, of a menu an item's name or number, of a text control the text. Those that others have to be set for come after these.
    // Returns what went wrong, each part with what the control takes; "" when all are as wanted, read back.
    std::string set_named(const std::map<std::string, std::string>& wanted);

    // Names of the controls with this word in it, joined by commas; "" for all.
    std::string names(const std::string& word = "") const;

  private:
    using Control = v4l2_query_ext_ctrl;

    const Control* find(const std::string& name) const;
    const Control* find(uint32_t id) const;
    std::optional<int64_t> number_for(const Control& control, const std::string& text) const;
    std::string range_of(const Control& control) const;
    std::vector<std::pair<int64_t, std::string>> items_of(const Control& control) const;
    std::string set_text(const Control& control, const std::string& text);
    std::string set_number(const Control& control, int64_t number);
    std::string set_one(const std::string& name, const std::string& value);

    V4l2Device& device_;
    std::vector<Control> controls_;
};

}  // namespace ols

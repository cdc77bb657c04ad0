// SPDX-License-Identifier: MIT
// Controls one at a time through VIDIOC_S_EXT_CTRLS and VIDIOC_G_EXT_CTRLS (vidioc-g-ext-ctrls.rst), which take all their types.
#include "device/v4l2_controls.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <cerrno>
#include <charconv>
#include <cstring>

namespace ols {

namespace {

constexpr size_t controls_max = 4096, text_bytes_max = 4096;
constexpr int64_t items_max = 1024;

// As v4l2-ctl makes one of a control's name: small letters and digits, and one '_' for all between them.
std::string plain_name(const std::string& name) {
    std::string plain;
    for (const char letter : name) {
        if (std::isalnum(static_cast<unsigned char>(letter)))
            plain += char(std::tolower(static_cast<unsigned char>(letter)));
        else if (!plain.empty() && plain.back() != '_')
            plain += '_';
    }
    while (plain.ends_with('_')) plain.pop_back();
    return plain;
}

bool is_menu(uint32_t type) {
    return type == V4L2_CTRL_TYPE_MENU || type == V4L2_CTRL_TYPE_INTEGER_MENU;
}
bool is_number(uint32_t type) {
    return is_menu(type) || type == V4L2_CTRL_TYPE_INTEGER || type == V4L2_CTRL_TYPE_BOOLEAN ||
           type == V4L2_CTRL_TYPE_INTEGER64 || type == V4L2_CTRL_TYPE_BITMASK || type == V4L2_CTRL_TYPE_BUTTON;
}

struct OneControl {
    explicit OneControl(uint32_t id) {
        control.id = id;
        all.which = V4L2_CTRL_WHICH_CUR_VAL;
        all.count = 1;
        all.controls = &control;
    }
    v4l2_ext_control control{};
    v4l2_ext_controls all{};
};

// Of a control of 64 bits or fewer.
int64_t value_of(const OneControl& one, uint32_t type) {
    return type == V4L2_CTRL_TYPE_INTEGER64 ? one.control.value64 : one.control.value;
}

}  // namespace

V4l2Controls::V4l2Controls(V4l2Device& device) : device_(device) {
    Control control{};
    for (;;) {
        const uint32_t last = control.id;
        control = {};
        control.id = last | V4L2_CTRL_FLAG_NEXT_CTRL;
        if (device.ioctl(VIDIOC_QUERY_EXT_CTRL, &control) != 0) return;
        control.name[sizeof control.name - 1] = 0;
        if (control.id <= last || controls_.size() == controls_max) return;  // not a list that ends
        const bool is_setting = control.type != V4L2_CTRL_TYPE_CTRL_CLASS && !(control.flags & V4L2_CTRL_FLAG_DISABLED);
        if (is_setting) controls_.push_back(control);
    }
}

const V4l2Controls::Control* V4l2Controls::find(const std::string& name) const {
    const std::string plain = plain_name(name);
    const auto found = std::find_if(controls_.begin(), controls_.end(), [&](const Control& control) {
        return control.name == name || plain_name(control.name) == plain;
    });
    return found == controls_.end() ? nullptr : &*found;
}

const V4l2Controls::Control* V4l2Controls::find(uint32_t id) const {
    const auto found = std::find_if(controls_.begin(), controls_.end(), [&](const auto& c) { return c.id == id; });
    return found == controls_.end() ? nullptr : &*found;
}

bool V4l2Controls::has(uint32_t id) const {
    return find(id) != nullptr;
}

std::optional<int64_t> V4l2Controls::get(uint32_t id) const {
    const Control* const control = find(id);
    if (!control || !is_number(control->type)) return std::nullopt;
    OneControl one(id);
    if (device_.ioctl(VIDIOC_G_EXT_CTRLS, &one.all) != 0) return std::nullopt;
    return value_of(one, control->type);
}

Result<int64_t> V4l2Controls::set(uint32_t id, int64_t value) {
    const Control* const control = find(id);
    if (!control) return fail("it has no such control");
    const int64_t nearest = std::clamp(value, int64_t(control->minimum), int64_t(control->maximum));
    const std::string problem = set_number(*control, nearest);
    const auto now = get(id);
    if (now) return *now;
    return fail(problem.empty() ? fmt::format("the control \"{}\" cannot be read back", control->name) : problem);
}

std::vector<std::pair<int64_t, std::string>> V4l2Controls::items_of(const Control& control) const {
    std::vector<std::pair<int64_t, std::string>> items;
    for (int64_t n = control.minimum; n <= std::min(int64_t(control.maximum), int64_t(control.minimum) + items_max);
         ++n) {
        v4l2_querymenu item{};
        item.id = control.id;
        item.index = uint32_t(n);
        if (device_.ioctl(VIDIOC_QUERYMENU, &item) != 0) continue;  // menus have holes
        if (control.type == V4L2_CTRL_TYPE_INTEGER_MENU) {
            items.emplace_back(n, std::to_string(int64_t(item.value)));
        } else {
            item.name[sizeof item.name - 1] = 0;
            items.emplace_back(n, reinterpret_cast<const char*>(item.name));
        }
    }
    return items;
}

std::string V4l2Controls::range_of(const Control& control) const {
    if (control.flags & V4L2_CTRL_FLAG_READ_ONLY) return "nothing: it can only be read";
    if (control.type == V4L2_CTRL_TYPE_BOOLEAN) return "true or false";
    if (control.type == V4L2_CTRL_TYPE_STRING)
        return fmt::format("a text of {} to {} bytes", int64_t(control.minimum), int64_t(control.maximum));
    if (!is_number(control.type)) return "no value that can be written in stage.toml";
    if (!is_menu(control.type))
        return fmt::format("{} to {} in steps of {}", int64_t(control.minimum), int64_t(control.maximum),
                           uint64_t(control.step));
    std::string text;
    for (const auto& [number, name] : items_of(control))
        text += fmt::format("{}{} ({})", text.empty() ? "" : ", ", number, name);
    return text;
}

std::optional<int64_t> V4l2Controls::number_for(const Control& control, const std::string& text) const {
    if (!is_number(control.type)) return std::nullopt;
    if (is_menu(control.type))
        for (const auto& [number, name] : items_of(control))
            if (name == text || plain_name(name) == text) return number;
    if (control.type == V4L2_CTRL_TYPE_BOOLEAN && (text == "true" || text == "false")) return text == "true";
    int64_t number = 0;
    const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), number);
    const bool is_whole = error == std::errc() && end == text.data() + text.size() && !text.empty();
    if (!is_whole || number < control.minimum || number > control.maximum) return std::nullopt;
    const bool has_steps = control.step > 1 && !is_menu(control.type) && control.type != V4L2_CTRL_TYPE_BITMASK;
    if (has_steps && (uint64_t(number) - uint64_t(control.minimum)) % control.step != 0) return std::nullopt;
    return number;
}

std::string V4l2Controls::set_number(const Control& control, int64_t number) {
    OneControl one(control.id);
    if (control.type == V4L2_CTRL_TYPE_INTEGER64)
        one.control.value64 = number;
    else
        one.control.value = int32_t(number);
    if (const int error = device_.ioctl(VIDIOC_S_EXT_CTRLS, &one.all); error != 0)
        return fmt::format("control \"{}\" does not take {} ({})", control.name, number, std::strerror(error));
    if (control.flags & (V4L2_CTRL_FLAG_WRITE_ONLY | V4L2_CTRL_FLAG_EXECUTE_ON_WRITE)) return "";
    const auto now = get(control.id);
    if (!now) return fmt::format("control \"{}\" cannot be read back", control.name);
    if (*now == number) return "";
    return fmt::format("control \"{}\" is {} and not {} (it takes {})", control.name, *now, number, range_of(control));
}

std::string V4l2Controls::set_text(const Control& control, const std::string& text) {
    std::string room = text;
    room.resize(size_t(std::clamp<int64_t>(control.maximum, int64_t(text.size()), text_bytes_max)) + 1);
    OneControl one(control.id);
    one.control.size = uint32_t(room.size());
    one.control.string = room.data();
    if (const int error = device_.ioctl(VIDIOC_S_EXT_CTRLS, &one.all); error != 0)
        return fmt::format("control \"{}\" does not take \"{}\" ({}): it takes {}", control.name, text,
                           std::strerror(error), range_of(control));
    std::fill(room.begin(), room.end(), '\0');
    if (device_.ioctl(VIDIOC_G_EXT_CTRLS, &one.all) == 0 && text == room.c_str()) return "";
    return fmt::format("control \"{}\" is \"{}\" and not \"{}\"", control.name, room.c_str(), text);
}

std::string V4l2Controls::set_one(const std::string& name, const std::string& value) {
    const Control* const control = find(name);
    if (!control)
        return fmt::format("it has no control \"{}\" (it has: {})", name, controls_.empty() ? "none" : names());
    if (control->type == V4L2_CTRL_TYPE_STRING && value.size() <= text_bytes_max) return set_text(*control, value);
    const auto number = number_for(*control, value);
    if (!number || (control->flags & V4L2_CTRL_FLAG_READ_ONLY))
        return fmt::format("control \"{}\" takes {}, not {}", control->name, range_of(*control), value);
    return set_number(*control, *number);
}

std::string V4l2Controls::set_named(const std::map<std::string, std::string>& wanted) {
    // Round after round, as long as each leaves fewer that are not as wanted: one may have to wait for another.
    std::string problems;
    for (size_t left = wanted.size(), before = left + 1; left > 0 && left < before;) {
        before = left;
        left = 0;
        problems.clear();
        for (const auto& [name, value] : wanted) {
            const std::string problem = set_one(name, value);
            if (problem.empty()) continue;
            problems += (problems.empty() ? "" : "; ") + problem;
            ++left;
        }
    }
    return problems;
}

std::string V4l2Controls::names(const std::string& word) const {
    std::string text;
    for (const Control& control : controls_)
        if (plain_name(control.name).find(word) != std::string::npos)
            text += fmt::format("{}\"{}\"", text.empty() ? "" : ", ", control.name);
    return text;
}

}  // namespace ols

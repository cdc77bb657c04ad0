// SPDX-License-Identifier: MIT
// GpioLines on libgpiod 1.6 (gpiod.h), whose kernel interface is ABI 1 (linux/gpio.h, "ABI v1"): a descriptor for each input's
// edges, which keeps 16 and drops the newest (Linux 6.1, drivers/gpio/gpiolib-cdev.c, lineevent_state). A chip that is unbound
// does not wake a poll() there, so waits are short, and the levels that are read between them tell that it has gone.
#include <fmt/format.h>
#include <gpiod.h>
#include <poll.h>

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <cstring>

#include "device/gpio.hpp"
#include "steady_clock.hpp"

namespace ols {

namespace {

using Chip = std::unique_ptr<gpiod_chip, decltype(&gpiod_chip_close)>;

constexpr const char* consumer = "open light stage";
constexpr int events_a_read = 16;   // that the kernel keeps
constexpr int reads_a_wait = 8;     // of one line, so that one that never rests holds up no other
constexpr int wait_piece_ms = 100;  // between looks at whether the chip is there

uint64_t time_of(const gpiod_line_event& event) {
    const uint64_t stamp = uint64_t(event.ts.tv_sec) * 1'000'000'000 + uint64_t(event.ts.tv_nsec);
    return std::min(stamp, steady_ns());  // kernels before 5.7 stamp by the wall's clock
}

int flags_of(const GpioLineSetup& setup) {
    int flags = setup.active_low ? GPIOD_LINE_REQUEST_FLAG_ACTIVE_LOW : 0;
    switch (setup.bias) {
        case GpioBias::as_is: break;
        case GpioBias::none: flags |= GPIOD_LINE_REQUEST_FLAG_BIAS_DISABLE; break;
        case GpioBias::pull_up: flags |= GPIOD_LINE_REQUEST_FLAG_BIAS_PULL_UP; break;
        case GpioBias::pull_down: flags |= GPIOD_LINE_REQUEST_FLAG_BIAS_PULL_DOWN; break;
    }
    return flags;
}

std::string quoted(const char* text) {
    return text ? fmt::format("'{}'", text) : "";
}

// "gpiochip0 'pinctrl-bcm2835', gpiochip1 '...'"; those that may be opened.
std::string chips_there() {
    gpiod_chip_iter* iter = gpiod_chip_iter_new();
    if (!iter) return "";
    std::string found;
    gpiod_chip* chip;
    gpiod_foreach_chip(iter, chip) found +=
        fmt::format("{}{} '{}'", found.empty() ? "" : ", ", gpiod_chip_name(chip), gpiod_chip_label(chip));
    gpiod_chip_iter_free(iter);
    return found;
}

Error no_chip(const std::string& chip, int error) {
    if (error == EACCES || error == EPERM)
        return fail(
            fmt::format("no permission for the GPIO chip '{}': join the group that owns it (ls -l /dev/gpiochip*; sudo "
                        "usermod -aG gpio "
                        "$USER, and log in again), or give it one by a udev rule: SUBSYSTEM==\"gpio\", GROUP=\"gpio\", "
                        "MODE=\"0660\"",
                        chip));
    const std::string there = chips_there();
    return fail(fmt::format("no GPIO chip '{}' ({}){}: set chip in the stage's [gpio], as gpioinfo(1) lists them", chip,
                            std::strerror(error),
                            there.empty() ? "; this machine shows none" : "; there are " + there));
}

std::string line_names(gpiod_chip* chip) {
    std::string names;
    for (unsigned n = 0; n < gpiod_chip_num_lines(chip); ++n) {
        gpiod_line* line = gpiod_chip_get_line(chip, n);
        if (line && gpiod_line_name(line))
            names += (names.empty() ? ", and the names " : ", ") + quoted(gpiod_line_name(line));
    }
    return names;
}

std::string name_of(gpiod_chip* chip) {
    return fmt::format("the GPIO chip '{}'", gpiod_chip_name(chip));
}

// By its name, or its offset in digits.
Result<gpiod_line*> find_line(gpiod_chip* chip, const std::string& name) {
    gpiod_line* line = gpiod_chip_find_line(chip, name.c_str());
    const bool is_offset = name.size() <= 5 && name.find_first_not_of("0123456789") == std::string::npos;
    if (!line && is_offset) line = gpiod_chip_get_line(chip, unsigned(std::stoi(name)));
    if (line) return line;
    return fail(fmt::format("{} has no line '{}': it has the offsets 0 to {}{}", name_of(chip), name,
                            gpiod_chip_num_lines(chip) - 1, line_names(chip)));
}

class Gpiod16 : public GpioLines {
  public:
    Gpiod16(Chip chip, std::string name) : chip_(std::move(chip)), name_(std::move(name)) {}

    std::string name() const override { return name_; }

    Status request(const std::vector<GpioLineSetup>& inputs, const std::vector<GpioLineSetup>& outputs) {
        for (const GpioLineSetup& setup : inputs) {
            const auto line = find_line(chip_.get(), setup.line);
            if (!line.ok()) return line.error();
            if (gpiod_line_request_both_edges_events_flags(*line, consumer, flags_of(setup)) != 0)
                return refused(*line, setup, "an input with edges");
            inputs_.push_back(*line);
            waiting_.push_back({gpiod_line_event_get_fd(*line), POLLIN, 0});
        }
        for (const GpioLineSetup& setup : outputs) {
            const auto line = find_line(chip_.get(), setup.line);
            if (!line.ok()) return line.error();
            if (gpiod_line_request_output_flags(*line, consumer, flags_of(setup), 0) != 0)
                return refused(*line, setup, "an output");
            outputs_.push_back(*line);
        }
        return Done{};
    }

    Result<std::vector<GpioEdge>> wait(int timeout_ms) override {
        const uint64_t end_ns = steady_ns() + uint64_t(std::max(timeout_ms, 0)) * 1'000'000;
        for (;;) {
            const uint64_t now_ns = steady_ns();
            const int left_ms = now_ns >= end_ns ? 0 : int((end_ns - now_ns + 999'999) / 1'000'000);
            const int ready = ::poll(waiting_.data(), waiting_.size(), std::min(left_ms, wait_piece_ms));
            if (ready < 0 && errno != EINTR) return gone(errno);
            if (ready > 0) return read_edges();
            if (gpiod_line_get_value(inputs_.empty() ? outputs_[0] : inputs_[0]) < 0) return gone(errno);
            if (left_ms == 0) return std::vector<GpioEdge>();
        }
    }

    Result<std::vector<bool>> levels() override {
        std::vector<bool> active;
        for (gpiod_line* line : inputs_) {
            const int value = gpiod_line_get_value(line);
            if (value < 0) return gone(errno);
            active.push_back(value == 1);
        }
        return active;
    }

    Status set(size_t output, bool active) override {
        if (gpiod_line_set_value(outputs_[output], active) != 0) return gone(errno);
        return Done{};
    }

  private:
    Result<std::vector<GpioEdge>> read_edges() {
        std::vector<GpioEdge> edges;
        for (size_t input = 0; input < inputs_.size(); ++input) {
            pollfd waiting = waiting_[input];
            for (int n = 0; n<reads_a_wait&& ::poll(&waiting, 1, 0)> 0; ++n) {
                if (waiting.revents & (POLLERR | POLLHUP | POLLNVAL)) return gone(ENODEV);
                gpiod_line_event events[events_a_read];
                const int count = gpiod_line_event_read_multiple(inputs_[input], events, events_a_read);
                if (count < 0) return gone(errno);
                for (int k = 0; k < count; ++k)
                    edges.push_back({input, events[k].event_type == GPIOD_LINE_EVENT_RISING_EDGE, time_of(events[k])});
            }
        }
        std::ranges::stable_sort(edges, {}, &GpioEdge::time_ns);
        return edges;
    }

    Error refused(gpiod_line* line, const GpioLineSetup& setup, const char* what) const {
        const int error = errno;
        if (error == EBUSY)
            return fail(fmt::format("line '{}' of {} is used by {}: end that program, or choose another line",
                                    setup.line, name_,
                                    gpiod_line_consumer(line) ? quoted(gpiod_line_consumer(line)) : "the kernel"));
        return fail(fmt::format("line '{}' of {} cannot be {} ({}): choose another line, or bias = \"as_is\"",
                                setup.line, name_, what, std::strerror(error)));
    }

    Error gone(int error) const {
        return fail(fmt::format("{} has gone ({}): connect it again and start over", name_, std::strerror(error)));
    }

    Chip chip_;  // its lines are released with it
    std::string name_;
    std::vector<gpiod_line*> inputs_, outputs_;
    std::vector<pollfd> waiting_;  // of the inputs
};

}  // namespace

Result<std::unique_ptr<GpioLines>> open_gpio(const std::string& chip, const std::vector<GpioLineSetup>& inputs,
                                             const std::vector<GpioLineSetup>& outputs) {
    Chip opened(gpiod_chip_open_lookup(chip.c_str()), gpiod_chip_close);
    if (!opened) return no_chip(chip, errno);
    const std::string name = name_of(opened.get());
    auto lines = std::make_unique<Gpiod16>(std::move(opened), name);
    if (const Status requested = lines->request(inputs, outputs); !requested.ok()) return requested.error();
    return std::unique_ptr<GpioLines>(std::move(lines));
}

Result<GpioLineLook> look_at_line(const std::string& chip, const std::string& line) {
    const Chip opened(gpiod_chip_open_lookup(chip.c_str()), gpiod_chip_close);
    if (!opened) return no_chip(chip, errno);
    const auto found = find_line(opened.get(), line);
    if (!found.ok()) return found.error();
    const char* const user = gpiod_line_consumer(*found);
    return GpioLineLook{gpiod_chip_name(opened.get()), gpiod_line_offset(*found), gpiod_line_is_used(*found),
                        user ? user : ""};
}

}  // namespace ols

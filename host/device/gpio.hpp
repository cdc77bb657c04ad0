// SPDX-License-Identifier: MIT
// GPIO lines of this machine: inputs with edges that the kernel stamps, and outputs. libgpiod is behind it (gpiod16.cpp; another
// release of it is another file), a fake in the tests.
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "result.hpp"
#include "stage/gpio_setup.hpp"

namespace ols {

struct GpioEdge {
    size_t input = 0;  // in the order in which they were asked for
    bool active = false;
    uint64_t time_ns =
        0;  // CLOCK_MONOTONIC, as the kernel's interrupt handler took it; of the read on kernels before 5.7
};

// Active and inactive take `active_low` into account.
// Threads: wait() and levels() from one thread, set() from any. Every function returns, wait() after its time-out at the latest.
// Errors: the chip has gone (unplugged, its driver unbound); then nothing of it works any more.
class GpioLines {
  public:
    virtual ~GpioLines() = default;

    virtual std::string name() const = 0;  // "the GPIO chip 'gpiochip0'"

    // The edges that wait, oldest first; when there are none, those that come within `timeout_ms`. The kernel keeps 16 a line
    // and drops the newest without a word (its ABI 1), so look at levels() too: EdgeAccount finds what was dropped.
    virtual Result<std::vector<GpioEdge>> wait(int timeout_ms) = 0;

    virtual Result<std::vector<bool>> levels() = 0;  // of the inputs: whether each is active

    virtual Status set(size_t output, bool active) = 0;
};

// Outputs begin inactive. Errors name the chips that there are, the chip's lines, who has a line, or how to get permission.
Result<std::unique_ptr<GpioLines>> open_gpio(const std::string& chip, const std::vector<GpioLineSetup>& inputs,
                                             const std::vector<GpioLineSetup>& outputs);

// A line as it is, without taking it: nothing changes. `line` is its name on the chip, or its offset in digits.
struct GpioLineLook {
    std::string chip;  // "gpiochip0"
    unsigned offset = 0;
    bool is_used = false;
    std::string consumer;  // who uses it; empty where the kernel does not say
};
Result<GpioLineLook> look_at_line(const std::string& chip, const std::string& line);

// What is known of an input's edges. Edges alternate: two of one direction in a row prove one between them that did not come, and
// so does a level that the last edge does not explain. Of an even number dropped nothing can be known.
class EdgeAccount {
  public:
    void add(bool active);

    // A level read while no edge was waiting. An edge may be on its way from the interrupt: a level counts once it was read twice.
    void look(bool active);

    uint64_t seen() const { return seen_; }
    uint64_t lost() const { return lost_; }  // at least

  private:
    enum Level { unknown, inactive, active };
    static Level level_of(bool is_active) { return is_active ? active : inactive; }
    Level last_ = unknown, doubt_ = unknown;
    uint64_t seen_ = 0, lost_ = 0;
};

}  // namespace ols

// SPDX-License-Identifier: MIT
// Clocks: the one that stamps are read from, and the wall's.
#include <fmt/format.h>

#include "doctor/check_up.hpp"

namespace ols {

namespace {

constexpr const char* source_folder = "/sys/devices/system/clocksource/clocksource0";

Finding check_source(const Machine& machine) {
    const auto source = machine.read(std::string(source_folder) + "/current_clocksource");
    if (!source) return skipped(Check::clock_source, "the kernel does not say what its clock is");
    Finding finding{
        Check::clock_source,
        "",
        CheckVerdict::ok,
        *source,
        "one that is read in the processor (tsc, kvm-clock, arch_sys_counter): hpet and acpi_pm cost a system "
        "call and a microsecond and more each time, and a frame is stamped several times",
        {}};
    if (*source == "tsc" || *source == "kvm-clock" || *source == "arch_sys_counter" || source->starts_with("hyperv"))
        return finding;
    finding.verdict = CheckVerdict::warn;
    finding.commands = {
        "sudo dmesg | grep -i -e clocksource -e tsc    # why it was not taken",
        fmt::format("cat {}/available_clocksource    # has tsc? boot with clocksource=tsc:", source_folder),
        "printf 'GRUB_CMDLINE_LINUX=\"$GRUB_CMDLINE_LINUX clocksource=tsc tsc=reliable\"\\n' | sudo tee "
        "/etc/default/grub.d/stage-clock.cfg && sudo update-grub"};
    return finding;
}

Finding check_wall(const Machine& machine) {
    const auto clock = machine.wall_clock();
    if (!clock) return skipped(Check::clock_synchronised, "adjtimex(2) is refused to this process");
    Finding finding{
        Check::clock_synchronised,
        "",
        CheckVerdict::ok,
        "",
        "a clock that a server sets: takes, logs and certificates are dated by it. Nothing of a take's own times "
        "depends on it",
        {}};
    if (clock->is_synchronised) {
        finding.found = fmt::format("synchronised, off by {:.3g} s at most", clock->error_bound_s);
        return finding;
    }
    finding.verdict = CheckVerdict::warn;
    finding.found = "the kernel's clock is set by nobody";
    finding.commands = {"sudo apt install chrony && sudo systemctl enable --now chrony",
                        "chronyc waitsync 30    # and when it is right"};
    return finding;
}

}  // namespace

Findings check_clock(const CheckUp& up) {
    return {check_source(up.machine), check_wall(up.machine)};
}

}  // namespace ols

// SPDX-License-Identifier: MIT
// What a benchmark program is made of: knobs, whose settings are measured side by side and printed as JSON lines.
//
// A knob is something that the user or the code may set and that trades accuracy against time or memory. Every knob is
// registered in one place, the program bench_<subject>.cpp, with the call that also measures it:
//
//     int main(int argc, char** argv) {
//         Bench bench(argc, argv, {.name = "inversion", .truth = "...", .advice = "..."});
//         const size_t samples = bench.full() ? 640 * 480 : 1000;
//         ...
//         bench.measure({.name = "method", .set_by = "...", .error_unit = "counts", .peer = "OpenBLAS sgemm",
//                        .default_setting = "structured int16", .settings = {...}});
//         return bench.finish();
//     }
//
//     bench_inversion           measures; a line a setting: subject, knob, setting, default, peer, error, error_unit,
//                               ms_median, ratio_to_peer, threads, rounds, bytes, detail
//     bench_inversion --list    the registry: a line for the subject and one for each knob, nothing measured
//     bench_inversion --smoke   every setting twice at tiny sizes, so that tests see that the program works
//     --rounds N                instead of 15
//
// tests/bench/bench.py runs the programs and makes docs/accuracy.md of their lines.
#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <vector>

namespace ols {

// For benchmarks of planes that are made anew, run after run: keep_freed_planes() (image/freed_planes.hpp), or the program ends
// with a message, for its times would be those of the kernel's clearing pages.
void require_freed_planes(const char* program);

struct Setting {
    std::string name;
    std::function<void()> run;           // the work that is timed, whole each time; its result stays for `error`
    std::function<double()> error;       // of the latest run against truth, in the knob's unit; exact is 0
    int threads = 1;                     // that `run` uses
    std::function<void()> prepare = {};  // before each run, not timed; may be none
    std::string detail = "";             // what ran, where the name leaves it open: a library's kernel, as it was found
};

struct Knob {
    std::string name;
    std::string set_by;           // the flag, key or field that sets it: "stagectl run --basis"
    std::string error_unit;       // "counts rms"
    std::string peer;             // the setting that the others are compared with, by name
    std::string default_setting;  // by name
    // Where the default is on no Pareto front of error and time (another setting is better in one and no worse in the
    // other): why it is the default nevertheless. Else empty.
    std::string why_off_front = "";
    std::vector<Setting> settings;
    bool differs_by_machine = false;  // settings and default are those of the processor at hand
    // Where many knobs have the same settings: the table of the docs that shows all of them, each in a line, by their figure
    // alone (`error`, in its unit). Else empty.
    std::string table = "";
    std::string table_note = "";  // what that table shows, above it; the same for all its knobs
    int most_rounds = 1000;       // for settings that take seconds; 1: the run that the error is of is timed
};

struct Subject {
    std::string name;    // the program is bench_<name>
    std::string truth;   // what errors are measured against, and the workload: a sentence or two
    std::string advice;  // what to choose when: two or three sentences
};

// The times of one setting, beside those of its peer in the same rounds.
struct Timing {
    double ms_median = 0;
    double ratio_to_peer = 0;  // median over rounds of peer's time / own time: above 1 is faster than the peer
};

// times_ms[setting][round], at least one round.
std::vector<Timing> compare_times(const std::vector<std::vector<double>>& times_ms, size_t peer);

// Bytes that `run` makes resident at its peak beyond what was resident before (Linux: VmHWM after a reset of the mark).
// Memory that is freed and reused within the run counts once. Nothing where the kernel does not allow the reset.
std::optional<uint64_t> peak_bytes_of(const std::function<void()>& run);

class Bench {
  public:
    Bench(int argc, char** argv, const Subject& subject);

    // Whether sizes should be those that the docs state; else tiny.
    bool full() const { return mode_ == Mode::full; }

    // Whether anything is measured; else the registry is listed, and inputs are not needed.
    bool measures() const { return mode_ != Mode::list; }

    // Prints the knob's registry entry, or measures: first each setting once, for its error and its memory, then rounds
    // in each of which every setting runs once, every round beginning with another one, so that a disturbance of the
    // machine meets all of them. A setting of one thread is timed by the processor time of the process, others by the
    // clock.
    void measure(const Knob& knob);

    // The exit code.
    int finish() const { return failed_ ? 1 : 0; }

  private:
    enum class Mode { full, smoke, list };

    std::string subject_;
    Mode mode_ = Mode::full;
    int rounds_ = 15;
    bool failed_ = false;
};

}  // namespace ols

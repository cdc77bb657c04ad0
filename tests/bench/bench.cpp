// SPDX-License-Identifier: MIT
// Rounds, medians, memory and JSON lines of the benchmark programs.
#include "bench.hpp"

#include <malloc.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <ctime>
#include <fstream>
#include <nlohmann/json.hpp>
#include <sstream>

#include "image/freed_planes.hpp"

namespace ols {

namespace {

using Json = nlohmann::ordered_json;

void print_line(const Json& line) {
    std::puts(line.dump().c_str());
    std::fflush(stdout);
}

double median(std::vector<double> values) {
    const auto middle = values.begin() + std::ptrdiff_t(values.size() / 2);
    std::nth_element(values.begin(), middle, values.end());
    if (values.size() % 2) return *middle;
    return (*middle + *std::max_element(values.begin(), middle)) / 2;
}

double now_ms(clockid_t clock) {
    timespec now{};
    clock_gettime(clock, &now);
    return double(now.tv_sec) * 1e3 + double(now.tv_nsec) * 1e-6;
}

double time_of(const Setting& setting) {
    const clockid_t clock = setting.threads == 1 ? CLOCK_PROCESS_CPUTIME_ID : CLOCK_MONOTONIC;
    const double begin = now_ms(clock);
    setting.run();
    return now_ms(clock) - begin;
}

// A line "VmHWM:   1234 kB" of /proc/self/status.
std::optional<uint64_t> status_bytes(const std::string& key) {
    std::ifstream status("/proc/self/status");
    for (std::string line; std::getline(status, line);)
        if (line.starts_with(key + ":")) {
            uint64_t kilobytes = 0;
            std::istringstream(line.substr(key.size() + 1)) >> kilobytes;
            return kilobytes * 1024;
        }
    return {};
}

size_t index_of(const Knob& knob, const std::string& setting) {
    for (size_t i = 0; i < knob.settings.size(); ++i)
        if (knob.settings[i].name == setting) return i;
    return knob.settings.size();
}

[[noreturn]] void usage(const char* program, const std::string& wrong) {
    std::fprintf(stderr, "%s: %s; use: %s [--list | --smoke] [--rounds N]\n", program, wrong.c_str(), program);
    std::exit(2);
}

}  // namespace

void require_freed_planes(const char* program) {
    if (keep_freed_planes()) return;
    std::fprintf(
        stderr,
        "%s: the allocator returns freed planes to the kernel: times would be those of its clearing pages; run a "
        "build without sanitizers\n",
        program);
    std::exit(1);
}

std::vector<Timing> compare_times(const std::vector<std::vector<double>>& times_ms, size_t peer) {
    std::vector<Timing> out;
    for (const auto& own : times_ms) {
        std::vector<double> ratios;
        for (size_t round = 0; round < own.size(); ++round) ratios.push_back(times_ms[peer][round] / own[round]);
        out.push_back({median(own), median(ratios)});
    }
    return out;
}

std::optional<uint64_t> peak_bytes_of(const std::function<void()>& run) {
    malloc_trim(0);  // freed memory that the allocator kept would be used again unseen
    std::ofstream reset("/proc/self/clear_refs");
    const bool marked = bool(reset << 5 << std::flush);  // proc(5): 5 resets the peak to what is resident now
    const auto before = status_bytes("VmHWM");
    run();
    const auto after = status_bytes("VmHWM");
    if (!marked || !before || !after) return {};
    return *after - *before;
}

Bench::Bench(int argc, char** argv, const Subject& subject) : subject_(subject.name) {
    for (int i = 1; i < argc; ++i) {
        const std::string option = argv[i];
        if (option == "--list")
            mode_ = Mode::list;
        else if (option == "--smoke")
            mode_ = Mode::smoke, rounds_ = 1;
        else if (option == "--rounds" && i + 1 < argc)
            rounds_ = std::atoi(argv[++i]);
        else
            usage(argv[0], "what is '" + option + "'?");
    }
    if (rounds_ < 1) usage(argv[0], "--rounds needs a number of at least 1");
    if (mode_ == Mode::list)
        print_line({{"subject", subject.name}, {"truth", subject.truth}, {"advice", subject.advice}});
}

void Bench::measure(const Knob& knob) {
    const size_t peer = index_of(knob, knob.peer), count = knob.settings.size();
    if (peer == count || index_of(knob, knob.default_setting) == count) {
        std::fprintf(stderr, "%s, %s: peer '%s' or default '%s' is not among the settings\n", subject_.c_str(),
                     knob.name.c_str(), knob.peer.c_str(), knob.default_setting.c_str());
        failed_ = true;
        return;
    }
    if (mode_ == Mode::list) {
        Json names = Json::array();
        for (const auto& setting : knob.settings) names.push_back(setting.name);
        print_line({{"subject", subject_},
                    {"knob", knob.name},
                    {"set_by", knob.set_by},
                    {"error_unit", knob.error_unit},
                    {"peer", knob.peer},
                    {"default", knob.default_setting},
                    {"why_off_front", knob.why_off_front},
                    {"differs_by_machine", knob.differs_by_machine},
                    {"table", knob.table},
                    {"table_note", knob.table_note},
                    {"settings", names}});
        return;
    }

    std::vector<double> errors;
    std::vector<std::optional<uint64_t>> bytes;
    std::vector<std::vector<double>> times(count);
    const int rounds = std::min(rounds_, knob.most_rounds);
    for (size_t i = 0; i < count; ++i) {
        const Setting& setting = knob.settings[i];
        if (setting.prepare) setting.prepare();
        bytes.push_back(peak_bytes_of([&] { times[i] = {time_of(setting)}; }));
        errors.push_back(setting.error());
    }
    if (knob.most_rounds > 1) times.assign(count, {});
    for (int round = 0; round < rounds && knob.most_rounds > 1; ++round)
        for (size_t k = 0; k < count; ++k) {
            const size_t i = (k + size_t(round)) % count;
            if (knob.settings[i].prepare) knob.settings[i].prepare();
            times[i].push_back(time_of(knob.settings[i]));
        }
    const auto timings = compare_times(times, peer);
    for (size_t i = 0; i < count; ++i) {
        const Setting& setting = knob.settings[i];
        // JSON has no infinity: an error that is not finite is null, and the docs say so.
        print_line({{"subject", subject_},
                    {"knob", knob.name},
                    {"setting", setting.name},
                    {"default", setting.name == knob.default_setting},
                    {"peer", knob.peer},
                    {"error", std::isfinite(errors[i]) ? Json(errors[i]) : Json()},
                    {"error_unit", knob.error_unit},
                    {"ms_median", timings[i].ms_median},
                    {"ratio_to_peer", timings[i].ratio_to_peer},
                    {"threads", setting.threads},
                    {"rounds", rounds},
                    {"bytes", bytes[i] ? Json(*bytes[i]) : Json()},
                    {"detail", setting.detail}});
    }
}

}  // namespace ols

// SPDX-License-Identifier: MIT
// A process a kernel, each of which prints its kernel's name and time.
#include "openblas_kernel.hpp"

#include <cblas.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <ctime>
#include <memory>
#include <sstream>
#include <vector>

namespace ols {

namespace {

constexpr const char* kernel_variable = "OPENBLAS_CORETYPE";      // read by OpenBLAS as it is loaded
constexpr const char* times_variable = "BENCH_OPENBLAS_KERNELS";  // what was timed, for the program begun anew
constexpr const char* timing_option = "--time-openblas";

// Names of OpenBLAS's driver/others/dynamic.c whose products of single precision differ. A process that is asked for one which the
// processor cannot run dies, one that does not know the name runs another: both are left out. An empty name is OpenBLAS's own choice.
constexpr std::array kernels = {"",    "Nehalem",  "Sandybridge", "Haswell",
                                "Zen", "SkylakeX", "Cooperlake",  "SapphireRapids"};

struct KernelTime {
    std::string kernel;
    double ms = 0;
};

double processor_ms() {
    timespec now{};
    clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &now);
    return double(now.tv_sec) * 1e3 + double(now.tv_nsec) * 1e-6;
}

// The least of a few runs: what disturbs a run makes it longer.
double least_ms(ProductShape shape) {
    constexpr int runs = 7;
    const auto plane = [](int a, int b) { return std::vector<float>(size_t(a) * size_t(b), 1.5f); };
    const std::vector<float> a = plane(shape.rows, shape.inner), b = plane(shape.inner, shape.columns);
    std::vector<float> c = plane(shape.rows, shape.columns);
    openblas_set_num_threads(1);
    double least = 1e9;
    for (int run = 0; run < runs; ++run) {
        const double begin = processor_ms();
        cblas_sgemm(CblasRowMajor, CblasNoTrans, CblasNoTrans, shape.rows, shape.columns, shape.inner, 1, a.data(),
                    shape.inner, b.data(), shape.columns, 0, c.data(), shape.columns);
        least = std::min(least, processor_ms() - begin);
    }
    return least;
}

// The lines that the program prints when it is begun with a kernel to time.
std::vector<KernelTime> timed_kernels(const std::string& program) {
    std::vector<KernelTime> found;
    for (const std::string kernel : kernels) {
        const std::string command = (kernel.empty() ? "" : kernel_variable + ("=" + kernel) + " ") + "'" + program +
                                    "' " + timing_option + " 2>/dev/null";
        const std::unique_ptr<FILE, int (*)(FILE*)> child(popen(command.c_str(), "r"), &pclose);
        KernelTime one;
        std::array<char, 64> name{};
        if (!child || std::fscanf(child.get(), "%63s %lf", name.data(), &one.ms) != 2) continue;
        one.kernel = name.data();
        const bool is_asked = kernel.empty() || one.kernel == kernel;
        const bool is_new = std::ranges::find(found, one.kernel, &KernelTime::kernel) == found.end();
        if (is_asked && is_new) found.push_back(one);
    }
    std::ranges::sort(found, {}, &KernelTime::ms);
    return found;
}

std::string text_of(const std::vector<KernelTime>& times, ProductShape shape) {
    std::ostringstream text;
    text.precision(3);
    for (const KernelTime& one : times) text << one.kernel << ' ' << one.ms << " ms, ";
    text << "for " << shape.rows << " x " << shape.inner << " x " << shape.columns;
    return text.str();
}

[[noreturn]] void fail_begin(const char* program, const char* why) {
    std::fprintf(stderr, "%s: cannot begin itself to time OpenBLAS's kernels: %s; set %s to one of them\n", program,
                 why, kernel_variable);
    std::exit(1);
}

}  // namespace

void choose_openblas_kernel(int argc, char** argv, ProductShape shape) {
    if (argc == 2 && std::strcmp(argv[1], timing_option) == 0) {
        const double ms = least_ms(shape);
        std::printf("%s %.9g\n", openblas_get_corename(), ms);
        std::exit(0);
    }
    const bool lists =
        std::any_of(argv, argv + argc, [](const char* option) { return std::strcmp(option, "--list") == 0; });
    if (lists || std::getenv(kernel_variable)) return;
    std::array<char, 4096> program{};
    if (readlink("/proc/self/exe", program.data(), program.size() - 1) < 0) fail_begin(argv[0], "no /proc/self/exe");
    const std::vector<KernelTime> times = timed_kernels(program.data());
    if (times.empty()) fail_begin(argv[0], "none of them printed a time");
    setenv(kernel_variable, times.front().kernel.c_str(), 1);
    setenv(times_variable, text_of(times, shape).c_str(), 1);
    execv(program.data(), argv);
    fail_begin(argv[0], std::strerror(errno));
}

std::string openblas_kernel_note() {
    const char* const times = std::getenv(times_variable);
    const std::string found =
        times ? std::string("the fastest here: ") + times : std::string("as ") + kernel_variable + " asks";
    return std::string("kernel ") + openblas_get_corename() + ", " + found;
}

}  // namespace ols

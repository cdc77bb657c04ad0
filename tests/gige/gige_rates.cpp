// SPDX-License-Identifier: MIT
// gige_rates: frames a second that come without loss, from GigeDevice through the loopback and the driver. A benchmark: nothing is
// judged. Sender and receiver share this machine's processors.
#include <fmt/format.h>

#include <chrono>
#include <thread>

#include "aravis_rigs.hpp"
#include "network_space.hpp"

namespace ols::test {

namespace {

using Clock = std::chrono::steady_clock;

struct Run {
    uint64_t sent = 0, came = 0;
    CameraCounts counts;
    double seconds = 0;
};

Run run_at(double rate_hz, const CameraSetup& base, int packet_bytes, double seconds) {
    GigeOptions options;
    options.description.packet_size_max = packet_bytes;
    options.description.lacks = {"ChunkModeActive"};
    GigeRig rig(options);
    auto camera = rig.open();
    CameraSetup setup = base;
    setup.trigger_source = "Line1";
    if (!camera || !camera->set_up(setup).ok() || !camera->start().ok()) return {};
    const std::vector<uint16_t> samples(size_t(setup.width) * size_t(setup.height), 123);
    Run run;
    std::atomic<bool> sending = true;
    std::thread reader([&] {
        for (bool more = true; more || sending;) run.came += more = camera->read(300).has_value();
    });
    const auto begin = Clock::now();
    const auto total = uint64_t(rate_hz * seconds);
    for (uint64_t n = 1; n <= total; ++n) {
        std::this_thread::sleep_until(begin + std::chrono::nanoseconds(uint64_t(double(n) / rate_hz * 1e9)));
        rig.device().send((n - 1) % 65535 + 1, rig.device().now_ns(), samples);
    }
    run.seconds = std::chrono::duration<double>(Clock::now() - begin).count();
    run.sent = total;
    sending = false;
    reader.join();
    run.counts = camera->counts();
    return run;
}

}  // namespace

}  // namespace ols::test

int main() {
    using namespace ols::test;
    if (!enter_network_space()) fmt::print("the network is shared with others\n");
    struct Kind {
        int width, height, bits;
    };
    fmt::print("{:>14} {:>8} {:>9} {:>8} {:>8} {:>7} {:>7} {:>7}\n", "frames", "packets", "sent/s", "sent", "came",
               "missing", "incompl", "dropped");
    for (const auto& [width, height, bits] : {Kind{128, 128, 12}, {640, 480, 8}, {640, 480, 12}})
        for (const int packet_bytes : {9000, 65000})
            for (const double rate_hz : {250.0, 500.0, 1000.0, 2160.0}) {
                ols::CameraSetup setup;
                setup.width = width, setup.height = height, setup.bits = bits, setup.cfa = ols::Cfa::none;
                const Run run = run_at(rate_hz, setup, packet_bytes, 4);
                fmt::print("{:>14} {:>8} {:>9.0f} {:>8} {:>8} {:>7} {:>7} {:>7}\n",
                           fmt::format("{}x{}x{}", width, height, bits), packet_bytes, double(run.sent) / run.seconds,
                           run.sent, run.came, run.counts.missing_ids, run.counts.underrun, run.counts.dropped);
                fflush(stdout);
            }
}

// SPDX-License-Identifier: MIT
// Copies the frames of a ring to standard output, their samples only, each when it is due by its stamp: the virtual stage's camera
// for a device that is fed by write() and stamps frames by itself. In virtual pace the ring holds the stage back to the wall's time.
//
// usage: copy_ring RING
// Starts the ring's camera at once and says so on standard error; ends with it, or with whoever reads.
#include <unistd.h>

#include <chrono>
#include <cstdio>
#include <thread>

#include "device/ring.hpp"

namespace ols {

namespace {

int refuse(const std::string& message) {
    std::fprintf(stderr, "copy_ring: %s\n", message.c_str());
    return 1;
}

bool write_all(const std::vector<std::byte>& samples) {
    for (size_t done = 0; done < samples.size();) {
        const ssize_t written = ::write(STDOUT_FILENO, samples.data() + done, samples.size() - done);
        if (written <= 0) return false;
        done += size_t(written);
    }
    return true;
}

int copy_ring(const char* path) {
    auto ring = RingReader::open(path);
    if (!ring.ok()) return refuse(ring.error().message);
    const auto started_ns = ring->start(60'000);
    if (!started_ns.ok()) return refuse(started_ns.error().message);
    std::fputs("started\n", stderr);
    using Clock = std::chrono::steady_clock;
    std::optional<Clock::time_point> camera_zero;  // when the camera's clock was 0, by ours
    while (ring->writer() == RingReader::Writer::live) {
        const auto frame = ring->read(100);
        if (!frame) continue;
        const std::chrono::nanoseconds time(frame->stamp.timestamp_ns);
        if (!camera_zero) camera_zero = Clock::now() - time;
        std::this_thread::sleep_until(*camera_zero + time);
        if (!write_all(frame->samples)) return 0;
    }
    return 0;
}

}  // namespace

}  // namespace ols

int main(int argc, char** argv) {
    return argc == 2 ? ols::copy_ring(argv[1]) : ols::refuse("usage: copy_ring RING");
}

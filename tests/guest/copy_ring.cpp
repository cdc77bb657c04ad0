// SPDX-License-Identifier: MIT
// Copies the frames of a ring to standard output: the time of each in nanoseconds (64 bits, little-endian), then its samples. For a
// device that is fed by write() (inside/feed_loopback.py), whoever shows the frames when they are due.
//
// usage: copy_ring RING
// Starts the ring's camera at once and says so on standard error; ends with it, or with whoever reads.
#include <unistd.h>

#include <cstdio>
#include <span>

#include "device/ring.hpp"

namespace ols {

namespace {

int refuse(const std::string& message) {
    std::fprintf(stderr, "copy_ring: %s\n", message.c_str());
    return 1;
}

bool write_all(std::span<const std::byte> bytes) {
    while (!bytes.empty()) {
        const ssize_t written = ::write(STDOUT_FILENO, bytes.data(), bytes.size());
        if (written <= 0) return false;
        bytes = bytes.subspan(size_t(written));
    }
    return true;
}

int copy_ring(const char* path) {
    auto ring = RingReader::open(path);
    if (!ring.ok()) return refuse(ring.error().message);
    const auto started_ns = ring->start(60'000);
    if (!started_ns.ok()) return refuse(started_ns.error().message);
    std::fputs("started\n", stderr);
    while (ring->writer() == RingReader::Writer::live) {
        const auto frame = ring->read(100);
        if (!frame) continue;
        const uint64_t time_ns = frame->stamp.timestamp_ns;
        if (!write_all(std::as_bytes(std::span(&time_ns, 1))) || !write_all(frame->samples)) return 0;
    }
    return 0;
}

}  // namespace

}  // namespace ols

int main(int argc, char** argv) {
    return argc == 2 ? ols::copy_ring(argv[1]) : ols::refuse("usage: copy_ring RING");
}

// SPDX-License-Identifier: MIT
// gige_bridge RING ADDRESS: serves the frames of a ring, which the virtual stage fills, as a GigE Vision camera at that address of the
// loopback, until its standard input ends. Prints "ready" when it listens.
#include <poll.h>
#include <unistd.h>

#include <cstdio>

#include "device/ring.hpp"
#include "gige_device.hpp"

namespace ols::test {

namespace {

constexpr int patience_ms = 60'000, look_ms = 20;

GigeOptions options_of(const RingContent& content, const std::string& address) {
    GigeOptions options;
    options.address = address;
    options.width_max = int(content.width), options.height_max = int(content.height);
    const char* filters[] = {"Mono", "BayerRG", "BayerBG", "BayerGR", "BayerGB"};
    const std::string prefix = filters[size_t(content.cfa)] + std::to_string(content.bits);
    for (const PixelCode& code : pixel_codes())
        if (std::string(code.name).starts_with(prefix)) options.description.pixel_formats.insert(code.name);
    return options;
}

std::vector<uint16_t> samples_of(const Frame& frame) {
    const auto* samples = reinterpret_cast<const uint16_t*>(frame.samples.data());
    return {samples, samples + frame.samples.size() / 2};
}

int bridge(const std::string& path, const std::string& address) {
    auto ring = RingReader::open(path);
    if (!ring.ok()) return fprintf(stderr, "%s\n", ring.error().message.c_str()), 1;
    GigeOptions options = options_of(ring->content(), address);
    // The camera's time is the virtual stage's; each time it is asked for is later than the one before.
    std::atomic<uint64_t> last_ns = 0;
    options.clock_ns = [&] { return last_ns = std::max(ring->watermark_ns(), last_ns + 1); };
    options.description.lacks = {"ChunkModeActive"};
    GigeDevice device(options);
    if (const auto started = ring->start(patience_ms); !started.ok())
        return fprintf(stderr, "%s\n", started.error().message.c_str()), 1;
    puts("ready");
    fflush(stdout);
    for (pollfd end{STDIN_FILENO, POLLIN | POLLHUP, 0}; poll(&end, 1, 0) == 0;) {
        const auto frame = ring->read(look_ms);
        if (!frame) continue;
        const uint64_t block_id = (frame->stamp.frame_id - 1) % 65535 + 1;
        device.send(block_id, frame->stamp.timestamp_ns, samples_of(*frame));
    }
    return 0;
}

}  // namespace

}  // namespace ols::test

int main(int argc, char** argv) {
    if (argc != 3) return fprintf(stderr, "usage: gige_bridge RING ADDRESS\n"), 1;
    return ols::test::bridge(argv[1], argv[2]);
}

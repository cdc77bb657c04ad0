// SPDX-License-Identifier: MIT
// A GigE Vision camera on the loopback: GigeDevice's packets through the kernel's UDP to Aravis and the driver.
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <fstream>
#include <sstream>
#include <thread>

#include "camera_link.hpp"
#include "gige_device.hpp"

namespace ols::test {

namespace {

// Where a leader has its image's height (GVSP: 8 bytes of header, 16 of type, time and format, then the width), and a trailer.
constexpr size_t leader_height_at = 28, trailer_height_at = 12;
constexpr int driver_buffers = 1024;  // the most that the driver takes
constexpr uint32_t reg_stream_port = 0x0d00;
constexpr int look_frames = 16;  // after which it is looked whether the packets are taken

GigeOptions options_of(const Scenario& scenario, const std::string& address, const std::atomic<uint64_t>& now_ns) {
    GigeOptions options;
    options.address = address;
    options.width_max = scenario.width, options.height_max = scenario.height;
    options.description.pixel_formats = {"Mono12"};
    options.description.lacks = {"ChunkModeActive"};
    options.clock_ns = [&now_ns, last_ns = uint64_t(0)]() mutable {
        return last_ns = std::max(now_ns.load(), last_ns + 1);
    };
    // What was cut off is not sent again.
    options.resends = std::ranges::none_of(scenario.faults,
                                           [](const FaultSpec& fault) { return fault.kind == FaultKind::cut_frame; });
    return options;
}

void put_height(Packet& packet, size_t at, uint32_t height) {
    for (int n = 0; n < 4; ++n) packet[at + size_t(n)] = uint8_t(height >> 8 * (3 - n));
}

class GigeLink : public CameraLink {
  public:
    GigeLink(const Scenario& scenario, const std::string& address)
        : address_(address), height_(uint32_t(scenario.height)), device_(options_of(scenario, address, now_ns_)) {
        device_.on_the_way = [this](std::vector<Packet>& packets) {
            if (sent_height_ != height_) {
                put_height(packets.front(), leader_height_at, sent_height_);
                put_height(packets.back(), trailer_height_at, sent_height_);
            }
            if (is_cut_) packets.erase(packets.end() - 2);
        };
    }

    Result<std::unique_ptr<Camera>> open() override { return open_camera("aravis:" + address_); }
    // A frame whose packets come behind a later one's is none for Aravis; and a camera that restarts has to be opened anew.
    bool can(FaultKind kind) const override {
        return kind != FaultKind::late_within && kind != FaultKind::swap_next && kind != FaultKind::restart;
    }
    void set_now(uint64_t now_ns) override { now_ns_ = now_ns; }
    bool send(const Shot& shot, const std::atomic<bool>&) override {
        sent_height_ = shot.height;
        auto samples = shot.samples;
        samples.resize(size_t(shot.width) * height_);
        if (++sent_ % look_frames == 0) wait();
        device_.send((shot.stamp.frame_id - 1) % 65535 + 1, shot.stamp.timestamp_ns, samples);
        return true;
    }
    void lose(const Shot& shot, bool in_part, const std::atomic<bool>& in_haste) override {
        if (!in_part) return;
        is_cut_ = true;
        send(shot, in_haste);
        is_cut_ = false;
    }
    int room() const override { return driver_buffers; }

  private:
    // Until the kernel holds no packets of ours for the driver: what is lost to a socket that is full is another test's.
    void wait() const {
        // And a moment in which the device may answer what the driver asks.
        std::this_thread::sleep_for(std::chrono::microseconds(50));
        while (device_.is_acquiring() && unread_bytes() > 0) std::this_thread::yield();
    }
    // proc(5), /proc/net/udp: after the two addresses and the state, the queues to send and to be read, in hex.
    uint64_t unread_bytes() const {
        std::ifstream sockets("/proc/net/udp");
        const uint32_t port = device_.word(reg_stream_port);
        uint64_t unread = 0;
        for (std::string line; std::getline(sockets, line);) {
            std::istringstream words(line);
            std::string number, local, remote, state, queues;
            words >> number >> local >> remote >> state >> queues;
            const size_t colon = local.find(':'), queue = queues.find(':');
            if (colon == std::string::npos || queue == std::string::npos) continue;
            if (std::stoul(local.substr(colon + 1), nullptr, 16) != port) continue;
            unread += std::stoul(queues.substr(queue + 1), nullptr, 16);
        }
        return unread;
    }

    const std::string address_;
    const uint32_t height_;
    std::atomic<uint64_t> now_ns_ = 0;
    uint32_t sent_height_ = 0;
    int sent_ = 0;
    bool is_cut_ = false;
    GigeDevice device_;
};

}  // namespace

std::unique_ptr<CameraLink> make_gige_link(const Scenario& scenario) {
    // One that no other program of the tests has.
    static int links = 0;
    const auto part = [](int number) { return std::to_string(1 + number); };
    return std::make_unique<GigeLink>(
        scenario, "127." + part(getpid() / 254 % 254) + "." + part(getpid() % 254) + "." + part(++links % 250));
}

}  // namespace ols::test

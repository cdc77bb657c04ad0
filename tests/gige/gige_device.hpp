// SPDX-License-Identifier: MIT
// GigeDevice: a GigE Vision camera (standard 2.0: control protocol, streaming protocol, bootstrap registers) with line triggers, whose
// every exposure, packet and failure a test has in its hand. Real programs talk to it over UDP.
#pragma once

#include <netinet/in.h>

#include <atomic>
#include <deque>
#include <functional>
#include <mutex>
#include <string>
#include <thread>
#include <vector>

#include "device_description.hpp"
#include "gvsp.hpp"
#include "pixel_code.hpp"

namespace ols::test {

struct GigeOptions {
    std::string address = "127.0.0.1", serial = "OLS1";
    int width_max = 2048, height_max = 2048, black_level = 64;
    DescriptionOptions description;
    bool extended_ids = false, resends = true;
    uint64_t ticks_hz = 1'000'000'000;
    std::function<uint64_t()> clock_ns;  // of the camera; its own, which runs as the machine's, when there is none
};

class GigeDevice {
  public:
    explicit GigeDevice(GigeOptions options);
    ~GigeDevice();
    GigeDevice(const GigeDevice&) = delete;

    // A pulse on a line. False when no frame comes of it: the acquisition is off, or the trigger is another line's.
    bool trigger(const std::string& line = "Line1");
    // A pulse that the camera is not ready for: it has no id; a frame that it exposes, and that never leaves it: it has one.
    void miss_trigger() { (void)next_ns(); }
    void lose_frame() { ++next_id_; }
    // The next frame's id.
    void set_next_id(uint64_t id) { next_id_ = id; }

    // A frame from elsewhere, as it is. False when nobody wants it.
    bool send(uint64_t id, uint64_t time_ns, const std::vector<uint16_t>& samples);

    // What becomes of a frame's packets on the way: they may be taken out, doubled and swapped. Resent ones come through.
    std::function<void(std::vector<Packet>&)> on_the_way;

    // The camera's time, which goes on; each exposure has one of its own.
    uint64_t now_ns() const;
    bool is_acquiring() const { return is_acquiring_; }
    void end_acquisition() { is_acquiring_ = false; }

    // What it answers no more, as if it were unplugged. Only once.
    void unplug();

    // What it is set to, by the feature's register.
    uint32_t word(uint32_t address) const;
    double number(uint32_t address) const;
    std::string pixel_format() const { return pixel_code(word(reg_pixel_format)).name; }

    // The sample that an exposure has at a pixel: every bit of it moves.
    static uint16_t sample(uint64_t id, size_t pixel, int bits) {
        return uint16_t((pixel * 2654435761u + id * 40503u) >> 7 & ((1u << bits) - 1));
    }

    std::atomic<uint64_t> resend_requests = 0, packets_sent = 0;

  private:
    void serve();
    void answer(const uint8_t* command, size_t size, const sockaddr_in& from, int socket);
    bool write_word(uint32_t address, uint32_t value, const sockaddr_in& from);
    void resend(const uint8_t* command, bool extended);
    void fire_test_packet();
    void put_word(uint32_t address, uint64_t value, int bytes = 4);
    void put_text(uint32_t address, const std::string& text);
    void update_payload();
    uint64_t ticks_of(uint64_t ns) const;
    uint64_t next_ns();
    void send_payload(uint64_t id, uint64_t time_ns, std::vector<uint8_t> payload);
    void send_packet(const Packet& packet);
    uint32_t packet_bytes() const { return word(0x0d04) & 0xffff; }

    const GigeOptions options_;
    mutable std::recursive_mutex mutex_;
    std::vector<uint8_t> memory_;
    std::vector<int> control_;  // sockets: this address, and broadcasts
    int stream_ = -1;
    int wake_[2] = {-1, -1};
    std::thread thread_;
    std::atomic<bool> is_acquiring_ = false, is_unplugged_ = false;
    std::atomic<uint64_t> next_id_ = 1;
    uint64_t last_ns_ = 0;
    uint32_t controller_ = 0;  // address and port of who controls it
    uint16_t controller_port_ = 0;
    std::deque<std::pair<uint64_t, std::vector<Packet>>> sent_;  // to be sent again
};

}  // namespace ols::test

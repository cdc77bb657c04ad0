// SPDX-License-Identifier: MIT
// Registers, commands and exposures. Numbers of registers and commands are those of the standard 2.0, tables "bootstrap registers" and
// "GVCP command and acknowledge values".
#include "gige_device.hpp"

#include <arpa/inet.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

#include <bit>
#include <chrono>
#include <cstring>
#include <stdexcept>

namespace ols::test {

namespace {

constexpr uint16_t gvcp_port = 3956;
constexpr size_t memory_bytes = 0x80000;
constexpr uint32_t description_at = 0x20000;
constexpr size_t frames_kept = 16, discovery_bytes = 0xf8;
constexpr uint32_t fires_test_packet = 1u << 31;

enum Command : uint16_t {
    discovery = 0x0002,
    packet_resend = 0x0040,
    read_register = 0x0080,
    write_register = 0x0082,
    read_memory = 0x0084,
    write_memory = 0x0086,
};
enum Register : uint32_t {
    version = 0x0000,
    device_mode = 0x0004,
    mac_high = 0x0008,
    current_address = 0x0024,
    manufacturer = 0x0048,
    model = 0x0068,
    device_version = 0x0088,
    serial_number = 0x00d8,
    first_url = 0x0200,
    interface_count = 0x0600,
    stream_count = 0x0904,
    capability = 0x0934,
    heartbeat_ms = 0x0938,
    tick_frequency = 0x093c,
    timestamp_control = 0x0944,
    timestamp_value = 0x0948,
    privilege = 0x0a00,
    stream_port = 0x0d00,
    stream_packet_size = 0x0d04,
    stream_address = 0x0d18,
};
constexpr uint16_t status_invalid_parameter = 0x8002, status_access_denied = 0x8006;

int bound_socket(const std::string& address, uint16_t port, bool is_shared) {
    const int fd = socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0);
    const int yes = 1;
    if (is_shared) setsockopt(fd, SOL_SOCKET, SO_REUSEADDR, &yes, sizeof yes);
    sockaddr_in where{};
    where.sin_family = AF_INET;
    where.sin_port = htons(port);
    inet_pton(AF_INET, address.c_str(), &where.sin_addr);
    if (bind(fd, reinterpret_cast<sockaddr*>(&where), sizeof where) == 0) return fd;
    close(fd);
    return -1;
}

}  // namespace

GigeDevice::GigeDevice(GigeOptions options) : options_(std::move(options)), memory_(memory_bytes) {
    in_addr address{};
    inet_pton(AF_INET, options_.address.c_str(), &address);
    put_word(version, 0x00020000);
    put_word(device_mode, 0x80000001);  // big-endian, UTF-8
    put_word(mac_high, 0x0200, 4);      // a locally administered one, different for each address
    put_word(mac_high + 4, ntohl(address.s_addr));
    put_word(current_address, ntohl(address.s_addr));
    put_text(manufacturer, "OLS");
    put_text(model, "Line");
    put_text(device_version, "1");
    put_text(serial_number, options_.serial);
    const std::string xml = device_description(options_.description);
    put_text(description_at, xml);
    char url[128];
    snprintf(url, sizeof url, "Local:line.xml;%x;%zx", description_at, xml.size());
    put_text(first_url, url);
    put_word(interface_count, 1);
    put_word(stream_count, 1);
    put_word(capability,
             1u << 1 | (options_.resends ? 1u << 2 : 0) | 1u << 30);  // WRITEMEM, PACKETRESEND, serial number
    put_word(heartbeat_ms, 30'000);
    put_word(tick_frequency, options_.ticks_hz, 8);
    put_word(stream_packet_size, 1500);
    put_word(reg_width_max, uint32_t(options_.width_max));
    put_word(reg_height_max, uint32_t(options_.height_max));
    put_word(reg_width, 64), put_word(reg_height, 48);
    const auto& formats = options_.description.pixel_formats;
    put_word(reg_pixel_format, pixel_code(formats.empty() ? "Mono8" : *formats.begin()).code);
    put_word(reg_trigger_mode + 4, 1);  // AcquisitionStart: a user left it on
    put_word(reg_exposure_auto, 1);
    put_word(reg_trigger_source, 1);
    put_word(reg_black_level, uint32_t(options_.black_level));
    update_payload();

    stream_ = bound_socket(options_.address, 0, false);
    control_ = {bound_socket(options_.address, gvcp_port, false)};
    if (control_[0] < 0) throw std::runtime_error("port 3956 of " + options_.address + " is taken");
    for (const char* broadcast : {"255.255.255.255", "127.255.255.255"})
        if (const int fd = bound_socket(broadcast, gvcp_port, true); fd >= 0) control_.push_back(fd);
    if (pipe(wake_) != 0) throw std::runtime_error("no pipe");
    thread_ = std::thread([this] { serve(); });
}

GigeDevice::~GigeDevice() {
    unplug();
    for (const int fd : {stream_, wake_[0], wake_[1]}) close(fd);
}

void GigeDevice::unplug() {
    if (is_unplugged_.exchange(true)) return;
    (void)!write(wake_[1], "", 1);
    thread_.join();
    for (const int fd : control_) close(fd);
}

uint64_t GigeDevice::now_ns() const {
    if (options_.clock_ns) return options_.clock_ns();
    const auto now = std::chrono::steady_clock::now().time_since_epoch();
    return uint64_t(std::chrono::duration_cast<std::chrono::nanoseconds>(now).count()) + 7'000'000'000;
}

uint64_t GigeDevice::ticks_of(uint64_t ns) const {
    constexpr uint64_t second_ns = 1'000'000'000;
    return ns / second_ns * options_.ticks_hz + ns % second_ns * options_.ticks_hz / second_ns;
}

uint64_t GigeDevice::next_ns() {
    const std::lock_guard lock(mutex_);
    return last_ns_ = std::max(now_ns(), last_ns_ + 1'000'000'000 / options_.ticks_hz);
}

uint32_t GigeDevice::word(uint32_t address) const {
    const std::lock_guard lock(mutex_);
    return uint32_t(get(&memory_[address], 4));
}

double GigeDevice::number(uint32_t address) const {
    const std::lock_guard lock(mutex_);
    return std::bit_cast<double>(get(&memory_[address], 8));
}

void GigeDevice::put_word(uint32_t address, uint64_t value, int bytes) {
    Packet word;
    put(word, value, bytes);
    std::copy(word.begin(), word.end(), memory_.begin() + address);
}

void GigeDevice::put_text(uint32_t address, const std::string& text) {
    std::copy(text.begin(), text.end(), memory_.begin() + address);
}

void GigeDevice::update_payload() {
    const uint32_t pixel_bits = word(reg_pixel_format) >> 16 & 0xff;
    const uint32_t image = (word(reg_width) * word(reg_height) * pixel_bits + 7) / 8;
    put_word(reg_payload_size, image + (word(reg_chunk_mode) && word(reg_chunk_enable) ? 8 + 8 + 8 : 0));
    put_word(reg_acquisition_status, is_acquiring_);
}

void GigeDevice::serve() {
    std::vector<pollfd> waits;
    for (const int fd : control_) waits.push_back({fd, POLLIN, 0});
    waits.push_back({wake_[0], POLLIN, 0});
    std::vector<uint8_t> packet(0x10000);
    while (!is_unplugged_) {
        if (poll(waits.data(), waits.size(), -1) < 0) continue;
        for (const pollfd& wait : waits) {
            if (!(wait.revents & POLLIN) || wait.fd == wake_[0]) continue;
            sockaddr_in from{};
            socklen_t size = sizeof from;
            const ssize_t bytes =
                recvfrom(wait.fd, packet.data(), packet.size(), 0, reinterpret_cast<sockaddr*>(&from), &size);
            if (bytes >= 8 && packet[0] == 0x42) answer(packet.data(), size_t(bytes), from, control_[0]);
        }
    }
}

// Header: key 0x42, flags, command, length, request id.
void GigeDevice::answer(const uint8_t* command, size_t size, const sockaddr_in& from, int socket) {
    const std::lock_guard lock(mutex_);
    const auto code = uint16_t(get(command + 2, 2));
    const uint8_t* body = command + 8;
    const uint32_t address = size >= 12 ? uint32_t(get(body, 4)) : 0;
    uint16_t status = 0;
    Packet data;
    if (code == packet_resend) {
        if (size >= 20) resend(command, command[1] & 0x10);
        return;
    }
    update_payload();
    if (code == discovery) {
        data.assign(memory_.begin(), memory_.begin() + discovery_bytes);
    } else if (address >= memory_.size() - 0x400) {
        status = status_invalid_parameter;
    } else if (code == read_register) {
        put(data, get(&memory_[address], 4), 4);
    } else if (code == read_memory) {
        const auto count = uint32_t(get(body + 6, 2));
        data.assign(body, body + 4);
        data.insert(data.end(), memory_.begin() + address, memory_.begin() + address + count);
    } else if (code == write_register || code == write_memory) {
        const size_t bytes = size - 12;
        for (size_t n = 0; n + 4 <= bytes && status == 0; n += 4)
            if (!write_word(address + uint32_t(n), uint32_t(get(body + 4 + n, 4)), from)) status = status_access_denied;
        put(data, bytes, 4);
    } else {
        status = 0x8001;  // not implemented
    }
    Packet reply;
    put(reply, status, 2);
    put(reply, uint64_t(code) + 1, 2);
    put(reply, data.size(), 2);
    put(reply, get(command + 6, 2), 2);
    reply.insert(reply.end(), data.begin(), data.end());
    (void)!sendto(socket, reply.data(), reply.size(), 0, reinterpret_cast<const sockaddr*>(&from), sizeof from);
}

// Only whoever has the privilege may write; it is there for the taking when nobody has it.
bool GigeDevice::write_word(uint32_t address, uint32_t value, const sockaddr_in& from) {
    const bool is_controller = controller_ == from.sin_addr.s_addr && controller_port_ == from.sin_port;
    if (controller_port_ != 0 && !is_controller) return false;
    switch (address) {
        case privilege:
            controller_ = value ? from.sin_addr.s_addr : 0;
            controller_port_ = value ? from.sin_port : 0;
            if (value == 0) is_acquiring_ = false;
            break;
        case timestamp_control:
            if (value & 2) put_word(timestamp_value, ticks_of(now_ns()), 8);
            return true;
        case reg_timestamp_latch: put_word(reg_latched_time, now_ns(), 8); return true;
        case reg_acquisition_start:
            next_id_ = 1;
            is_acquiring_ = true;
            return true;
        case reg_acquisition_stop: is_acquiring_ = false; return true;
        case reg_width:
            if (int(value) > options_.width_max || value % uint32_t(options_.description.width_step))
                return true;  // keeps its own
            break;
        case stream_packet_size:
            if (value & fires_test_packet) {
                put_word(address, value & ~fires_test_packet);
                fire_test_packet();
                return true;
            }
            break;
    }
    put_word(address, value);
    return true;
}

void GigeDevice::fire_test_packet() {
    send_packet(Packet(packet_bytes() - ip_udp_bytes));
}

void GigeDevice::send_packet(const Packet& packet) {
    sockaddr_in to{};
    to.sin_family = AF_INET;
    to.sin_port = htons(uint16_t(word(stream_port)));
    to.sin_addr.s_addr = htonl(word(stream_address));
    if (to.sin_port == 0) return;
    (void)!sendto(stream_, packet.data(), packet.size(), 0, reinterpret_cast<const sockaddr*>(&to), sizeof to);
    ++packets_sent;
}

// PACKETRESEND: channel, block id, first and last packet; with extended ids the block id follows in 64 bits.
void GigeDevice::resend(const uint8_t* command, bool extended) {
    ++resend_requests;
    const uint8_t* body = command + 8;
    const uint64_t id = extended ? get(body + 12, 8) : get(body + 2, 2);
    const uint64_t first = get(body + 4, 4) & 0xffffff, last = get(body + 8, 4) & 0xffffff;
    for (const auto& [sent_id, packets] : sent_)
        for (uint64_t n = first; sent_id == id && n <= last && n < packets.size(); ++n) send_packet(packets[n]);
}

bool GigeDevice::trigger(const std::string& line) {
    const std::lock_guard lock(mutex_);
    const uint64_t time_ns = next_ns();
    const bool is_its = line == (word(reg_trigger_source) == 1 ? "Line1" : "Line2");
    const bool is_on =
        word(reg_trigger_mode) == 1 && word(reg_trigger_mode + 4) == 0 && word(reg_trigger_mode + 8) == 0;
    if (!is_acquiring_ || !is_its || !is_on) return false;
    const uint64_t id = next_id_++;
    const PixelCode& format = pixel_code(word(reg_pixel_format));
    std::vector<uint16_t> samples(size_t(word(reg_width)) * word(reg_height));
    for (size_t n = 0; n < samples.size(); ++n) samples[n] = sample(id, n, format.bits);
    send_payload(id, time_ns, packed(samples, format));
    return true;
}

bool GigeDevice::send(uint64_t id, uint64_t time_ns, const std::vector<uint16_t>& samples) {
    const std::lock_guard lock(mutex_);
    if (!is_acquiring_) return false;
    send_payload(id, time_ns, packed(samples, pixel_code(word(reg_pixel_format))));
    return true;
}

void GigeDevice::send_payload(uint64_t id, uint64_t time_ns, std::vector<uint8_t> payload) {
    if (next_id_ == 65536 && !options_.extended_ids) next_id_ = 1;  // 16 bits, and 0 is skipped
    GvspImage image;
    image.block_id = id;
    image.ticks = ticks_of(time_ns);
    image.pixel_code = word(reg_pixel_format);
    image.width = word(reg_width), image.height = word(reg_height);
    image.offset_x = word(reg_offset_x), image.offset_y = word(reg_offset_y);
    image.has_chunks = word(reg_chunk_mode) && word(reg_chunk_enable);
    if (image.has_chunks) {
        // Each chunk's data before its id and length. The leader's time is that of readout, a millisecond later.
        const size_t image_bytes = payload.size();
        put(payload, chunk_image_id, 4), put(payload, image_bytes, 4);
        put(payload, image.ticks, 8), put(payload, chunk_time_id, 4), put(payload, 8, 4);
        image.ticks += options_.ticks_hz / 1000;
    }
    auto packets = gvsp_packets(image, payload, packet_bytes(), options_.extended_ids);
    sent_.emplace_back(id, packets);
    if (sent_.size() > frames_kept) sent_.pop_front();
    if (on_the_way) on_the_way(packets);
    for (const Packet& packet : packets) send_packet(packet);
}

}  // namespace ols::test

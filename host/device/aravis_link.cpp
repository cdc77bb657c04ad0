// SPDX-License-Identifier: MIT
// Finding, opening and asking a camera. GigE Vision registers by the standard 2.0, chapter "Bootstrap registers".
#include "device/aravis_link.hpp"

#include <arpa/inet.h>
#include <fmt/format.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>

#include "device/aravis_camera.hpp"
#include "device/library_thread.hpp"
#include "device/usb_cameras.hpp"
#include "steady_clock.hpp"

namespace ols {

namespace {

// Buffers: a fifth of a second and more of small frames, and never more memory than this.
constexpr size_t buffers_bytes = size_t(256) << 20;
constexpr size_t buffers_min = 16, buffers_max = Camera::buffers_max;
// Packets of a frame that may be asked for again, by how many it has. Most of the first frame may be lost: the library enlarges its
// socket when that one's first packet has come.
constexpr double asked_again = 1;
constexpr uint64_t no_frame = UINT64_MAX;  // the id of a buffer that has none

constexpr uint32_t timestamp_control = 0x0944, timestamp_latch = 2, timestamp_high = 0x0948, timestamp_low = 0x094c;
constexpr uint32_t control_privilege = 0x0a00;

std::vector<AravisListing> list_cameras() {
    arv_update_device_list();
    std::vector<AravisListing> found;
    const auto text = [](const char* words) { return std::string(words ? words : ""); };
    for (unsigned n = 0; n < arv_get_n_devices(); ++n)
        found.push_back({text(arv_get_device_id(n)), text(arv_get_device_vendor(n)), text(arv_get_device_model(n)),
                         text(arv_get_device_serial_nbr(n)), text(arv_get_device_address(n)),
                         text(arv_get_device_protocol(n))});
    return found;
}

// What to open for that name: an address, which may lie where nothing is listed, behind a router; or one of a list.
Result<std::string> choose_camera(const std::string& name) {
    in_addr address{};
    if (inet_pton(AF_INET, name.c_str(), &address) == 1) return name;
    const std::vector<AravisListing> found = list_cameras();
    std::string list;
    for (const AravisListing& camera : found)
        list +=
            fmt::format("{}aravis:{} ({} {})", list.empty() ? "" : ", ", camera.serial, camera.vendor, camera.model);
    if (name.empty()) {
        if (const auto problem = found.empty() ? forbidden_usb_camera() : std::nullopt) return fail(*problem);
        if (found.empty())
            return fail(
                "there is no GigE Vision or USB3 Vision camera: check its power and cable, for GigE that the computer "
                "has an "
                "address in its network and no firewall holds UDP back, for USB3 the udev rule (docs/cameras.md)");
        if (found.size() > 1) return fail("there are several cameras, say which: " + list);
        return found[0].id;
    }
    std::vector<std::string> ids;
    for (const AravisListing& camera : found)
        if (camera.serial == name || camera.id == name || camera.address == name) ids.push_back(camera.id);
    if (ids.size() > 1)
        return fail("there are several cameras of serial number " + name + ": give the whole id, " + ids[0]);
    return ids.empty() ? name : ids[0];
}

// What the kernel grants of `aravis_socket_bytes`: net.core.rmem_max bounds it.
int granted_socket_bytes() {
    const int probe = socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0);
    int granted = 0;
    socklen_t size = sizeof granted;
    setsockopt(probe, SOL_SOCKET, SO_RCVBUF, &aravis_socket_bytes, sizeof aravis_socket_bytes);
    getsockopt(probe, SOL_SOCKET, SO_RCVBUF, &granted, &size);
    close(probe);
    return granted / 2;  // the kernel counts its own share, too: socket(7)
}

void note_loss(ArvDevice*, std::atomic<bool>* is_lost) {
    *is_lost = true;
}

// As many as belong to frames of that size; says how many.
std::string give_buffers(AravisStream& stream, size_t frame_bytes, size_t buffer_bytes) {
    const size_t buffers = std::clamp(buffers_bytes / frame_bytes, buffers_min, buffers_max);
    for (size_t n = 0; n < buffers; ++n) stream.give_back(arv_buffer_new_allocate(buffer_bytes));
    return fmt::format("{} buffers of {} bytes", buffers, frame_bytes);
}

// Packets do not come by the packet socket on the loopback.
void choose_socket(ArvGvDevice* device) {
    GSocketAddress* address = arv_gv_device_get_device_address(device);
    if (G_IS_INET_SOCKET_ADDRESS(address) &&
        g_inet_address_get_is_loopback(g_inet_socket_address_get_address(G_INET_SOCKET_ADDRESS(address))))
        arv_gv_device_set_stream_options(device, ARV_GV_STREAM_OPTION_PACKET_SOCKET_DISABLED);
}

}  // namespace

std::vector<AravisListing> list_aravis_cameras() {
    LibraryThread calls;
    return calls.run(list_cameras, Camera::device_patience_ms).value_or(std::vector<AravisListing>());
}

uint64_t ticks_to_ns(uint64_t ticks, uint64_t ticks_hz) {
    constexpr uint64_t second_ns = 1'000'000'000;
    return ticks / ticks_hz * second_ns + ticks % ticks_hz * second_ns / ticks_hz;
}

ArvBuffer* AravisStream::take(int timeout_ms) {
    return timeout_ms > 0 ? arv_stream_timeout_pop_buffer(stream_.get(), uint64_t(timeout_ms) * 1000)
                          : arv_stream_try_pop_buffer(stream_.get());
}

void AravisStream::give_back(ArvBuffer* buffer) {
    arv_buffer_set_frame_id(buffer, no_frame);
    arv_stream_push_buffer(stream_.get(), buffer);
}

bool AravisStream::is_filled(ArvBuffer* buffer) {
    return arv_buffer_get_frame_id(buffer) != no_frame;
}

bool AravisStream::is_disowned(ArvBuffer* buffer) const {
    const auto* const data = static_cast<const uint8_t*>(arv_buffer_get_data(buffer, nullptr));
    return trailer_at_ > 0 && usb_trailer_complains(data + trailer_at_, arv_buffer_get_frame_id(buffer));
}

bool AravisStream::has_waiting() const {
    int empty = 0, full = 0;
    arv_stream_get_n_buffers(stream_.get(), &empty, &full);
    return full > 0;
}

size_t AravisStream::free_buffers() const {
    int empty = 0, full = 0;
    arv_stream_get_n_buffers(stream_.get(), &empty, &full);
    return size_t(std::max(empty, 0));
}

uint64_t AravisStream::unplaced() const {
    uint64_t completed = 0, failures = 0, underruns = 0;
    arv_stream_get_statistics(stream_.get(), &completed, &failures, &underruns);
    return underruns;
}

uint64_t AravisStream::resent_packets() const {
    return ARV_IS_GV_STREAM(stream_.get()) ? arv_stream_get_info_uint64_by_name(stream_.get(), "n_resent_packets") : 0;
}

Result<std::shared_ptr<AravisLink>> AravisLink::open(const std::string& name) {
    const auto id = choose_camera(name);
    if (!id.ok()) return id.error();
    LibraryError error;
    ObjectPointer<ArvDevice> device(arv_open_device(id->c_str(), error.out()));
    const bool is_in_use =
        device ? ARV_IS_GV_DEVICE(device.get()) && !arv_gv_device_is_controller(ARV_GV_DEVICE(device.get()))
               : error.message().ends_with("LIBUSB_ERROR_BUSY");
    if (is_in_use)
        return fail("the camera aravis:" + name +
                    " is in use: another program controls it; end that one, or wait some seconds for the camera to let "
                    "go of one "
                    "that crashed");
    if (!device) {
        const auto problem = forbidden_usb_camera();
        return fail(
            fmt::format("the camera aravis:{} cannot be opened: {}; check its power and cable; `arv-tool-0.8` lists "
                        "those there are{}",
                        name, error ? error.message() : "there is none of that serial number, id or address",
                        problem ? "; " + *problem : ""));
    }
    return std::shared_ptr<AravisLink>(new AravisLink(std::move(device)));
}

AravisLink::AravisLink(ObjectPointer<ArvDevice> device) : device_(std::move(device)) {
    arv_device_set_range_check_policy(device_.get(), ARV_RANGE_CHECK_POLICY_ENABLE);
    AravisFeatures features(device_.get());
    for (const char* part : {"DeviceVendorName", "DeviceModelName"}) name_ += features.text(part).value_or("") + " ";
    if (const char* serial = features.first_of({"DeviceSerialNumber", "DeviceID"}))
        name_ += features.text(serial).value_or("");
    lost_signal_ = g_signal_connect(device_.get(), "control-lost", G_CALLBACK(note_loss), &is_lost_);
    if (!is_gige()) return;
    LibraryError error;
    const uint64_t hz = arv_gv_device_get_timestamp_tick_frequency(ARV_GV_DEVICE(device_.get()), error.out());
    if (!error && hz > 0) ticks_hz_ = hz;
    choose_socket(ARV_GV_DEVICE(device_.get()));
}

AravisLink::~AravisLink() {
    g_signal_handler_disconnect(device_.get(), lost_signal_);
}

Result<std::unique_ptr<AravisStream>> AravisLink::make_stream(std::string& chosen) {
    if (!is_gige()) return make_usb_stream(chosen);
    const auto payload = AravisFeatures(device_.get()).integer("PayloadSize");
    if (!payload || *payload <= 0) return fail(name_ + " does not say how large its frames are (PayloadSize)");
    LibraryError error;
    arv_gv_device_auto_packet_size(ARV_GV_DEVICE(device_.get()), error.out());
    ArvStream* made = arv_device_create_stream(device_.get(), nullptr, nullptr, error.out());
    if (!made) return fail(name_ + " gives no stream of frames: " + error.message());
    auto stream = std::make_unique<AravisStream>(ObjectPointer<ArvStream>(made));
    g_object_set(made, "socket-buffer", ARV_GV_STREAM_SOCKET_BUFFER_FIXED, "socket-buffer-size", aravis_socket_bytes,
                 "packet-request-ratio", asked_again, nullptr);
    ArvGvStreamPacketResend resend = ARV_GV_STREAM_PACKET_RESEND_NEVER;
    g_object_get(made, "packet-resend", &resend, nullptr);
    const std::string buffers = give_buffers(*stream, size_t(*payload), size_t(*payload));
    chosen = fmt::format("packets of {} bytes, {}, {}, socket buffer of {} KiB",
                         arv_gv_device_get_packet_size(ARV_GV_DEVICE(device_.get()), error.out()),
                         resend == ARV_GV_STREAM_PACKET_RESEND_ALWAYS ? "lost ones asked for again" : "lost ones lost",
                         buffers, granted_socket_bytes() / 1024);
    return stream;
}

// Aravis 0.8.26 (arvuvstream.c) divides by the size that the device requires, also by none; it believes a frame of that size, whatever
// the trailer says. It reads the trailer into what a buffer has left behind the payload; one that the payload's last transfer would
// fill has to have nothing left.
Result<std::unique_ptr<AravisStream>> AravisLink::make_usb_stream(std::string& chosen) {
    const auto before = usb_stream_registers(device_.get());
    if (!before || before->required_payload_bytes == 0)
        return fail(name_ + " does not say how large its frames are (SI required payload size)");
    LibraryError error;
    ObjectPointer<ArvStream> made(arv_device_create_stream(device_.get(), nullptr, nullptr, error.out()));
    if (!made) return fail(name_ + " gives no stream of frames: " + error.message());
    const auto set = usb_stream_registers(device_.get()).value_or(UsbStreamRegisters{});
    const size_t payload = before->required_payload_bytes, trailer = set.trailer_transfer_bytes;
    const bool sees_trailer =
        set.payload_transfer_bytes == payload && trailer >= usb_trailer_head_bytes && trailer <= payload;
    auto stream = std::make_unique<AravisStream>(std::move(made), sees_trailer ? payload : 0);
    chosen = give_buffers(*stream, payload, payload + (sees_trailer ? trailer : 0));
    return stream;
}

Status AravisLink::begin_acquisition() {
    AravisFeatures features(device_.get());
    if (features.execute("AcquisitionStart")) return Done{};
    return fail(name_ + " does not start: " +
                (features.broken().empty() ? "it has no command AcquisitionStart, or refuses it" : features.broken()));
}

void AravisLink::end_acquisition() {
    if (!is_lost_) AravisFeatures(device_.get()).execute("AcquisitionStop");
}

// Newer devices state nanoseconds, older ones ticks; of GigE Vision the registers are in every device that can.
std::optional<uint64_t> AravisLink::latched_ns() {
    AravisFeatures features(device_.get());
    if (features.execute("TimestampLatch"))
        if (const auto ns = features.integer("TimestampLatchValue")) return uint64_t(*ns);
    if (!is_gige() || !features.broken().empty()) return std::nullopt;
    LibraryError error;
    uint32_t high = 0, low = 0;
    if (!arv_device_write_register(device_.get(), timestamp_control, timestamp_latch, error.out()) ||
        !arv_device_read_register(device_.get(), timestamp_high, &high, error.out()) ||
        !arv_device_read_register(device_.get(), timestamp_low, &low, error.out()))
        return std::nullopt;
    return ticks_to_ns(uint64_t(high) << 32 | low, ticks_hz_);
}

std::optional<uint64_t> AravisLink::time_ns() {
    // Some devices take the command and latch nothing: their time stands still.
    const auto first = latched_ns();
    const auto second = first ? latched_ns() : std::nullopt;
    return second && *second > *first ? second : std::nullopt;
}

bool AravisLink::answers() {
    LibraryError error;
    uint32_t word = 0;
    return is_gige() ? arv_device_read_register(device_.get(), control_privilege, &word, error.out())
                     : arv_device_read_memory(device_.get(), 0, sizeof word, &word, error.out());
}

std::optional<bool> AravisLink::is_acquiring() {
    AravisFeatures features(device_.get());
    if (!features.set("AcquisitionStatusSelector", "AcquisitionActive")) return std::nullopt;
    return features.flag("AcquisitionStatus");
}

}  // namespace ols

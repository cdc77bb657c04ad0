// SPDX-License-Identifier: MIT
// Interfaces' classes by libusb; registers and trailers are little-endian.
#include "device/usb_cameras.hpp"

#include <fmt/format.h>
#include <libusb-1.0/libusb.h>

#include <cstring>
#include <memory>

#include "device/aravis_features.hpp"
#include "device/usb_device.hpp"

namespace ols {

namespace {

// USB3 Vision 1.0.1, "Control interface descriptor".
constexpr uint8_t interface_class = LIBUSB_CLASS_MISCELLANEOUS, interface_subclass = 0x05, control_protocol = 0x00;

bool is_camera(libusb_device* device) {
    libusb_config_descriptor* raw = nullptr;
    if (libusb_get_active_config_descriptor(device, &raw) != LIBUSB_SUCCESS) return false;
    const std::unique_ptr<libusb_config_descriptor, decltype(&libusb_free_config_descriptor)> config(
        raw, libusb_free_config_descriptor);
    for (int n = 0; n < config->bNumInterfaces; ++n) {
        if (config->interface[n].num_altsetting == 0) continue;
        const libusb_interface_descriptor& interface = config->interface[n].altsetting[0];
        if (interface.bInterfaceClass == interface_class && interface.bInterfaceSubClass == interface_subclass &&
            interface.bInterfaceProtocol == control_protocol)
            return true;
    }
    return false;
}

bool may_open(libusb_device* device) {
    libusb_device_handle* handle = nullptr;
    const int code = libusb_open(device, &handle);
    if (code == LIBUSB_SUCCESS) libusb_close(handle);
    return code != LIBUSB_ERROR_ACCESS;
}

template <typename Word>
bool read_register(ArvDevice* device, uint64_t address, Word& word) {
    LibraryError error;
    return arv_device_read_memory(device, address, sizeof word, &word, error.out());
}

}  // namespace

std::optional<std::string> forbidden_usb_camera() {
    libusb_context* raw = nullptr;
    if (libusb_init(&raw) != LIBUSB_SUCCESS) return std::nullopt;
    const std::unique_ptr<libusb_context, decltype(&libusb_exit)> context(raw, libusb_exit);
    libusb_device** all = nullptr;
    const ssize_t count = libusb_get_device_list(raw, &all);
    std::optional<std::string> problem;
    for (ssize_t n = 0; n < count && !problem; ++n)
        if (is_camera(all[n]) && !may_open(all[n]))
            problem = usb_permission_text(fmt::format("the USB3 Vision camera at bus {} address {}",
                                                      libusb_get_bus_number(all[n]), libusb_get_device_address(all[n])),
                                          has_udev_rule());
    if (count >= 0) libusb_free_device_list(all, 1);
    return problem;
}

std::optional<UsbStreamRegisters> usb_stream_registers(ArvDevice* device) {
    constexpr uint64_t sbrm_pointer = 0x1d8, sirm_pointer = 0x20;
    constexpr uint64_t required_payload = 0x08, payload_transfer = 0x1c, trailer_transfer = 0x2c;
    uint64_t sbrm = 0, sirm = 0;
    UsbStreamRegisters registers;
    if (!read_register(device, sbrm_pointer, sbrm) || !read_register(device, sbrm + sirm_pointer, sirm) ||
        !read_register(device, sirm + required_payload, registers.required_payload_bytes) ||
        !read_register(device, sirm + payload_transfer, registers.payload_transfer_bytes) ||
        !read_register(device, sirm + trailer_transfer, registers.trailer_transfer_bytes))
        return std::nullopt;
    return registers;
}

bool usb_trailer_complains(const uint8_t* trailer, uint64_t frame_id) {
    uint64_t id = 0;
    uint16_t status = 0;
    std::memcpy(&id, trailer + 8, sizeof id);
    std::memcpy(&status, trailer + 16, sizeof status);
    return std::memcmp(trailer, "U3VT", 4) == 0 && id == frame_id && status != 0;
}

}  // namespace ols

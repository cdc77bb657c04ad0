// SPDX-License-Identifier: MIT
// UsbBus and UsbDevice on libusb 1.0 (libusb.info, API reference 1.0.26).
#include <fmt/format.h>
#include <libusb-1.0/libusb.h>

#include <sys/time.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <optional>
#include <thread>

#include "device/usb_device.hpp"

namespace ols {

namespace {

using Context = std::shared_ptr<libusb_context>;
using Device = std::shared_ptr<libusb_device>;
using Handle = std::unique_ptr<libusb_device_handle, decltype(&libusb_close)>;

// Where a device's vendor-specific interface is.
struct Interface {
    uint8_t number = 0, out = 0, in = 0;
};

UsbOutcome outcome_of(int code) {
    switch (code) {
        case LIBUSB_SUCCESS: return UsbOutcome::done;
        case LIBUSB_ERROR_PIPE: return UsbOutcome::stalled;
        case LIBUSB_ERROR_TIMEOUT: return UsbOutcome::timed_out;
        case LIBUSB_ERROR_NO_DEVICE: return UsbOutcome::gone;
        default: return UsbOutcome::failed;
    }
}

std::string open_problem(int code, libusb_device* device) {
    const auto where = fmt::format("the USB device at bus {} address {}", libusb_get_bus_number(device),
                                   libusb_get_device_address(device));
    if (code == LIBUSB_ERROR_ACCESS) return usb_permission_text(where, has_udev_rule());
    if (code == LIBUSB_ERROR_BUSY) return fmt::format("{} is used by another program: end that one first", where);
    return fmt::format("cannot open {}: {}; plug it in again", where, libusb_strerror(libusb_error(code)));
}

std::string port_of(libusb_device* device) {
    uint8_t ports[7];  // USB 3.2 allows seven tiers
    const int depth = libusb_get_port_numbers(device, ports, sizeof ports);
    std::string path = fmt::format("{}-", libusb_get_bus_number(device));
    for (int n = 0; n < depth; n++) path += fmt::format("{}{}", n ? "." : "", ports[n]);
    return path;
}

std::string string_of(libusb_device_handle* handle, uint8_t index) {
    unsigned char text[128];
    const int bytes = index ? libusb_get_string_descriptor_ascii(handle, index, text, sizeof text) : 0;
    return bytes > 0 ? std::string(text, text + bytes) : std::string();
}

std::optional<Interface> interface_of(const libusb_interface_descriptor& descriptor) {
    if (descriptor.bInterfaceClass != LIBUSB_CLASS_VENDOR_SPEC) return {};
    Interface found{descriptor.bInterfaceNumber, 0, 0};
    for (int n = 0; n < descriptor.bNumEndpoints; n++) {
        const auto& endpoint = descriptor.endpoint[n];
        if ((endpoint.bmAttributes & LIBUSB_TRANSFER_TYPE_MASK) != LIBUSB_TRANSFER_TYPE_BULK) continue;
        const bool in = endpoint.bEndpointAddress & LIBUSB_ENDPOINT_IN;
        (in ? found.in : found.out) = endpoint.bEndpointAddress;
    }
    if (found.in == 0 || found.out == 0) return {};
    return found;
}

std::optional<Interface> find_interface(libusb_device* device) {
    libusb_config_descriptor* raw = nullptr;
    if (libusb_get_active_config_descriptor(device, &raw) != LIBUSB_SUCCESS) return {};
    const std::unique_ptr<libusb_config_descriptor, decltype(&libusb_free_config_descriptor)> config(
        raw, libusb_free_config_descriptor);
    for (int n = 0; n < config->bNumInterfaces; n++)
        if (config->interface[n].num_altsetting > 0)
            if (const auto found = interface_of(config->interface[n].altsetting[0])) return found;
    return {};
}

class LibusbDevice : public UsbDevice {
  public:
    LibusbDevice(Context context, Handle handle, Interface interface)
        : context_(std::move(context)), handle_(std::move(handle)), interface_(interface) {}
    ~LibusbDevice() override { libusb_release_interface(handle_.get(), interface_.number); }

    UsbResult control(uint8_t request_type, uint8_t request, std::span<uint8_t> data, uint32_t timeout_ms) override {
        const int code = libusb_control_transfer(handle_.get(), request_type, request, 0, interface_.number,
                                                 data.data(), uint16_t(data.size()), timeout_ms);
        if (code < 0) return {outcome_of(code), 0};
        return {UsbOutcome::done, size_t(code)};
    }
    UsbResult write(std::span<const uint8_t> bytes, uint32_t timeout_ms) override {
        return bulk(interface_.out, const_cast<uint8_t*>(bytes.data()), bytes.size(), timeout_ms);
    }
    UsbResult read(std::span<uint8_t> buffer, uint32_t timeout_ms) override {
        return bulk(interface_.in, buffer.data(), buffer.size(), timeout_ms);
    }
    UsbResult clear_stalls() override {
        for (const uint8_t endpoint : {interface_.out, interface_.in}) {
            const UsbOutcome outcome = outcome_of(libusb_clear_halt(handle_.get(), endpoint));
            if (outcome != UsbOutcome::done)
                return {outcome == UsbOutcome::failed && has_gone() ? UsbOutcome::gone : outcome, 0};
        }
        return {UsbOutcome::done, 0};
    }

  private:
    UsbResult bulk(uint8_t endpoint, uint8_t* bytes, size_t count, uint32_t timeout_ms) {
        int done = 0;
        const int code = libusb_bulk_transfer(handle_.get(), endpoint, bytes, int(count), &done, timeout_ms);
        if (outcome_of(code) == UsbOutcome::failed && has_gone()) return {UsbOutcome::gone, size_t(done)};
        return {outcome_of(code), size_t(done)};
    }

    // A transfer that a pulled cable cuts may fail before the kernel knows that the device has gone. GET_STATUS (USB 2.0 9.4.5)
    // is answered by every device that is there.
    bool has_gone() {
        constexpr int looks = 10, look_ms = 50;
        for (int n = 0; n < looks; ++n) {
            uint8_t status[2];
            const int code = libusb_control_transfer(handle_.get(), LIBUSB_ENDPOINT_IN, LIBUSB_REQUEST_GET_STATUS, 0, 0,
                                                     status, sizeof status, look_ms);
            if (code == LIBUSB_ERROR_NO_DEVICE) return true;
            if (code >= 0) return false;
            std::this_thread::sleep_for(std::chrono::milliseconds(look_ms));
        }
        return false;
    }

    Context context_;  // outlives the handle
    Handle handle_;
    Interface interface_;
};

class LibusbBus : public UsbBus {
  public:
    explicit LibusbBus(Context context) : context_(std::move(context)) {}
    ~LibusbBus() override {
        if (callback_) libusb_hotplug_deregister_callback(context_.get(), *callback_);
    }

    Result<std::vector<UsbListing>> list(uint16_t vendor, uint16_t product) override {
        const auto devices = find(vendor, product);
        if (!devices.ok()) return devices.error();
        std::vector<UsbListing> listings;
        for (const Device& device : *devices) listings.push_back(describe(device.get()));
        return listings;
    }

    Result<std::unique_ptr<UsbDevice>> open(const UsbListing& listing) override {
        const auto devices = find(listing.vendor, listing.product);
        if (!devices.ok()) return devices.error();
        const auto at = std::find_if(devices->begin(), devices->end(),
                                     [&](const Device& device) { return port_of(device.get()) == listing.port; });
        if (at == devices->end()) return fail("the board at USB port " + listing.port + " is gone: plug it in again");
        return open_device(at->get());
    }

    void pause_ms(uint32_t ms) override { std::this_thread::sleep_for(std::chrono::milliseconds(ms)); }

    void wait_for_change(uint32_t ms_at_most) override {
        if (!listen_for_changes()) return pause_ms(ms_at_most);
        const auto end = std::chrono::steady_clock::now() + std::chrono::milliseconds(ms_at_most);
        for (changed_ = 0; !changed_;) {
            const auto left =
                std::chrono::ceil<std::chrono::microseconds>(end - std::chrono::steady_clock::now()).count();
            if (left <= 0) return;
            timeval piece{time_t(left / 1'000'000), suseconds_t(left % 1'000'000)};
            if (libusb_handle_events_timeout_completed(context_.get(), &piece, &changed_) != LIBUSB_SUCCESS)
                return pause_ms(uint32_t(left / 1000 + 1));
        }
    }

  private:
    bool listen_for_changes() {
        if (callback_) return true;
        if (!libusb_has_capability(LIBUSB_CAP_HAS_HOTPLUG)) return false;
        const auto events =
            libusb_hotplug_event(LIBUSB_HOTPLUG_EVENT_DEVICE_ARRIVED | LIBUSB_HOTPLUG_EVENT_DEVICE_LEFT);
        constexpr int any = LIBUSB_HOTPLUG_MATCH_ANY;
        libusb_hotplug_callback_handle handle;
        if (libusb_hotplug_register_callback(context_.get(), events, libusb_hotplug_flag(0), any, any, any, on_change,
                                             this, &handle) != LIBUSB_SUCCESS)
            return false;
        callback_ = handle;
        return true;
    }

    static int LIBUSB_CALL on_change(libusb_context*, libusb_device*, libusb_hotplug_event, void* bus) {
        static_cast<LibusbBus*>(bus)->changed_ = 1;
        return 0;  // go on listening
    }

    Result<std::vector<Device>> find(uint16_t vendor, uint16_t product) {
        libusb_device** all = nullptr;
        const ssize_t count = libusb_get_device_list(context_.get(), &all);
        if (count < 0)
            return fail(fmt::format("cannot list the USB devices: {}", libusb_strerror(libusb_error(count))));
        std::vector<Device> found;
        for (ssize_t n = 0; n < count; n++) {
            libusb_device_descriptor descriptor;
            if (libusb_get_device_descriptor(all[n], &descriptor) != LIBUSB_SUCCESS) continue;
            if (descriptor.idVendor == vendor && descriptor.idProduct == product)
                found.emplace_back(libusb_ref_device(all[n]), libusb_unref_device);
        }
        libusb_free_device_list(all, 1);
        return found;
    }

    static UsbListing describe(libusb_device* device) {
        libusb_device_descriptor descriptor{};
        libusb_get_device_descriptor(device, &descriptor);
        UsbListing listing{port_of(device), descriptor.idVendor, descriptor.idProduct, {}, {}, {}};
        libusb_device_handle* raw = nullptr;
        if (const int code = libusb_open(device, &raw); code != LIBUSB_SUCCESS) {
            listing.problem = open_problem(code, device);
            return listing;
        }
        const Handle handle(raw, libusb_close);
        listing.product_name = string_of(raw, descriptor.iProduct);
        listing.serial = string_of(raw, descriptor.iSerialNumber);
        return listing;
    }

    Result<std::unique_ptr<UsbDevice>> open_device(libusb_device* device) {
        const auto interface = find_interface(device);
        if (!interface) return fail("the USB device at port " + port_of(device) + " has no board's interface");
        libusb_device_handle* raw = nullptr;
        if (const int code = libusb_open(device, &raw); code != LIBUSB_SUCCESS) return fail(open_problem(code, device));
        Handle handle(raw, libusb_close);
        if (const int code = libusb_claim_interface(raw, interface->number); code != LIBUSB_SUCCESS)
            return fail(open_problem(code, device));
        return std::unique_ptr<UsbDevice>(std::make_unique<LibusbDevice>(context_, std::move(handle), *interface));
    }

    Context context_;
    std::optional<libusb_hotplug_callback_handle> callback_;
    int changed_ = 0;
};

}  // namespace

// udev(7): where rules lie.
bool has_udev_rule() {
    for (const char* folder : {"/etc/udev/rules.d", "/run/udev/rules.d", "/usr/local/lib/udev/rules.d",
                               "/usr/lib/udev/rules.d", "/lib/udev/rules.d"})
        if (::access((std::string(folder) + "/60-open-light-stage.rules").c_str(), F_OK) == 0) return true;
    return false;
}

Result<std::unique_ptr<UsbBus>> open_usb_bus() {
    libusb_context* raw = nullptr;
    if (const int code = libusb_init(&raw); code != LIBUSB_SUCCESS)
        return fail(fmt::format("cannot use USB on this machine: {}", libusb_strerror(libusb_error(code))));
    return std::unique_ptr<UsbBus>(std::make_unique<LibusbBus>(Context(raw, libusb_exit)));
}

}  // namespace ols

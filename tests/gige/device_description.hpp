// SPDX-License-Identifier: MIT
// The GenICam description (GenApi 1.1 schema) of our cameras' features, and where their registers lie: GigeDevice's, and those of the
// USB3 Vision camera of the guest's tests.
#pragma once

#include <cstdint>
#include <set>
#include <string>

namespace ols::test {

// Registers of features; four bytes each, floats and times eight. Big-endian, as GigE Vision's are; on USB3 Vision a description may
// say so, too.
enum FeatureRegister : uint32_t {
    reg_width = 0x10000,
    reg_height = 0x10004,
    reg_offset_x = 0x10008,
    reg_offset_y = 0x1000c,
    reg_width_max = 0x10010,
    reg_height_max = 0x10014,
    reg_pixel_format = 0x10018,
    reg_payload_size = 0x1001c,
    reg_acquisition_mode = 0x10020,
    reg_acquisition_start = 0x10024,
    reg_acquisition_stop = 0x10028,
    reg_acquisition_status_selector = 0x1002c,
    reg_acquisition_status = 0x10030,
    reg_trigger_selector = 0x10034,
    reg_trigger_mode = 0x10040,  // of each selector, four bytes apart
    reg_trigger_source = 0x10050,
    reg_trigger_activation = 0x10054,
    reg_trigger_overlap = 0x10058,
    reg_exposure_mode = 0x1005c,
    reg_exposure_auto = 0x10060,
    reg_timestamp_latch = 0x10064,
    reg_chunk_mode = 0x10068,
    reg_chunk_selector = 0x1006c,
    reg_chunk_enable = 0x10070,
    reg_black_level = 0x10074,
    reg_trigger_delay = 0x10080,
    reg_exposure_time = 0x10088,
    reg_latched_time = 0x10090,
    reg_test_packet = 0x10098,
};
constexpr uint32_t chunk_time_id = 0x4001, chunk_image_id = 0x4000;  // of this device's chunks

struct DescriptionOptions {
    std::set<std::string> lacks;          // features that this model does not have
    std::set<std::string> pixel_formats;  // that it has; all when empty
    int width_step = 1, packet_size_max = 9000;
    bool is_usb = false;  // USB3 Vision's bootstrap registers, and nothing of GigE's transport
};
std::string device_description(const DescriptionOptions& options);

}  // namespace ols::test

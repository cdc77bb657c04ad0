// SPDX-License-Identifier: MIT
// What the rigs do for the conformance suite.
#include "aravis_rigs.hpp"

#include <fmt/format.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <chrono>
#include <filesystem>
#include <fstream>

namespace ols::test {

namespace {

std::unique_ptr<Camera> open_at(const std::string& address) {
    auto camera = open_camera("aravis:" + address);
    EXPECT_TRUE(camera.ok()) << (camera.ok() ? "" : camera.error().message);
    return camera.ok() ? std::move(*camera) : nullptr;
}

int count_rigs() {
    static int rigs = 0;
    return ++rigs;
}

}  // namespace

std::string rig_address() {
    return fmt::format("127.{}.{}.{}", 1 + getpid() / 254 % 254, 1 + getpid() % 254, count_rigs() % 250 + 2);
}

GigeRig::GigeRig(GigeOptions options) : address_(rig_address()) {
    options.address = address_;
    device_ = std::make_unique<GigeDevice>(std::move(options));
}

std::unique_ptr<Camera> GigeRig::open() {
    return open_at(address_);
}

CameraSetup GigeRig::fitting_setup() {
    CameraSetup setup;
    setup.width = 16, setup.height = 8;
    setup.trigger_source = "Line1";
    return setup;
}

void GigeRig::expose(int count) {
    for (int n = 0; n < count; ++n) device_->trigger();
}

ArvFakeRig::ArvFakeRig() {
    static int listening = 0;
    address_ = listening++ % 2 == 0 ? "127.0.0.1" : "127.0.0.2";
    ArvFakeCamera* stock = arv_fake_camera_new("stock");
    size_t size = 0;
    const char* xml = arv_fake_camera_get_genicam_xml(stock, &size);
    std::string description(xml, size);
    g_object_unref(stock);
    description.insert(
        description.rfind("</RegisterDescription>"),
        R"(<Enumeration Name="AcquisitionStatusSelector"><EnumEntry Name="AcquisitionActive"><Value>0</Value></EnumEntry>)"
        R"(<Value>0</Value></Enumeration><Boolean Name="AcquisitionStatus"><pValue>StatusReg</pValue></Boolean>)"
        R"(<IntReg Name="StatusReg"><Address>0x124</Address><Length>4</Length><AccessMode>RO</AccessMode>)"
        R"(<pPort>Device</pPort><Cachable>NoCache</Cachable><Sign>Unsigned</Sign>)"
        R"(<Endianess>BigEndian</Endianess></IntReg>)");
    description_ = std::filesystem::temp_directory_path() / fmt::format("fake{}_{}.xml", getpid(), listening);
    std::ofstream(description_) << description;
    fake_ = arv_gv_fake_camera_new_full(address_.c_str(), address_.c_str(), description_.c_str());
    registers_ = arv_gv_fake_camera_get_fake_camera(fake_);
    arv_fake_camera_set_fill_pattern(registers_, fill, this);
    arv_fake_camera_set_trigger_frequency(registers_, 1000);
}

ArvFakeRig::~ArvFakeRig() {
    if (fake_) g_object_unref(fake_);
    std::filesystem::remove(description_);
}

std::unique_ptr<Camera> ArvFakeRig::open() {
    return open_at(address_);
}

CameraSetup ArvFakeRig::fitting_setup() {
    CameraSetup setup;
    setup.width = 16, setup.height = 8, setup.bits = 8;
    setup.trigger_source = "Software";
    setup.exposure_mode = ExposureMode::timed;
    setup.exposure_us = 1000;
    return setup;
}

void ArvFakeRig::fill(ArvBuffer* buffer, void* rig, guint32, guint32, ArvPixelFormat) {
    auto& self = *static_cast<ArvFakeRig*>(rig);
    const std::lock_guard lock(self.mutex_);
    const auto now = std::chrono::steady_clock::now().time_since_epoch();
    arv_buffer_set_frame_id(buffer, self.next_id_++);
    arv_buffer_set_timestamp(buffer, uint64_t(std::chrono::duration_cast<std::chrono::nanoseconds>(now).count()));
    size_t size = 0;
    auto* samples = static_cast<uint8_t*>(const_cast<void*>(arv_buffer_get_data(buffer, &size)));
    for (size_t n = 0; n < size; ++n) samples[n] = uint8_t(n * 31 + self.next_id_);
    ++self.fills_;
    self.filled_.notify_all();
}

void ArvFakeRig::expose(int count) {
    for (int n = 0; n < count; ++n) {
        std::unique_lock lock(mutex_);
        if (arv_fake_camera_get_acquisition_status(registers_) == 0) {
            ++next_id_;
            continue;
        }
        const uint64_t awaited = fills_ + 1;
        arv_fake_camera_write_register(registers_, ARV_FAKE_CAMERA_REGISTER_TRIGGER_SOFTWARE, 1);
        // Unless it is told to stop meanwhile.
        while (fills_ < awaited && arv_fake_camera_get_acquisition_status(registers_) != 0)
            filled_.wait_for(lock, std::chrono::milliseconds(5));
        if (fills_ < awaited) arv_fake_camera_write_register(registers_, ARV_FAKE_CAMERA_REGISTER_TRIGGER_SOFTWARE, 0);
    }
}

void ArvFakeRig::lose_one() {
    const std::lock_guard lock(mutex_);
    ++next_id_;
}

void ArvFakeRig::end() {
    arv_fake_camera_write_register(registers_, ARV_FAKE_CAMERA_REGISTER_ACQUISITION, 0);
}

void ArvFakeRig::die() {
    g_object_unref(fake_);
    fake_ = nullptr;
}

}  // namespace ols::test

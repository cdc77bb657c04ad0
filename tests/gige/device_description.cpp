// SPDX-License-Identifier: MIT
// XML, a node a line.
#include "device_description.hpp"

#include <fmt/format.h>

#include <vector>

#include "pixel_code.hpp"

namespace ols::test {

namespace {

using Choices = std::vector<std::pair<std::string, uint32_t>>;

class Description {
  public:
    explicit Description(const DescriptionOptions& options) : options_(options) {}

    void integer(const std::string& name, uint32_t address, const std::string& limits, const char* access = "RW") {
        if (!declare(name)) return;
        nodes_ += fmt::format(R"(<Integer Name="{0}"><pValue>{0}Reg</pValue>{1}</Integer>)", name, limits);
        register_of(name, address, 4, access);
    }
    void time(const std::string& name, uint32_t address) {
        if (!declare(name)) return;
        nodes_ += fmt::format(R"(<Integer Name="{0}"><pValue>{0}Reg</pValue></Integer>)", name);
        register_of(name, address, 8, "RO");
    }
    void number(const std::string& name, uint32_t address, double most) {
        if (!declare(name)) return;
        nodes_ += fmt::format(
            R"(<Float Name="{0}"><pValue>{0}Reg</pValue><Min>0</Min><Max>{1}</Max><Unit>us</Unit></Float>)"
            R"(<FloatReg Name="{0}Reg"><Address>0x{2:x}</Address><Length>8</Length><AccessMode>RW</AccessMode>)"
            R"(<pPort>Device</pPort><Cachable>NoCache</Cachable><Endianess>BigEndian</Endianess></FloatReg>)",
            name, most, address);
    }
    void command(const std::string& name, uint32_t address) {
        if (!declare(name)) return;
        nodes_ +=
            fmt::format(R"(<Command Name="{0}"><pValue>{0}Reg</pValue><CommandValue>1</CommandValue></Command>)", name);
        register_of(name, address, 4, "WO");
    }
    void flag(const std::string& name, uint32_t address) {
        if (!declare(name)) return;
        nodes_ += fmt::format(R"(<Boolean Name="{0}"><pValue>{0}Reg</pValue></Boolean>)", name);
        register_of(name, address, 4, "RW");
    }
    void choice(const std::string& name, uint32_t address, const Choices& choices, const char* index = "") {
        if (!declare(name)) return;
        nodes_ += fmt::format(R"(<Enumeration Name="{}">)", name);
        for (const auto& [entry, value] : choices)
            if (!options_.lacks.contains(name + "=" + entry))
                nodes_ += fmt::format(R"(<EnumEntry Name="{}"><Value>{}</Value></EnumEntry>)", entry, value);
        nodes_ += fmt::format("<pValue>{}Reg</pValue></Enumeration>", name);
        register_of(name, address, 4, "RW", index);
    }
    void text(const std::string& name, uint32_t address, int length) {
        if (!declare(name)) return;
        nodes_ += fmt::format(
            R"(<StringReg Name="{}"><Address>0x{:x}</Address><Length>{}</Length><AccessMode>RO</AccessMode>)"
            R"(<pPort>Device</pPort></StringReg>)",
            name, address, length);
    }
    void chunk_time() {
        if (!declare("ChunkTimestamp")) return;
        nodes_ += fmt::format(
            R"(<IntReg Name="ChunkTimestamp"><Address>0</Address><Length>8</Length><AccessMode>RO</AccessMode>)"
            R"(<pPort>ChunkTimePort</pPort><Cachable>NoCache</Cachable><Sign>Unsigned</Sign>)"
            R"(<Endianess>BigEndian</Endianess></IntReg><Port Name="ChunkTimePort"><ChunkID>{:x}</ChunkID></Port>)",
            chunk_time_id);
    }

    std::string xml() const {
        return R"(<?xml version="1.0" encoding="utf-8"?><RegisterDescription ModelName="Line" VendorName="OLS" )"
               R"(StandardNameSpace="None" SchemaMajorVersion="1" SchemaMinorVersion="1" SchemaSubMinorVersion="0" )"
               R"(MajorVersion="1" MinorVersion="0" SubMinorVersion="0" ToolTip="" ProductGuid="0" VersionGuid="0" )"
               R"(xmlns="http://www.genicam.org/GenApi/Version_1_1"><Category Name="Root">)" +
               names_ + "</Category>" + nodes_ + R"(<Port Name="Device"/></RegisterDescription>)";
    }

  private:
    bool declare(const std::string& name) {
        if (options_.lacks.contains(name)) return false;
        names_ += "<pFeature>" + name + "</pFeature>";
        return true;
    }
    // `index` names the feature whose value counts registers of four bytes on from the address.
    void register_of(const std::string& name, uint32_t address, int length, const char* access,
                     const char* index = "") {
        const std::string offset = *index ? fmt::format(R"(<pIndex Offset="4">{}</pIndex>)", index) : "";
        nodes_ += fmt::format(
            R"(<IntReg Name="{}Reg"><Address>0x{:x}</Address>{}<Length>{}</Length><AccessMode>{}</AccessMode>)"
            R"(<pPort>Device</pPort><Cachable>NoCache</Cachable><Sign>Unsigned</Sign><Endianess>BigEndian</Endianess></IntReg>)",
            name, address, offset, length, access);
    }

    const DescriptionOptions& options_;
    std::string names_, nodes_;
};

}  // namespace

std::string device_description(const DescriptionOptions& options) {
    Description d(options);
    const std::string step = fmt::format("<Inc>{}</Inc>", options.width_step);
    // Bootstrap registers: GenCP 1.1, "Technology agnostic bootstrap register map"; GigE Vision 2.0.
    d.text("DeviceVendorName", options.is_usb ? 0x04 : 0x48, options.is_usb ? 64 : 32);
    d.text("DeviceModelName", options.is_usb ? 0x44 : 0x68, options.is_usb ? 64 : 32);
    d.text("DeviceSerialNumber", options.is_usb ? 0x144 : 0xd8, options.is_usb ? 64 : 16);
    d.integer("Width", reg_width, "<Min>8</Min><pMax>WidthMax</pMax>" + step);
    d.integer("Height", reg_height, "<Min>2</Min><pMax>HeightMax</pMax>");
    d.integer("OffsetX", reg_offset_x, "<Min>0</Min><pMax>WidthMax</pMax>" + step);
    d.integer("OffsetY", reg_offset_y, "<Min>0</Min><pMax>HeightMax</pMax>");
    d.integer("WidthMax", reg_width_max, "", "RO");
    d.integer("HeightMax", reg_height_max, "", "RO");
    Choices formats;
    for (const PixelCode& code : pixel_codes())
        if (options.pixel_formats.empty() || options.pixel_formats.contains(code.name))
            formats.emplace_back(code.name, code.code);
    d.choice("PixelFormat", reg_pixel_format, formats);
    d.integer("PayloadSize", reg_payload_size, "", "RO");
    d.choice("AcquisitionMode", reg_acquisition_mode, {{"SingleFrame", 1}, {"Continuous", 0}});
    d.command("AcquisitionStart", reg_acquisition_start);
    d.command("AcquisitionStop", reg_acquisition_stop);
    d.choice("AcquisitionStatusSelector", reg_acquisition_status_selector, {{"AcquisitionActive", 0}});
    d.flag("AcquisitionStatus", reg_acquisition_status);
    d.choice("TriggerSelector", reg_trigger_selector,
             {{"FrameStart", 0}, {"AcquisitionStart", 1}, {"FrameBurstStart", 2}});
    d.choice("TriggerMode", reg_trigger_mode, {{"Off", 0}, {"On", 1}}, "TriggerSelector");
    d.choice("TriggerSource", reg_trigger_source, {{"Software", 0}, {"Line1", 1}, {"Line2", 2}});
    d.choice("TriggerActivation", reg_trigger_activation, {{"RisingEdge", 0}, {"FallingEdge", 1}});
    d.choice("TriggerOverlap", reg_trigger_overlap, {{"Off", 0}, {"ReadOut", 1}});
    d.number("TriggerDelay", reg_trigger_delay, 1e6);
    d.choice("ExposureMode", reg_exposure_mode, {{"Timed", 0}, {"TriggerWidth", 1}});
    d.choice("ExposureAuto", reg_exposure_auto, {{"Off", 0}, {"Continuous", 1}});
    d.number("ExposureTime", reg_exposure_time, 1e6);
    d.integer("BlackLevel", reg_black_level, "<Min>0</Min><Max>4095</Max>");
    d.command("TimestampLatch", reg_timestamp_latch);
    d.time("TimestampLatchValue", reg_latched_time);
    d.flag("ChunkModeActive", reg_chunk_mode);
    d.choice("ChunkSelector", reg_chunk_selector, {{"Image", 0}, {"Timestamp", 1}});
    d.flag("ChunkEnable", reg_chunk_enable);
    d.chunk_time();
    if (options.is_usb) return d.xml();
    // Of the transport (GigE Vision 2.0, stream channel packet size register): that there is a test packet, and the limits.
    d.integer("GevSCPSPacketSize", 0x0d04,
              fmt::format("<Min>576</Min><Max>{}</Max><Inc>4</Inc>", options.packet_size_max));
    d.command("GevSCPSFireTestPacket", reg_test_packet);
    return d.xml();
}

}  // namespace ols::test

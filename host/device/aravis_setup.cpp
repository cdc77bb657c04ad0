// SPDX-License-Identifier: MIT
// Features in the order in which they depend on each other: format, region, trigger, exposure, what a take cannot have.
#include "device/aravis_setup.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <set>

#include "device/camera.hpp"

namespace ols {

namespace {

// A number that went through 32-bit floating point is the one that was meant.
constexpr double same_number = 1e-6;

bool is_same(double a, double b) {
    return std::abs(a - b) <= same_number * std::max(std::abs(a), std::abs(b));
}

// The way of one camera from what is wanted to what it has.
class SettingUp {
  public:
    SettingUp(AravisFeatures& camera, const CameraSetup& wanted) : camera_(camera), wanted_(wanted) {}

    Result<AravisSetup> run(const std::string& name) {
        camera_.execute("AcquisitionStop");  // many features are locked while it runs
        set_mode();
        for (const auto& [name, value] : wanted_.controls) camera_.set_words(name.c_str(), value);
        set_format();
        set_region();
        set_trigger();
        set_exposure();
        set_chunks();
        read_controls();
        if (!camera_.broken().empty()) return fail(name + " is gone: it gives no answer (" + camera_.broken() + ")");
        const Status as_wanted = check_setup(name, wanted_, setup_.in_force, lacks_);
        std::string message = as_wanted.ok() ? "" : as_wanted.error().message;
        if (!problems_.empty())
            message = fmt::format("{}; {}", message.empty() ? name + " cannot record a take" : message,
                                  fmt::join(problems_, "; "));
        if (!absent_.empty() && !message.empty())
            message += fmt::format(" (features that this model lacks: {})", fmt::join(absent_, ", "));
        if (!message.empty()) return fail(message);
        return setup_;
    }

  private:
    void set_mode() {
        // Automatic control changes exposures from frame to frame; a limit of the rate lets triggers go by.
        for (const char* name : {"ExposureAuto", "GainAuto", "BlackLevelAuto", "BalanceWhiteAuto"}) {
            if (!camera_.has(name)) continue;
            camera_.set(name, "Off");
            if (camera_.text(name) != "Off")
                problems_.push_back(fmt::format("its {} is {} and cannot be switched off", name,
                                                camera_.text(name).value_or("unknown")));
        }
        for (const char* name : {"AcquisitionFrameRateEnable", "AcquisitionFrameRateEnabled"})
            camera_.set_flag(name, false);
        if (camera_.has("AcquisitionMode")) {
            camera_.set("AcquisitionMode", "Continuous");
            if (camera_.text("AcquisitionMode") != "Continuous")
                problems_.push_back("its AcquisitionMode cannot be Continuous");
        }
    }

    // Of the formats that hold the samples, the one with the fewest bytes.
    void set_format() {
        const auto formats = camera_.choices("PixelFormat");
        std::string best;
        for (const std::string& format : formats) {
            const auto layout = sample_layout_of(format);
            if (!layout || layout->bits != wanted_.bits || layout->cfa != wanted_.cfa) continue;
            const auto bytes = [](const std::string& f) { return packed_row_bytes(*sample_layout_of(f), 120); };
            if (best.empty() || bytes(format) < bytes(best)) best = format;
        }
        if (!best.empty()) camera_.set("PixelFormat", best);
        setup_.pixel_format = camera_.text("PixelFormat").value_or("none");
        setup_.pixel_code = uint32_t(camera_.integer("PixelFormat").value_or(0));
        setup_.layout = sample_layout_of(setup_.pixel_format);
        setup_.in_force.bits = setup_.layout ? setup_.layout->bits : 0;
        setup_.in_force.cfa = setup_.layout ? setup_.layout->cfa : Cfa::none;
        if (best.empty())
            problems_.push_back(fmt::format("none of its pixel formats is of {} bits and that colour filter: {}",
                                            wanted_.bits, fmt::join(formats, ", ")));
        else if (setup_.pixel_format != best)
            problems_.push_back("its PixelFormat stays " + setup_.pixel_format);
    }

    // The region lies in the middle of the sensor. An even step keeps the order of the colour filter.
    int64_t set_extent(const char* size, const char* offset, const char* sensor, int wanted) {
        camera_.set_integer(offset, 0);
        camera_.set_integer(size, wanted);
        const int64_t taken = camera_.integer(size).value_or(0);
        if (taken != wanted) return taken;
        auto range = camera_.range(offset);
        if (!range) return taken;
        if (const auto full = camera_.integer(sensor)) range->most = std::min(range->most, *full - taken);
        const int64_t step = range->step % 2 == 0 ? range->step : 2 * range->step;
        camera_.set_integer(offset, std::max<int64_t>(range->most / 2 / step * step, 0));
        return taken;
    }
    void set_region() {
        setup_.in_force.width = int(set_extent("Width", "OffsetX", "WidthMax", wanted_.width));
        setup_.in_force.height = int(set_extent("Height", "OffsetY", "HeightMax", wanted_.height));
        setup_.offset_x = camera_.integer("OffsetX").value_or(0);
        setup_.offset_y = camera_.integer("OffsetY").value_or(0);
    }

    // One trigger, that of frames: another one that waits would hold them all back.
    void set_trigger() {
        const std::string frame_start = "FrameStart";
        const auto selectors = camera_.choices("TriggerSelector");
        for (const std::string& selector : selectors)
            if (selector != frame_start && camera_.set("TriggerSelector", selector)) camera_.set("TriggerMode", "Off");
        if (camera_.has("TriggerSelector")) {
            camera_.set("TriggerSelector", frame_start);
            if (camera_.text("TriggerSelector") != frame_start) {
                problems_.push_back(fmt::format("it has no trigger FrameStart, but {}", fmt::join(selectors, ", ")));
                return;
            }
        }
        if (!wanted_.trigger_source.empty()) set_source();
        set_activation();
        set_delay();
        // Readout of a frame while the next one is exposed.
        const auto overlaps = camera_.choices("TriggerOverlap");
        if (std::ranges::find(overlaps, "ReadOut") != overlaps.end()) camera_.set("TriggerOverlap", "ReadOut");
        camera_.set("TriggerMode", "On");
        if (camera_.text("TriggerMode") != "On") {
            problems_.push_back("its frames cannot be triggered");
            if (!camera_.has("TriggerMode")) absent_.push_back("TriggerMode");
        }
    }
    void set_source() {
        if (!camera_.has("TriggerSource")) return lack("trigger_source", "TriggerSource");
        camera_.set("TriggerSource", wanted_.trigger_source);
        setup_.in_force.trigger_source = camera_.text("TriggerSource").value_or("");
        if (setup_.in_force.trigger_source != wanted_.trigger_source)
            problems_.push_back(fmt::format("its inputs are {}", fmt::join(camera_.choices("TriggerSource"), ", ")));
    }
    void set_activation() {
        if (!camera_.has("TriggerActivation")) return lack("trigger_activation", "TriggerActivation");
        const bool is_rising = wanted_.trigger_activation == TriggerActivation::rising_edge;
        const std::string edge = is_rising ? "RisingEdge" : "FallingEdge";
        camera_.set("TriggerActivation", edge);
        const std::string taken = camera_.text("TriggerActivation").value_or("");
        setup_.in_force.trigger_activation =
            taken == "FallingEdge" ? TriggerActivation::falling_edge : TriggerActivation::rising_edge;
        if (taken != "FallingEdge" && taken != "RisingEdge") problems_.push_back("its TriggerActivation is " + taken);
    }
    void set_delay() {
        const char* name = camera_.first_of({"TriggerDelay", "TriggerDelayAbs"});
        if (!name) return lack("trigger_delay_us", "TriggerDelay");
        setup_.in_force.trigger_delay_us = set_microseconds(name, wanted_.trigger_delay_us);
    }

    // A camera without ExposureMode has its own timer.
    void set_exposure() {
        const bool is_timed = wanted_.exposure_mode == ExposureMode::timed;
        if (camera_.has("ExposureMode"))
            camera_.set("ExposureMode", is_timed ? "Timed" : "TriggerWidth");
        else
            absent_.push_back("ExposureMode");
        setup_.in_force.exposure_mode =
            camera_.text("ExposureMode") == "TriggerWidth" ? ExposureMode::trigger_width : ExposureMode::timed;
        if (!is_timed || setup_.in_force.exposure_mode != ExposureMode::timed) return;
        const char* name = camera_.first_of({"ExposureTime", "ExposureTimeAbs"});
        if (!name) return lack("exposure_us", "ExposureTime");
        setup_.in_force.exposure_us = set_microseconds(name, wanted_.exposure_us);
    }

    double set_microseconds(const char* name, double wanted_us) {
        camera_.set_number(name, wanted_us);
        const double taken_us = camera_.number(name).value_or(0);
        return is_same(taken_us, wanted_us) ? wanted_us : taken_us;
    }

    // The key is as it comes by default, and is refused if another value is wanted.
    void lack(const char* key, const char* feature) {
        lacks_.insert(key);
        absent_.push_back(feature);
        if (key == std::string("exposure_us")) setup_.in_force.exposure_us = -1;
    }

    // The time of this frame's exposure: what the time stamp of the transport means differs between makers, ChunkTimestamp is that of
    // FrameStart. The block id stays the frame's id: it counts what was sent, so that a trigger that the camera missed is a gap
    // in time, and a frame that the link lost one of ids.
    void set_chunks() {
        if (!camera_.has("ChunkModeActive")) return;
        const auto chunks = camera_.choices("ChunkSelector");
        const bool has_time = std::ranges::find(chunks, "Timestamp") != chunks.end();
        if (has_time && camera_.set_flag("ChunkModeActive", true) && camera_.set("ChunkSelector", "Timestamp") &&
            (camera_.set_flag("ChunkEnable", true) || camera_.flag("ChunkEnable") == true))
            setup_.has_chunk_time = camera_.flag("ChunkEnable").value_or(false);
        if (!setup_.has_chunk_time) camera_.set_flag("ChunkModeActive", false);
    }

    // Last, as what a take needs goes before them. A number is the same however it is written.
    void read_controls() {
        for (const auto& [name, value] : wanted_.controls) {
            const auto taken = camera_.words(name.c_str());
            if (!taken) continue;
            char *end = nullptr, *taken_end = nullptr;
            const double number = std::strtod(value.c_str(), &end);
            const double taken_number = std::strtod(taken->c_str(), &taken_end);
            const bool are_numbers = !value.empty() && !*end && !taken->empty() && !*taken_end;
            setup_.in_force.controls[name] = are_numbers && is_same(number, taken_number) ? value : *taken;
        }
    }

    AravisFeatures& camera_;
    const CameraSetup& wanted_;
    AravisSetup setup_;
    std::set<std::string> lacks_;
    std::vector<std::string> absent_, problems_;
};

}  // namespace

std::optional<SampleLayout> sample_layout_of(const std::string& pixel_format) {
    const std::pair<const char*, Cfa> filters[] = {{"Mono", Cfa::none},
                                                   {"BayerRG", Cfa::rggb},
                                                   {"BayerBG", Cfa::bggr},
                                                   {"BayerGR", Cfa::grbg},
                                                   {"BayerGB", Cfa::gbrg}};
    for (const auto& [name, cfa] : filters) {
        if (!pixel_format.starts_with(name)) continue;
        const std::string rest = pixel_format.substr(std::string(name).size());
        const std::string digits = rest.substr(0, rest.find_first_not_of("0123456789"));
        const std::string packing = rest.substr(digits.size());
        for (const int bits : {8, 10, 12, 14, 16}) {
            if (digits != std::to_string(bits)) continue;
            if (packing.empty())
                return SampleLayout{bits == 8 ? SamplePacking::bytes : SamplePacking::words, bits, cfa};
            if (packing == "p" && bits > 8 && bits < 16) return SampleLayout{SamplePacking::bits_low, bits, cfa};
            if (packing == "Packed" && (bits == 10 || bits == 12))
                return SampleLayout{SamplePacking::gige_pairs, bits, cfa};
        }
    }
    return std::nullopt;
}

Result<AravisSetup> set_up_camera(AravisFeatures& camera, const std::string& name, const CameraSetup& wanted) {
    return SettingUp(camera, wanted).run(name);
}

}  // namespace ols

// SPDX-License-Identifier: MIT
// Writing and reading of the part "motion" through OpenEXR.
#include "archive/motion_part.hpp"

#include <ImfChannelList.h>
#include <ImfFrameBuffer.h>
#include <ImfStringAttribute.h>
#include <fmt/format.h>
#include <half.h>

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>

#include "image/json_object.hpp"

namespace ols {

namespace {

constexpr const char* times_attribute = "timesSeconds";

std::string layer(size_t instant) {
    return fmt::format("instant_{:03}", instant);
}

Imf::Slice slice_of(Imf::PixelType type, const void* samples, const Imath::Box2i& window) {
    const size_t size = type == Imf::HALF ? sizeof(half) : sizeof(float);
    const int width = window.max.x + 1, height = window.max.y + 1;
    return Imf::Slice::Make(type, samples, Imath::V2i(0, 0), width, height, size, size * size_t(width));
}

}  // namespace

std::map<std::string, Imf::PixelType> motion_channels(size_t instants) {
    std::map<std::string, Imf::PixelType> channels;
    for (size_t i = 0; i < instants; ++i)
        for (const char* component : {".u", ".v"}) channels[layer(i) + component] = Imf::HALF;
    return channels;
}

void add_motion_layers(Imf::Header& header, const std::vector<double>& times_s) {
    header.insert(times_attribute, Imf::StringAttribute(nlohmann::json(times_s).dump()));
    for (const auto& [name, type] : motion_channels(times_s.size())) header.channels().insert(name, Imf::Channel(type));
}

Result<std::vector<double>> motion_times(const Imf::Header& header) {
    const auto* attribute = header.findTypedAttribute<Imf::StringAttribute>(times_attribute);
    const auto times = parse_json(attribute ? attribute->value() : "", "has times whose list");
    if (!times) return times.error();
    if (!times->is_array() || times->empty() ||
        !std::ranges::all_of(*times, [](const auto& time) { return time.is_number(); }))
        return fail("has times that are not a list of numbers");
    auto times_s = times->get<std::vector<double>>();
    if (const auto checked = check_motion_times(times_s); !checked)
        return fail("is damaged: " + checked.error().message);
    return times_s;
}

Status check_motion_range(const TargetMotion& motion) {
    const auto beyond = [](float value) { return std::abs(value) > float(HALF_MAX); };
    for (size_t i = 0; i < motion.flows.size(); ++i)
        for (const auto* component : {&motion.flows[i].u, &motion.flows[i].v})
            if (std::any_of(component->begin(), component->end(), beyond))
                return fail(
                    fmt::format("the flow to {:+.3f} ms leads farther than 65504 pixels", motion.times_s[i] * 1e3));
    return Done{};
}

void write_motion_tiles(Imf::TiledOutputPart part, const TargetMotion& motion) {
    const Imath::Box2i window = part.header().dataWindow();
    std::vector<std::vector<half>> planes;  // u, v of each instant
    for (const FlowField& flow : motion.flows)
        for (const auto* component : {&flow.u, &flow.v}) planes.emplace_back(component->begin(), component->end());
    Imf::FrameBuffer buffer;
    for (size_t i = 0; i < motion.flows.size(); ++i) {
        buffer.insert(layer(i) + ".u", slice_of(Imf::HALF, planes[2 * i].data(), window));
        buffer.insert(layer(i) + ".v", slice_of(Imf::HALF, planes[2 * i + 1].data(), window));
    }
    part.setFrameBuffer(buffer);
    part.writeTiles(0, part.numXTiles() - 1, 0, part.numYTiles() - 1);
}

std::vector<FlowField> read_motion_tiles(Imf::TiledInputPart part, size_t instants) {
    const Imath::Box2i window = part.header().dataWindow();
    std::vector<FlowField> flows(instants, FlowField(window.max.x + 1, window.max.y + 1));
    Imf::FrameBuffer buffer;
    for (size_t i = 0; i < instants; ++i) {
        buffer.insert(layer(i) + ".u", slice_of(Imf::FLOAT, flows[i].u.data(), window));
        buffer.insert(layer(i) + ".v", slice_of(Imf::FLOAT, flows[i].v.data(), window));
    }
    part.setFrameBuffer(buffer);
    part.readTiles(0, part.numXTiles() - 1, 0, part.numYTiles() - 1);
    return flows;
}

}  // namespace ols

// SPDX-License-Identifier: MIT
// The channels of the part "matte".
#include "archive/matte_part.hpp"

#include <ImfChannelList.h>
#include <ImfIntAttribute.h>

#include <algorithm>
#include <cmath>

namespace ols {

namespace {

constexpr const char* frames_attribute = "frames";
constexpr const char* variance_channel = "variance";
constexpr const char* color_channels[] = {"R", "G", "B"};

const char* plane_channel(size_t plane, size_t planes) {
    return planes == 1 ? "Y" : color_channels[plane];
}

Imf::Slice slice(const std::vector<float>& samples, int x, int y, int width, int height) {
    return Imf::Slice::Make(Imf::FLOAT, samples.data(), Imath::V2i(x, y), width, height, sizeof(float),
                            sizeof(float) * size_t(width));
}

bool is_finite(const std::vector<float>& samples) {
    return std::ranges::all_of(samples, [](float value) { return std::isfinite(value); });
}

}  // namespace

Status check_matte(const TargetMatte& matte, int planes, size_t pixels) {
    if (matte.frames == 0) return Done{};
    bool fits = int(matte.planes.size()) == planes && (matte.variance.empty() || matte.variance.size() == pixels);
    for (const auto& plane : matte.planes) fits = fits && plane.size() == pixels;
    if (!fits) return fail("its matte is not of the target's size");
    if (!is_finite(matte.variance) || !std::ranges::all_of(matte.planes, is_finite))
        return fail("its matte holds values that are not finite");
    return Done{};
}

void add_matte_channels(Imf::Header& header, const TargetMatte& matte) {
    header.insert(frames_attribute, Imf::IntAttribute(matte.frames));
    for (size_t plane = 0; plane < matte.planes.size(); ++plane)
        header.channels().insert(plane_channel(plane, matte.planes.size()), Imf::Channel(Imf::FLOAT));
    if (!matte.variance.empty()) header.channels().insert(variance_channel, Imf::Channel(Imf::FLOAT));
}

void write_matte_tiles(Imf::TiledOutputPart part, const TargetMatte& matte) {
    const Imath::Box2i window = part.header().dataWindow();
    const auto whole = [&](const std::vector<float>& samples) {
        return slice(samples, 0, 0, window.max.x + 1, window.max.y + 1);
    };
    Imf::FrameBuffer buffer;
    for (size_t plane = 0; plane < matte.planes.size(); ++plane)
        buffer.insert(plane_channel(plane, matte.planes.size()), whole(matte.planes[plane]));
    if (!matte.variance.empty()) buffer.insert(variance_channel, whole(matte.variance));
    part.setFrameBuffer(buffer);
    part.writeTiles(0, part.numXTiles() - 1, 0, part.numYTiles() - 1);
}

std::map<std::string, Imf::PixelType> matte_channels(int planes, bool has_variance) {
    std::map<std::string, Imf::PixelType> channels;
    for (size_t plane = 0; plane < size_t(planes); ++plane) channels[plane_channel(plane, size_t(planes))] = Imf::FLOAT;
    if (has_variance) channels[variance_channel] = Imf::FLOAT;
    return channels;
}

bool has_matte_variance(const Imf::Header& header) {
    return header.channels().findChannel(variance_channel) != nullptr;
}

Result<TargetMatte> matte_head(const Imf::Header& header, int planes) {
    TargetMatte matte;
    const auto* frames = header.findTypedAttribute<Imf::IntAttribute>(frames_attribute);
    if (!frames || frames->value() < 1) return fail("does not say how many frames it is of");
    matte.frames = frames->value();
    matte.planes.resize(size_t(planes));
    return matte;
}

Imf::FrameBuffer matte_buffer(TargetMatte& matte, const Imf::Header& header, int x, int y, int width, int height) {
    Imf::FrameBuffer buffer;
    const auto add = [&](const char* channel, std::vector<float>& samples) {
        samples.resize(size_t(width) * size_t(height));
        buffer.insert(channel, slice(samples, x, y, width, height));
    };
    for (size_t plane = 0; plane < matte.planes.size(); ++plane)
        add(plane_channel(plane, matte.planes.size()), matte.planes[plane]);
    if (has_matte_variance(header)) add(variance_channel, matte.variance);
    return buffer;
}

}  // namespace ols

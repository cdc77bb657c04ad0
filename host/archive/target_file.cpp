// SPDX-License-Identifier: MIT
// Writing of one target through OpenEXR's multi-part files.
#include "archive/target_file.hpp"

#include <ImfChannelList.h>
#include <ImfFrameBuffer.h>
#include <ImfFramesPerSecond.h>
#include <ImfIntAttribute.h>
#include <ImfMultiPartOutputFile.h>
#include <ImfPartType.h>
#include <ImfStandardAttributes.h>
#include <ImfStringAttribute.h>
#include <ImfTiledOutputPart.h>
#include <fmt/format.h>
#include <half.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <set>
#include <span>

#include "archive/exr_stream.hpp"
#include "archive/manifest.hpp"
#include "archive/matte_part.hpp"
#include "archive/motion_part.hpp"
#include "archive/target_layout.hpp"
#include "exceptions.hpp"
#include "image/demosaic.hpp"
#include "image/half_samples.hpp"
#include "image/json_object.hpp"

namespace ols {

namespace {

using namespace target_layout;

constexpr size_t block_bytes = 64 << 20;

void add_string(Imf::Header& header, const char* name, const std::string& text) {
    header.insert(name, Imf::StringAttribute(text));
}

void add_film_attributes(Imf::Header& header, const TakeInfo& info, uint32_t index) {
    Imf::addFramesPerSecond(header, Imf::guessExactFps(info.frame_rate_hz));
    // TimeCode counts to 30 frames a second (SMPTE 12M); what runs faster has its timecode in the provenance only.
    const auto start = timecode_frames(info.timecode_start, info.frame_rate_hz);
    if (start.ok() && std::lround(info.frame_rate_hz) <= 30) {
        const int64_t nominal = std::lround(info.frame_rate_hz), frames = *start + index, seconds = frames / nominal;
        Imf::addTimeCode(header, Imf::TimeCode(int(seconds / 3600 % 24), int(seconds / 60 % 60), int(seconds % 60),
                                               int(frames % nominal)));
    }
    add_string(header, "slateProduction", info.production);
    add_string(header, "slateScene", info.scene);
    add_string(header, "slateTake", info.take);
    Imf::addComments(header, info.notes);
}

Imf::Header part_header(const TakeInfo& info, const Target& head, const std::string& name) {
    Imf::Header header(head.width, head.height);
    header.setName(name);
    header.setType(Imf::TILEDIMAGE);
    header.setTileDescription(Imf::TileDescription(tile_size, tile_size, Imf::ONE_LEVEL));
    header.compression() = Imf::ZIPS_COMPRESSION;
    add_film_attributes(header, info, head.index);
    return header;
}

Imf::Header lamps_header(const TakeInfo& info, const Target& head) {
    Imf::Header header = part_header(info, head, lamps_part);
    if (info.compression == Compression::none) header.compression() = Imf::NO_COMPRESSION;
    header.insert(camera_attribute, Imf::IntAttribute(int(head.camera)));
    header.insert(index_attribute, Imf::IntAttribute(int(head.index)));
    add_string(header, color_attribute, info.color_interop_id);
    add_string(header, cfa_attribute, cfa_names[int(head.cfa)]);
    add_string(header, basis_attribute, info.basis);
    add_string(header, value_unit_attribute, info.value_unit);
    add_string(header, lights_attribute, lights_text(info));
    add_string(header, missing_attribute, json_line(head.missing_lamps));
    add_string(header, provenance_attribute, json_line(head.provenance));
    for (const auto& channel : plane_channels(int(info.lights.size()), head.cfa))
        header.channels().insert(channel, Imf::Channel(lamp_type(info)));
    return header;
}

Imf::Header data_header(const TakeInfo& info, const Target& head, const char* name) {
    Imf::Header header = part_header(info, head, name);
    add_string(header, color_attribute, "data");
    return header;
}

Imf::Header motion_header(const TakeInfo& info, const Target& head) {
    Imf::Header header = data_header(info, head, motion_part);
    add_motion_layers(header, head.motion.times_s);
    return header;
}

Imf::Header matte_header(const TakeInfo& info, const Target& head) {
    Imf::Header header = data_header(info, head, matte_part);
    add_matte_channels(header, head.matte);
    return header;
}

Imf::Header plane_header(const TakeInfo& info, const Target& head, const char* name, Imf::PixelType type) {
    Imf::Header header = data_header(info, head, name);
    header.channels().insert("Y", Imf::Channel(type));
    return header;
}

template <typename Stored>
constexpr float largest_of = sizeof(Stored) == sizeof(float) ? std::numeric_limits<float>::max() : float(HALF_MAX);

// Brings samples of a box that cannot be stored to the nearest that can, a NaN to 0, and marks their pixels.
void clamp_samples(std::span<float> samples, float largest, const Box& box, int width, std::vector<uint32_t>& mask) {
    for (size_t i = 0; i < samples.size(); ++i) {
        float& value = samples[i];
        if (std::abs(value) <= largest) continue;
        value = std::isnan(value) ? 0 : std::clamp(value, -largest, largest);
        mask[(size_t(box.y) + i / box.width) * width + box.x + i % box.width] |= mask_clamped;
    }
}

void store(std::span<const float> samples, half* stored) {
    to_halves(samples, stored);
}
void store(std::span<const float> samples, float* stored) {
    std::ranges::copy(samples, stored);
}

// Writes all lamp planes block by block and marks clamped samples in `mask`.
template <typename Stored>
Status write_lamps(Imf::TiledOutputPart part, const Target& head, const std::vector<std::string>& channels,
                   const PlaneSource& source, std::vector<uint32_t>& mask) {
    const size_t tile_bytes = channels.size() * tile_size * tile_size * sizeof(Stored);
    const int block_width = std::clamp(int(block_bytes / tile_bytes), 1, head.width / tile_size + 1) * tile_size;
    std::vector<float> plane(size_t(block_width) * tile_size);
    std::vector<Stored> block(plane.size() * channels.size());
    for (int y = 0; y < head.height; y += tile_size)
        for (int x = 0; x < head.width; x += block_width) {
            const Box box{x, y, std::min(block_width, head.width - x), std::min(tile_size, head.height - y)};
            Imf::FrameBuffer buffer;
            for (size_t c = 0; c < channels.size(); ++c) {
                if (const auto got = source(int(c), box, plane.data()); !got) return got.error();
                Stored* stored = block.data() + c * plane.size();
                const std::span<float> samples(plane.data(), size_t(box.width) * box.height);
                if (!all_within(samples, largest_of<Stored>))
                    clamp_samples(samples, largest_of<Stored>, box, head.width, mask);
                store(samples, stored);
                buffer.insert(channels[c], slice_at(sizeof(Stored) == 2 ? Imf::HALF : Imf::FLOAT, stored, box));
            }
            part.setFrameBuffer(buffer);
            part.writeTiles(x / tile_size, (x + box.width - 1) / tile_size, y / tile_size, y / tile_size);
        }
    return Done{};
}

void write_plane(Imf::TiledOutputPart part, Imf::PixelType type, const void* samples, const Target& head) {
    Imf::FrameBuffer buffer;
    buffer.insert("Y", slice_at(type, samples, {0, 0, head.width, head.height}));
    part.setFrameBuffer(buffer);
    part.writeTiles(0, part.numXTiles() - 1, 0, part.numYTiles() - 1);
}

Status write_parts(ExrStream& stream, const TakeInfo& info, const Target& head, const PlaneSource& source) {
    std::vector<Imf::Header> headers = {lamps_header(info, head), plane_header(info, head, mask_part, Imf::UINT)};
    if (!head.variance.empty()) headers.push_back(plane_header(info, head, variance_part, Imf::FLOAT));
    if (!head.noise_gain.empty()) headers.push_back(plane_header(info, head, noise_gain_part, Imf::FLOAT));
    if (!head.confidence.empty()) headers.push_back(plane_header(info, head, confidence_part, Imf::FLOAT));
    if (head.matte.frames > 0) headers.push_back(matte_header(info, head));
    if (!head.motion.flows.empty()) headers.push_back(motion_header(info, head));
    std::vector<uint32_t> mask = head.mask;
    mask.resize(size_t(head.width) * head.height);
    const auto channels = plane_channels(int(info.lights.size()), head.cfa);

    Imf::MultiPartOutputFile file(stream, headers.data(), int(headers.size()));
    Imf::TiledOutputPart lamps(file, 0);
    auto written = info.sample_type == SampleType::half_float ? write_lamps<half>(lamps, head, channels, source, mask)
                                                              : write_lamps<float>(lamps, head, channels, source, mask);
    if (!written) return written;
    write_plane(Imf::TiledOutputPart(file, 1), Imf::UINT, mask.data(), head);
    int part = 2;
    for (const auto* plane : {&head.variance, &head.noise_gain, &head.confidence})
        if (!plane->empty()) write_plane(Imf::TiledOutputPart(file, part++), Imf::FLOAT, plane->data(), head);
    if (head.matte.frames > 0) write_matte_tiles(Imf::TiledOutputPart(file, part++), head.matte);
    if (!head.motion.flows.empty()) write_motion_tiles(Imf::TiledOutputPart(file, part), head.motion);
    return Done{};
}

// What a reader would refuse is not written.
Status check_target(const TakeInfo& info, const Target& head) {
    if (const Status size = check_mosaic_size(head.cfa, head.width, head.height); !size) return size;
    std::set<int> missing;
    for (const int lamp : head.missing_lamps)
        if (lamp < 0 || size_t(lamp) >= info.lights.size() || !missing.insert(lamp).second)
            return fail(fmt::format("lamp {} cannot be missing: there are {}, each once", lamp, info.lights.size()));
    if (head.provenance.is_object() || head.provenance.is_null()) return Done{};
    return fail(fmt::format("a target's provenance is an object, not {}", json_kind(head.provenance)));
}

}  // namespace

std::string target_file_name(uint32_t camera, uint32_t index) {
    return fmt::format("cam{}/target_{:06}.exr", camera, index);
}

Status write_target_file(const std::string& path, const TakeInfo& info, const Target& head, const PlaneSource& source) {
    if (auto s = check_target(info, head); !s) return s;
    if (auto s = check_motion(head.motion, head.width, head.height); !s) return s;
    if (auto s = check_motion_range(head.motion); !s) return s;
    if (auto s = check_matte(head.matte, head.planes(), size_t(head.width) * size_t(head.height)); !s) return s;
    ExrStream stream(path);
    const Status written =
        guarded("cannot write '" + path + "'", [&] { return write_parts(stream, info, head, source); });
    // A disk error is named better by the stream than by what OpenEXR made of it.
    const Status finished = stream.finish();
    if (written.ok() && finished.ok()) return Done{};
    unlink(path.c_str());
    return finished.ok() ? written : finished;
}

}  // namespace ols

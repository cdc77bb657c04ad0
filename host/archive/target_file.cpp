// SPDX-License-Identifier: MIT
// Writing and reading of one target through OpenEXR's multi-part files.
#include "archive/target_file.hpp"

#include <ImfChannelList.h>
#include <ImfFrameBuffer.h>
#include <ImfFramesPerSecond.h>
#include <ImfMultiPartInputFile.h>
#include <ImfMultiPartOutputFile.h>
#include <ImfPartType.h>
#include <ImfStandardAttributes.h>
#include <ImfStringAttribute.h>
#include <ImfTiledInputPart.h>
#include <ImfTiledOutputPart.h>
#include <fmt/format.h>
#include <half.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "archive/exr_stream.hpp"
#include "archive/manifest.hpp"
#include "archive/matte_part.hpp"
#include "archive/motion_part.hpp"

namespace ols {

namespace {

constexpr int tile_size = 64;
constexpr size_t block_bytes = 64 << 20;

constexpr const char* cfa_names[] = {"none", "rggb", "bggr", "grbg", "gbrg", "rgb"};

std::vector<std::string> plane_channels(int lamps, Cfa cfa) {
    std::vector<std::string> channels;
    for (int i = 0; i < lamps; ++i) {
        const std::string layer = lamp_layer(i, lamps);
        if (cfa == Cfa::rgb)
            for (const char* color : {".R", ".G", ".B"}) channels.push_back(layer + color);
        else
            channels.push_back(layer + ".Y");
    }
    return channels;
}

Imf::Slice slice_at(Imf::PixelType type, const void* first, const Box& box) {
    const size_t size = type == Imf::HALF ? sizeof(half) : sizeof(float);
    return Imf::Slice::Make(type, first, Imath::V2i(box.x, box.y), box.width, box.height, size, size * box.width);
}

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

std::string lights_text(const TakeInfo& info) {
    std::string text;
    for (size_t i = 0; i < info.lights.size(); ++i) {
        const Vec3 d = info.lights[i].direction;
        text += fmt::format("{} {:.9f} {:.9f} {:.9f}\n", lamp_layer(int(i), int(info.lights.size())), d.x, d.y, d.z);
    }
    return text;
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
    Imf::Header header = part_header(info, head, "lamps");
    if (info.compression == Compression::none) header.compression() = Imf::NO_COMPRESSION;
    add_string(header, "colorInteropID", info.color_interop_id);
    add_string(header, "cfa", cfa_names[int(head.cfa)]);
    add_string(header, "basis", info.basis);
    add_string(header, "valueUnit", info.value_unit);
    add_string(header, "lights", lights_text(info));
    add_string(header, "missingLamps", nlohmann::json(head.missing_lamps).dump());
    add_string(header, "provenance", head.provenance.dump(-1, ' ', false, nlohmann::json::error_handler_t::replace));
    const auto type = info.sample_type == SampleType::half_float ? Imf::HALF : Imf::FLOAT;
    for (const auto& channel : plane_channels(int(info.lights.size()), head.cfa))
        header.channels().insert(channel, Imf::Channel(type));
    return header;
}

Imf::Header data_header(const TakeInfo& info, const Target& head, const char* name) {
    Imf::Header header = part_header(info, head, name);
    add_string(header, "colorInteropID", "data");
    return header;
}

Imf::Header motion_header(const TakeInfo& info, const Target& head) {
    Imf::Header header = data_header(info, head, "motion");
    add_motion_layers(header, head.motion.times_s);
    return header;
}

Imf::Header matte_header(const TakeInfo& info, const Target& head) {
    Imf::Header header = data_header(info, head, "matte");
    add_matte_channels(header, head.matte);
    return header;
}

Imf::Header plane_header(const TakeInfo& info, const Target& head, const char* name, Imf::PixelType type) {
    Imf::Header header = data_header(info, head, name);
    header.channels().insert("Y", Imf::Channel(type));
    return header;
}

// The value as stored, and whether it had to be changed for that.
template <typename Stored>
Stored storable(float value, bool& clamped) {
    const float largest = sizeof(Stored) == sizeof(float) ? std::numeric_limits<float>::max() : float(HALF_MAX);
    clamped = !(std::abs(value) <= largest);
    if (std::isnan(value)) return Stored(0.0f);
    return Stored(std::clamp(value, -largest, largest));
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
                for (int i = 0; i < box.width * box.height; ++i) {
                    bool clamped;
                    stored[i] = storable<Stored>(plane[i], clamped);
                    if (clamped) mask[size_t(y + i / box.width) * head.width + x + i % box.width] |= mask_clamped;
                }
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
    std::vector<Imf::Header> headers = {lamps_header(info, head), plane_header(info, head, "mask", Imf::UINT)};
    if (!head.variance.empty()) headers.push_back(plane_header(info, head, "variance", Imf::FLOAT));
    if (!head.noise_gain.empty()) headers.push_back(plane_header(info, head, "noise_gain", Imf::FLOAT));
    if (!head.confidence.empty()) headers.push_back(plane_header(info, head, "confidence", Imf::FLOAT));
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

}  // namespace

std::string target_file_name(uint32_t camera, uint32_t index) {
    return fmt::format("cam{}/target_{:06}.exr", camera, index);
}

Status write_target_file(const std::string& path, const TakeInfo& info, const Target& head, const PlaneSource& source) {
    if (auto s = check_motion(head.motion, head.width, head.height); !s) return s;
    if (auto s = check_motion_range(head.motion); !s) return s;
    if (auto s = check_matte(head.matte, head.planes(), size_t(head.width) * size_t(head.height)); !s) return s;
    ExrStream stream(path);
    Status written = Done{};
    try {
        written = write_parts(stream, info, head, source);
    } catch (const std::exception& e) {
        written = fail("cannot write '" + path + "': " + e.what());
    }
    // A disk error is named better by the stream than by what OpenEXR made of it.
    const Status finished = stream.finish();
    if (written.ok() && finished.ok()) return Done{};
    unlink(path.c_str());
    return finished.ok() ? written : finished;
}

namespace {

int find_part(const Imf::MultiPartInputFile& file, const std::string& name) {
    for (int i = 0; i < file.parts(); ++i)
        if (file.header(i).hasName() && file.header(i).name() == name && file.header(i).hasTileDescription()) return i;
    return -1;
}

std::string string_attribute(const Imf::Header& header, const char* name) {
    const auto* attribute = header.findTypedAttribute<Imf::StringAttribute>(name);
    return attribute ? attribute->value() : "";
}

Result<Target> head_of(const Imf::MultiPartInputFile& file, const std::string& path, const TakeInfo& info) {
    const int part = find_part(file, "lamps");
    if (part < 0 || find_part(file, "mask") < 0)
        return fail("'" + path + "' has no tiled parts \"lamps\" and \"mask\"");
    const Imf::Header& header = file.header(part);
    Target target;
    const std::string cfa = string_attribute(header, "cfa");
    const auto found = std::find(std::begin(cfa_names), std::end(cfa_names), cfa);
    if (found == std::end(cfa_names)) return fail("'" + path + "' has an unknown colour filter '" + cfa + "'");
    target.cfa = Cfa(found - std::begin(cfa_names));
    for (const auto& channel : plane_channels(int(info.lights.size()), target.cfa))
        if (!header.channels().findChannel(channel))
            return fail(fmt::format("'{}' has no layer '{}', but the manifest lists that lamp", path, channel));
    const Imath::Box2i& window = header.dataWindow();
    if (window.min != Imath::V2i(0, 0)) return fail("'" + path + "' has a data window that does not begin at 0, 0");
    target.width = window.max.x + 1;
    target.height = window.max.y + 1;
    for (const char* name : {"mask", "variance", "noise_gain", "confidence", "matte", "motion"})
        if (const int p = find_part(file, name); p >= 0 && file.header(p).dataWindow() != window)
            return fail("'" + path + "' has parts of different sizes");
    target.provenance = nlohmann::json::parse(string_attribute(header, "provenance"), nullptr, false);
    const auto missing = nlohmann::json::parse(string_attribute(header, "missingLamps"), nullptr, false);
    if (target.provenance.is_discarded() || !missing.is_array())
        return fail("'" + path + "' has a damaged header: its provenance or missing lamps are not JSON");
    for (const auto& lamp : missing) target.missing_lamps.push_back(lamp.get<int>());
    if (const int p = find_part(file, "motion"); p >= 0) {
        const auto times_s = motion_times(file.header(p));
        if (!times_s) return fail("'" + path + "': " + times_s.error().message);
        target.motion.times_s = *times_s;
    }
    if (const int p = find_part(file, "matte"); p >= 0) {
        auto matte = matte_head(file.header(p), target.planes());
        if (!matte) return fail("'" + path + "': " + matte.error().message);
        target.matte = std::move(*matte);
    }
    return target;
}

// Reads the tiles that cover a box: slices begin at the first covering tile, and are cropped after.
Box covering(const Box& box, const Target& head) {
    const int x0 = box.x / tile_size * tile_size, y0 = box.y / tile_size * tile_size;
    const int x1 = std::min(head.width, (box.x + box.width + tile_size - 1) / tile_size * tile_size);
    const int y1 = std::min(head.height, (box.y + box.height + tile_size - 1) / tile_size * tile_size);
    return {x0, y0, x1 - x0, y1 - y0};
}

template <typename Samples>
void crop(Samples& plane, const Box& from, const Box& to) {
    if (from.width == to.width && from.height == to.height) return;
    Samples cropped(size_t(to.width) * to.height);
    for (int y = 0; y < to.height; ++y)
        std::copy_n(plane.data() + size_t(y + to.y - from.y) * from.width + (to.x - from.x), to.width,
                    cropped.data() + size_t(y) * to.width);
    plane = std::move(cropped);
}

void read_part(Imf::MultiPartInputFile& file, const std::string& name, const Imf::FrameBuffer& buffer,
               const Box& tiles) {
    Imf::TiledInputPart part(file, find_part(file, name));
    if (part.tileXSize() != tile_size || part.tileYSize() != tile_size)
        throw std::runtime_error("its tiles are not 64 x 64 pixels");
    part.setFrameBuffer(buffer);
    part.readTiles(tiles.x / tile_size, (tiles.x + tiles.width - 1) / tile_size, tiles.y / tile_size,
                   (tiles.y + tiles.height - 1) / tile_size);
}

template <typename Sample>
void read_plane(Imf::MultiPartInputFile& file, const char* name, Imf::PixelType type, std::vector<Sample>& plane,
                const Box& tiles, const Box& box) {
    if (find_part(file, name) < 0) return;
    plane.resize(size_t(tiles.width) * tiles.height);
    Imf::FrameBuffer buffer;
    buffer.insert("Y", slice_at(type, plane.data(), tiles));
    read_part(file, name, buffer, tiles);
    crop(plane, tiles, box);
}

void read_matte(Imf::MultiPartInputFile& file, TargetMatte& matte, const Box& tiles, const Box& box) {
    if (matte.frames == 0) return;
    const Imf::Header& header = file.header(find_part(file, "matte"));
    read_part(file, "matte", matte_buffer(matte, header, tiles.x, tiles.y, tiles.width, tiles.height), tiles);
    for (auto& plane : matte.planes) crop(plane, tiles, box);
    if (!matte.variance.empty()) crop(matte.variance, tiles, box);
}

}  // namespace

Result<Target> read_target_head(const std::string& path, const TakeInfo& info) {
    try {
        const Imf::MultiPartInputFile file(path.c_str());
        return head_of(file, path, info);
    } catch (const std::exception& e) {
        return fail("cannot read '" + path + "': " + e.what());
    }
}

Result<Target> read_target_box(const std::string& path, const TakeInfo& info, Box box) {
    try {
        Imf::MultiPartInputFile file(path.c_str());
        auto head = head_of(file, path, info);
        if (!head) return head;
        Target& target = *head;
        if (box.width == 0) box = {0, 0, target.width, target.height};
        assert(box.x >= 0 && box.y >= 0 && box.width > 0 && box.height > 0 && box.x + box.width <= target.width &&
               box.y + box.height <= target.height);
        const Box tiles = covering(box, target);

        const auto channels = plane_channels(int(info.lights.size()), target.cfa);
        target.lamps.assign(channels.size(), Plane(size_t(tiles.width) * tiles.height));
        Imf::FrameBuffer buffer;
        for (size_t c = 0; c < channels.size(); ++c)
            buffer.insert(channels[c], slice_at(Imf::FLOAT, target.lamps[c].data(), tiles));
        read_part(file, "lamps", buffer, tiles);
        for (auto& plane : target.lamps) crop(plane, tiles, box);
        read_plane(file, "mask", Imf::UINT, target.mask, tiles, box);
        read_plane(file, "variance", Imf::FLOAT, target.variance, tiles, box);
        read_plane(file, "noise_gain", Imf::FLOAT, target.noise_gain, tiles, box);
        read_plane(file, "confidence", Imf::FLOAT, target.confidence, tiles, box);
        read_matte(file, target.matte, tiles, box);
        target.width = box.width;
        target.height = box.height;
        return head;
    } catch (const std::exception& e) {
        return fail("cannot read '" + path + "': " + e.what());
    }
}

Result<TargetMotion> read_target_motion(const std::string& path, const TakeInfo& info) {
    try {
        Imf::MultiPartInputFile file(path.c_str());
        auto head = head_of(file, path, info);
        if (!head) return head.error();
        TargetMotion motion = std::move(head->motion);
        if (motion.times_s.empty()) return fail("'" + path + "' has no motion: the take was made without");
        motion.flows = read_motion_tiles(Imf::TiledInputPart(file, find_part(file, "motion")), motion.times_s.size());
        const auto checked = check_motion(motion, head->width, head->height);
        if (!checked) return fail("'" + path + "': " + checked.error().message);
        return motion;
    } catch (const std::exception& e) {
        return fail("cannot read '" + path + "': " + e.what());
    }
}

}  // namespace ols

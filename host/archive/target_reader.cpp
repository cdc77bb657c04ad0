// SPDX-License-Identifier: MIT
// TargetReader: the samples of an open target, and opening one.
#include <ImfMultiPartInputFile.h>
#include <ImfTiledInputPart.h>
#include <fmt/format.h>

#include <algorithm>
#include <cassert>

#include "archive/archive.hpp"
#include "archive/archive_file.hpp"
#include "archive/exr_input.hpp"
#include "archive/matte_part.hpp"
#include "archive/motion_part.hpp"
#include "archive/target_header.hpp"
#include "archive/target_layout.hpp"
#include "archive/target_state.hpp"
#include "exceptions.hpp"

namespace ols {

namespace {

using namespace target_layout;

constexpr size_t strip_bytes = size_t(512) << 20;
constexpr uint32_t known_mask_bits = 2 * mask_misaligned - 1;

// The tiles that cover a box: slices begin at the first of them, and are cropped after.
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

void read_part(Imf::MultiPartInputFile& file, const char* name, const Imf::FrameBuffer& buffer, const Box& tiles) {
    Imf::TiledInputPart part(file, find_part(file, name));
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
    const Imf::Header& header = file.header(find_part(file, matte_part));
    read_part(file, matte_part, matte_buffer(matte, header, tiles.x, tiles.y, tiles.width, tiles.height), tiles);
    for (auto& plane : matte.planes) crop(plane, tiles, box);
    if (!matte.variance.empty()) crop(matte.variance, tiles, box);
}

void read_lamps(Imf::MultiPartInputFile& file, Target& target, int lamps, const Box& tiles, const Box& box) {
    const auto channels = plane_channels(lamps, target.cfa);
    target.lamps.assign(channels.size(), Plane(size_t(tiles.width) * tiles.height));
    Imf::FrameBuffer buffer;
    for (size_t c = 0; c < channels.size(); ++c)
        buffer.insert(channels[c], slice_at(Imf::FLOAT, target.lamps[c].data(), tiles));
    read_part(file, lamps_part, buffer, tiles);
    for (auto& plane : target.lamps) crop(plane, tiles, box);
}

}  // namespace

Result<std::unique_ptr<TargetReader::State>> TargetReader::State::open(ArchiveFile archive_file, const TakeInfo& info,
                                                                       int archive_version, const TargetEntry& entry) {
    auto state = std::make_unique<State>(State{std::move(archive_file), &info, nullptr, nullptr, {}});
    if (const Status s = check_exr_headers(state->file); !s) return s.error();
    const std::string action = "cannot read '" + state->file.path() + "'";
    auto head = guarded(action, [&]() -> Result<Target> {
        state->input = std::make_unique<ExrInput>(state->file);
        // Files are whole before they have their names: a table of tiles that has to be guessed is damage.
        constexpr bool guess_table = false;
        state->exr = std::make_unique<Imf::MultiPartInputFile>(*state->input, 0, guess_table);
        auto checked = ols::read_head(*state->exr, {info, archive_version, entry, state->file.size()});
        return checked ? std::move(checked) : fail(action + ": " + checked.error().message);
    });
    if (!head) return head.error();
    state->head = std::move(*head);
    return state;
}

TargetReader::TargetReader(std::unique_ptr<State> state) : state_(std::move(state)) {}
TargetReader::TargetReader(TargetReader&&) noexcept = default;
TargetReader::~TargetReader() = default;

const Target& TargetReader::head() const {
    return state_->head;
}

int TargetReader::strip_rows() const {
    const size_t row_bytes =
        size_t(head().width) * state_->info->lights.size() * size_t(head().planes()) * sizeof(float);
    return int(std::clamp<size_t>(strip_bytes / row_bytes / tile_size, 1, size_t(head().height) / tile_size + 1)) *
           tile_size;
}

Result<Target> TargetReader::read() const {
    return read_box({0, 0, head().width, head().height});
}

Result<Target> TargetReader::read_box(const Box& box) const {
    assert(box.x >= 0 && box.y >= 0 && box.width > 0 && box.height > 0 && box.x + box.width <= head().width &&
           box.y + box.height <= head().height);
    const std::string action = "cannot read '" + state_->file.path() + "'";
    return guarded(action, [&]() -> Result<Target> {
        Imf::MultiPartInputFile& exr = *state_->exr;
        const Box tiles = covering(box, head());
        Target target = head();
        read_lamps(exr, target, int(state_->info->lights.size()), tiles, box);
        read_plane(exr, mask_part, Imf::UINT, target.mask, tiles, box);
        read_plane(exr, variance_part, Imf::FLOAT, target.variance, tiles, box);
        read_plane(exr, noise_gain_part, Imf::FLOAT, target.noise_gain, tiles, box);
        read_plane(exr, confidence_part, Imf::FLOAT, target.confidence, tiles, box);
        read_matte(exr, target.matte, tiles, box);
        target.width = box.width, target.height = box.height;
        for (const uint32_t bits : target.mask)
            if ((bits & ~known_mask_bits) != 0)
                return fail(fmt::format("{}: its mask has the bits {:#x}, which no version has", action, bits));
        return target;
    });
}

Result<TargetMotion> TargetReader::read_motion() const {
    const std::string& path = state_->file.path();
    if (head().motion.times_s.empty()) return fail("'" + path + "' has no motion: the take was made without");
    return guarded("cannot read '" + path + "'", [&]() -> Result<TargetMotion> {
        TargetMotion motion = head().motion;
        motion.flows = read_motion_tiles(Imf::TiledInputPart(*state_->exr, find_part(*state_->exr, motion_part)),
                                         motion.times_s.size());
        const auto checked = check_motion(motion, head().width, head().height);
        if (!checked) return fail("'" + path + "': " + checked.error().message);
        return motion;
    });
}

}  // namespace ols

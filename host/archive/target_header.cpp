// SPDX-License-Identifier: MIT
// Checks in order: parts, picture, channels, what the attributes say.
#include "archive/target_header.hpp"

#include <ImfChannelList.h>
#include <ImfIntAttribute.h>
#include <ImfPartType.h>
#include <ImfStringAttribute.h>
#include <ImfTileDescription.h>
#include <fmt/format.h>

#include <algorithm>
#include <map>
#include <set>

#include "archive/matte_part.hpp"
#include "archive/motion_part.hpp"
#include "archive/target_layout.hpp"
#include "image/demosaic.hpp"
#include "image/json_object.hpp"

namespace ols {

namespace {

namespace layout = target_layout;
using Channels = std::map<std::string, Imf::PixelType>;

constexpr const char* part_names[] = {layout::lamps_part,      layout::mask_part,       layout::variance_part,
                                      layout::noise_gain_part, layout::confidence_part, layout::matte_part,
                                      layout::motion_part};
constexpr int side_max = 1 << 20;
// No more than this comes out of a byte: RFC 1951, a code of one bit for 258 bytes, and one for their distance.
constexpr uint64_t inflation_max = 1032;

Status check_tiles(const Imf::Header& header) {
    if (!header.hasType() || header.type() != Imf::TILEDIMAGE || !header.hasTileDescription())
        return fail("is not in tiles");
    const Imf::TileDescription& tiles = header.tileDescription();
    if (tiles.xSize != layout::tile_size || tiles.ySize != layout::tile_size || tiles.mode != Imf::ONE_LEVEL)
        return fail("is not in tiles of 64 x 64 pixels of one level");
    if (header.compression() != Imf::NO_COMPRESSION && header.compression() != Imf::ZIPS_COMPRESSION)
        return fail("is compressed as no archive's are");
    return Done{};
}

Status check_windows(const Imf::Header& header, const Imf::Header& lamps) {
    const Imath::Box2i& window = header.dataWindow();
    if (window.min != Imath::V2i(0, 0)) return fail("has a data window that does not begin at 0, 0");
    if (window.max.x < 0 || window.max.y < 0 || window.max.x >= side_max || window.max.y >= side_max)
        return fail(fmt::format("has a picture that is not 1 to {} pixels wide and high", side_max));
    if (header.displayWindow() != window) return fail("has a display window that is not its data window");
    if (window != lamps.dataWindow()) return fail("is of another size than the lamps");
    return Done{};
}

Status check_parts(const Imf::MultiPartInputFile& file) {
    std::set<std::string> names;
    for (int i = 0; i < file.parts(); ++i) {
        const std::string name = file.header(i).hasName() ? file.header(i).name() : "";
        if (std::ranges::find(part_names, name) == std::end(part_names))
            return fail(fmt::format("its part {} is none that a target has", i));
        if (!names.insert(name).second) return fail("it has the part '" + name + "' twice");
    }
    for (const char* name : {layout::lamps_part, layout::mask_part})
        if (!names.contains(name)) return fail(fmt::format("it has no part '{}'", name));
    const Imf::Header& lamps = file.header(find_part(file, layout::lamps_part));
    for (int i = 0; i < file.parts(); ++i) {
        Status checked = check_tiles(file.header(i));
        if (checked) checked = check_windows(file.header(i), lamps);
        if (!checked) return fail(fmt::format("its part '{}' {}", file.header(i).name(), checked.error().message));
    }
    return Done{};
}

Status check_channels(const Imf::Header& header, const Channels& expected) {
    size_t count = 0;
    for (auto it = header.channels().begin(); it != header.channels().end(); ++it, ++count) {
        const auto known = expected.find(it.name());
        if (known == expected.end()) return fail("has a channel that the take has not");
        if (it.channel().type != known->second)
            return fail(fmt::format("has samples of another type in '{}'", known->first));
        if (it.channel().xSampling != 1 || it.channel().ySampling != 1)
            return fail(fmt::format("has fewer samples than pixels in '{}'", known->first));
    }
    for (const auto& [name, type] : expected)
        if (!header.channels().findChannel(name)) return fail(fmt::format("has no channel '{}'", name));
    return Done{};
}

uint64_t stored_bytes(const Imf::Header& header) {
    uint64_t pixel_bytes = 0;
    for (auto it = header.channels().begin(); it != header.channels().end(); ++it)
        pixel_bytes += it.channel().type == Imf::HALF ? 2 : 4;
    const Imath::Box2i& window = header.dataWindow();
    return pixel_bytes * uint64_t(window.max.x + 1) * uint64_t(window.max.y + 1);
}

// Before memory is taken for the samples.
Status check_size(const Imf::MultiPartInputFile& file, uint64_t file_bytes) {
    uint64_t least = 0;
    for (int i = 0; i < file.parts(); ++i) {
        const uint64_t bytes = stored_bytes(file.header(i));
        least += file.header(i).compression() == Imf::NO_COMPRESSION ? bytes : bytes / inflation_max;
    }
    if (least <= file_bytes) return Done{};
    return fail(fmt::format("its picture needs {} bytes or more, and the file has {}", least, file_bytes));
}

// Attributes of the lamps.
class Attributes {
  public:
    explicit Attributes(const Imf::Header& header) : header_(header) {}

    const std::string* text(const char* name) const {
        const auto* attribute = header_.findTypedAttribute<Imf::StringAttribute>(name);
        return attribute ? &attribute->value() : nullptr;
    }
    const int* number(const char* name) const {
        const auto* attribute = header_.findTypedAttribute<Imf::IntAttribute>(name);
        return attribute ? &attribute->value() : nullptr;
    }
    Result<nlohmann::json> json(const char* name) const {
        const std::string* written = text(name);
        if (!written) return fail(fmt::format("it has no {}", name));
        return parse_json(*written, fmt::format("its {}", name));
    }

  private:
    const Imf::Header& header_;
};

Status check_identity(const Attributes& attributes, const TargetExpectation& expected) {
    for (const auto& [name, number] : {std::pair(layout::camera_attribute, expected.entry.camera),
                                       std::pair(layout::index_attribute, expected.entry.index)}) {
        const int* stated = attributes.number(name);
        if (!stated && expected.archive_version >= 2)
            return fail(fmt::format("it does not say of which {} it is", name));
        if (stated && uint32_t(*stated) != number)
            return fail(
                fmt::format("it is of {} {}, and stands in the place of {} {}", name, uint32_t(*stated), name, number));
    }
    const TakeInfo& info = expected.info;
    for (const auto& [name, text] :
         {std::pair(layout::basis_attribute, info.basis), std::pair(layout::value_unit_attribute, info.value_unit),
          std::pair(layout::color_attribute, info.color_interop_id),
          std::pair(layout::lights_attribute, layout::lights_text(info))}) {
        const std::string* stated = attributes.text(name);
        if (!stated || *stated != text)
            return fail(fmt::format("its {} is not the manifest's: it is of another take", name));
    }
    return Done{};
}

Result<Cfa> read_cfa(const Attributes& attributes) {
    const std::string* cfa = attributes.text(layout::cfa_attribute);
    const auto found = cfa ? std::ranges::find(layout::cfa_names, *cfa) : std::end(layout::cfa_names);
    if (found == std::end(layout::cfa_names)) return fail("it has no colour filter that is known");
    return Cfa(found - std::begin(layout::cfa_names));
}

Result<std::vector<int>> read_missing_lamps(const Attributes& attributes, size_t lamps) {
    const auto json = attributes.json(layout::missing_attribute);
    if (!json) return json.error();
    const Error wrong =
        fail(fmt::format("its missing lamps are not an array of lamps from 0 to {}, each once", lamps - 1));
    if (!json->is_array()) return wrong;
    std::vector<int> missing;
    std::set<uint64_t> seen;
    for (const auto& lamp : *json) {
        if (!lamp.is_number_unsigned() || lamp.get<uint64_t>() >= lamps || !seen.insert(lamp.get<uint64_t>()).second)
            return wrong;
        missing.push_back(lamp.get<int>());
    }
    return missing;
}

Status check_lamp_channels(const Imf::Header& header, const TakeInfo& info, Cfa cfa) {
    Channels channels;
    for (const auto& name : layout::plane_channels(int(info.lights.size()), cfa))
        channels[name] = layout::lamp_type(info);
    return check_channels(header, channels);
}

// The parts beside the lamps, and what their headers say.
Status read_other_parts(const Imf::MultiPartInputFile& file, Target& target) {
    for (int i = 0; i < file.parts(); ++i) {
        const Imf::Header& header = file.header(i);
        const std::string& name = header.name();
        Status read = Done{};
        if (name == layout::lamps_part) continue;
        if (name == layout::motion_part) {
            auto times = motion_times(header);
            if (times) target.motion.times_s = std::move(*times);
            read = times ? check_channels(header, motion_channels(target.motion.times_s.size())) : times.error();
        } else if (name == layout::matte_part) {
            auto matte = matte_head(header, target.planes());
            if (matte) target.matte = std::move(*matte);
            read = matte ? check_channels(header, matte_channels(target.planes(), has_matte_variance(header)))
                         : matte.error();
        } else {
            read = check_channels(header, {{"Y", name == layout::mask_part ? Imf::UINT : Imf::FLOAT}});
        }
        if (!read) return fail(fmt::format("its part '{}' {}", name, read.error().message));
    }
    return Done{};
}

}  // namespace

int find_part(const Imf::MultiPartInputFile& file, const std::string& name) {
    for (int i = 0; i < file.parts(); ++i)
        if (file.header(i).hasName() && file.header(i).name() == name) return i;
    return -1;
}

Result<Target> read_head(const Imf::MultiPartInputFile& file, const TargetExpectation& expected) {
    if (const Status s = check_parts(file); !s) return s.error();
    const Imf::Header& lamps = file.header(find_part(file, layout::lamps_part));
    const Attributes attributes(lamps);
    Target target;
    target.camera = expected.entry.camera, target.index = expected.entry.index;
    target.width = lamps.dataWindow().max.x + 1, target.height = lamps.dataWindow().max.y + 1;
    const auto cfa = read_cfa(attributes);
    if (!cfa) return cfa.error();
    target.cfa = *cfa;
    if (const Status s = check_mosaic_size(target.cfa, target.width, target.height); !s) return s.error();
    if (const Status s = check_lamp_channels(lamps, expected.info, target.cfa); !s)
        return fail("its part 'lamps' " + s.error().message);
    if (const Status s = read_other_parts(file, target); !s) return s.error();
    if (const Status s = check_size(file, expected.file_bytes); !s) return s.error();
    if (const Status s = check_identity(attributes, expected); !s) return s.error();
    auto missing = read_missing_lamps(attributes, expected.info.lights.size());
    if (!missing) return missing.error();
    target.missing_lamps = std::move(*missing);
    auto provenance = attributes.json(layout::provenance_attribute);
    if (!provenance) return provenance.error();
    if (*provenance != expected.entry.detail) return fail("its provenance is not the journal's: it is of another take");
    target.provenance = std::move(*provenance);
    return target;
}

}  // namespace ols

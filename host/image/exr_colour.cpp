// SPDX-License-Identifier: MIT
// Chromaticities first, a colour space's name where there are none.
#include "image/exr_colour.hpp"

#include <ImfStandardAttributes.h>
#include <ImfStringAttribute.h>

#include <map>

namespace ols {

namespace {

constexpr Primaries ap0 = {{0.7347, 0.2653}, {0.0, 1.0}, {0.0001, -0.0770}, {0.32168, 0.33767}};
constexpr Primaries ap1 = {{0.713, 0.293}, {0.165, 0.830}, {0.128, 0.044}, {0.32168, 0.33767}};

// Linear spaces by the names of the Color Interop Forum's recommendation and of OpenImageIO.
const std::map<std::string, Primaries>& linear_spaces() {
    static const std::map<std::string, Primaries> spaces = {{"lin_rec709_scene", rec709_primaries},
                                                            {"lin_rec709", rec709_primaries},
                                                            {"lin_srgb", rec709_primaries},
                                                            {"Linear", rec709_primaries},
                                                            {"linear", rec709_primaries},
                                                            {"scene_linear", rec709_primaries},
                                                            {"lin_rec2020_scene", rec2020_primaries},
                                                            {"lin_rec2020", rec2020_primaries},
                                                            {"lin_p3d65_scene", p3_d65_primaries},
                                                            {"lin_p3d65", p3_d65_primaries},
                                                            {"lin_adobergb_scene", adobe_primaries},
                                                            {"lin_ap0_scene", ap0},
                                                            {"lin_ap0", ap0},
                                                            {"ACES2065-1", ap0},
                                                            {"lin_ap1_scene", ap1},
                                                            {"lin_ap1", ap1},
                                                            {"ACEScg", ap1}};
    return spaces;
}

std::string text_of(const Imf::Header& header, const char* name) {
    const auto* text = header.findTypedAttribute<Imf::StringAttribute>(name);
    return text ? text->value() : "";
}

Chromaticity chromaticity(Imath::V2f v) {
    return {v.x, v.y};
}

Primaries stated_primaries(const Imf::Header& header) {
    const auto& c = Imf::chromaticities(header);
    return {chromaticity(c.red), chromaticity(c.green), chromaticity(c.blue), chromaticity(c.white)};
}

}  // namespace

Result<StatedColour> stated_exr_colour(const Imf::Header& header) {
    const std::string name = text_of(header, "colorInteropID"), by_oiio = text_of(header, "oiio:ColorSpace");
    if (name == "data") return fail("its colorInteropID says 'data', so it is no light: name a picture");
    const auto& spaces = linear_spaces();
    const bool named = !name.empty() && name != "unknown";
    if (named && !spaces.count(name) && !(name.starts_with("lin_") && Imf::hasChromaticities(header)))
        return fail("its colorInteropID '" + name + "' is no linear light known here: convert it to lin_rec709_scene");
    if (Imf::hasChromaticities(header)) {
        StatedColour stated = {stated_primaries(header), true, ""};
        if (const auto space = spaces.find(name); space != spaces.end() && !are_same(space->second, stated.primaries))
            stated.said = "its colorInteropID says '" + name + "' and its chromaticities others: these were taken";
        return stated;
    }
    if (named) return StatedColour{spaces.at(name), true, ""};
    if (by_oiio.empty()) return StatedColour{};
    if (const auto space = spaces.find(by_oiio); space != spaces.end()) return StatedColour{space->second, true, ""};
    return StatedColour{rec709_primaries, false,
                        "its oiio:ColorSpace says '" + by_oiio + "': taken as linear light of Rec. 709 all the same"};
}

}  // namespace ols

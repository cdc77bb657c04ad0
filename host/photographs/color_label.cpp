// SPDX-License-Identifier: MIT
// Profiles, from a file or built of gamma, curves and primaries, through Little CMS.
#include "photographs/color_label.hpp"

#include <fmt/format.h>
#include <lcms2.h>

#include <cmath>

#include "image/tone.hpp"

namespace ols {

std::vector<uint16_t> srgb_curve() {
    std::vector<uint16_t> curve(4096);
    for (size_t i = 0; i < curve.size(); ++i) curve[i] = uint16_t(std::lround(65535 * srgb_decode(float(i) / 4095)));
    return curve;
}

namespace {

using Profile = std::unique_ptr<void, decltype(&cmsCloseProfile)>;
using Curve = std::unique_ptr<cmsToneCurve, decltype(&cmsFreeToneCurve)>;

Profile owned(cmsHPROFILE profile) {
    return Profile(profile, [](cmsHPROFILE p) { return p ? cmsCloseProfile(p) : TRUE; });
}

cmsCIExyY xyY(const Chromaticity& xy) {
    return {xy.x, xy.y, 1};
}

Profile rgb_profile(const Primaries& p, const std::array<cmsToneCurve*, 3>& curves) {
    const cmsCIExyY white = xyY(p.white);
    const cmsCIExyYTRIPLE triple = {xyY(p.red), xyY(p.green), xyY(p.blue)};
    return owned(cmsCreateRGBProfile(&white, &triple, curves.data()));
}

Profile described(const ColorLabel& label, int channels) {
    std::vector<Curve> curves;
    for (int c = 0; c < 3; ++c) {
        const auto& table = label.curves[c];
        cmsToneCurve* curve = table.empty()
                                  ? cmsBuildGamma(nullptr, label.gamma > 0 ? label.gamma : 1)
                                  : cmsBuildTabulatedToneCurve16(nullptr, cmsUInt32Number(table.size()), table.data());
        curves.emplace_back(curve, cmsFreeToneCurve);
    }
    const Primaries primaries = label.primaries.value_or(rec709_primaries);
    if (channels == 3) return rgb_profile(primaries, {curves[0].get(), curves[1].get(), curves[2].get()});
    return owned(cmsCreateGrayProfile(cmsD50_xyY(), curves[0].get()));
}

Profile linear_light(int channels) {
    const Curve linear(cmsBuildGamma(nullptr, 1), cmsFreeToneCurve);
    if (channels == 3) return rgb_profile(rec709_primaries, {linear.get(), linear.get(), linear.get()});
    return owned(cmsCreateGrayProfile(cmsD50_xyY(), linear.get()));
}

// Whether a conversion gives what sRGB's curve gives, channel by channel, on a lattice of colours.
bool agrees_with_srgb(const ColorConversion& conversion, int channels) {
    constexpr int steps = 9;
    const int colors = channels == 3 ? steps * steps * steps : steps;
    for (int n = 0; n < colors; ++n) {
        float code[3], light[3];
        for (int c = 0, rest = n; c < channels; ++c, rest /= steps)
            light[c] = code[c] = float(rest % steps) / (steps - 1);
        conversion.apply({light, size_t(channels)});
        for (int c = 0; c < channels; ++c)
            if (!(std::abs(light[c] - srgb_decode(code[c])) < 1e-3f)) return false;
    }
    return true;
}

}  // namespace

Result<ColorLabel> label_of_codes(int primaries, int transfer, const std::string& name) {
    // Transfers: 1, 6, 14 and 15 are video's curve, which pictures of sRGB's are often said to have; 2 is not said; 8 is linear; 13 sRGB's.
    constexpr int bt709 = 1, unsaid = 2, bt2020 = 9, display_p3 = 12;
    if (transfer == 16 || transfer == 18)
        return fail(fmt::format("is coded for a display ({})", transfer == 16 ? "PQ" : "HLG"));
    const bool is_srgb_curve = transfer == 13 || transfer == 1 || transfer == 6 || transfer == 14 || transfer == 15;
    if (!is_srgb_curve && transfer != unsaid && transfer != 8)
        return fail(fmt::format("has a transfer of an unusual kind (code {} of H.273)", transfer));
    ColorLabel label;
    if (transfer == unsaid && (primaries == unsaid || primaries == bt709)) return label;
    label.name = name;
    label.is_srgb = is_srgb_curve && (primaries == bt709 || primaries == unsaid);
    if (label.is_srgb) return label;
    if (primaries == bt2020)
        label.primaries = rec2020_primaries;
    else if (primaries == display_p3)
        label.primaries = p3_d65_primaries;
    else if (primaries == bt709 || primaries == unsaid)
        label.primaries = rec709_primaries;
    else
        return fail(fmt::format("has primaries of an unusual kind (code {} of H.273)", primaries));
    if (transfer == 8)
        label.gamma = 1;
    else
        label.curves.fill(srgb_curve());
    return label;
}

Result<ColorConversion> ColorConversion::create(const ColorLabel& label, int channels) {
    cmsSetLogErrorHandler([](cmsContext, cmsUInt32Number, const char*) {});  // what fails is told below
    if (label.primaries && label.profile.empty())
        if (const auto weights = luminance_weights(*label.primaries); !weights) return weights.error();
    if (label.gamma != 0 && !(label.gamma >= 0.1 && label.gamma <= 10))
        return fail(fmt::format("its gamma of {:g} is out of range (0.1 to 10)", label.gamma));
    const Profile from =
        label.profile.empty()
            ? described(label, channels)
            : owned(cmsOpenProfileFromMem(label.profile.data(), cmsUInt32Number(label.profile.size())));
    if (!from) return fail("its profile is damaged");
    const auto space = cmsGetColorSpace(from.get());
    if (space != (channels == 3 ? cmsSigRgbData : cmsSigGrayData))
        return fail(fmt::format("its profile is not for {}", channels == 3 ? "R G B" : "grey"));
    const Profile to = linear_light(channels);
    const auto format = channels == 3 ? TYPE_RGB_FLT : TYPE_GRAY_FLT;
    cmsHTRANSFORM transform =
        cmsCreateTransform(from.get(), format, to.get(), format, INTENT_RELATIVE_COLORIMETRIC, cmsFLAGS_NOCACHE);
    if (!transform) return fail("its profile cannot be converted");
    ColorConversion conversion;
    conversion.transform_ = std::shared_ptr<void>(transform, cmsDeleteTransform);
    conversion.channels_ = channels;
    conversion.is_srgb_ = agrees_with_srgb(conversion, channels);
    return conversion;
}

void ColorConversion::apply(std::span<float> samples) const {
    cmsDoTransform(transform_.get(), samples.data(), samples.data(), cmsUInt32Number(samples.size() / channels_));
}

}  // namespace ols

// SPDX-License-Identifier: MIT
// The table of formats: Linux, Documentation/userspace-api/media/v4l, pixfmt-yuv-luma.rst (GREY, Y..), pixfmt-bayer.rst and the files
// it names (S....8 to 16), pixfmt-rgb.rst (RGB24). Those newer than the headers of Debian 12 are spelt out.
#include "device/v4l2_format.hpp"

#include <algorithm>

namespace ols {

namespace {

struct Format {
    uint32_t fourcc;
    SampleLayout layout;
};

constexpr uint32_t y012 = v4l2_fourcc('Y', '0', '1', '2'), y12p = v4l2_fourcc('Y', '1', '2', 'P');

// Of one mosaic and width packed ones come first: the link carries less.
constexpr Format formats[] = {
    {V4L2_PIX_FMT_GREY, {SamplePacking::bytes, 8}},
    {V4L2_PIX_FMT_Y10P, {SamplePacking::mipi, 10}},
    {V4L2_PIX_FMT_Y10BPACK, {SamplePacking::bits_high, 10}},
    {V4L2_PIX_FMT_Y10, {SamplePacking::words, 10}},
    {y12p, {SamplePacking::mipi, 12}},
    {V4L2_PIX_FMT_Y12, {SamplePacking::words, 12}},
    {y012, {SamplePacking::words_high, 12}},
    {V4L2_PIX_FMT_Y14, {SamplePacking::words, 14}},
    {V4L2_PIX_FMT_Y16, {SamplePacking::words, 16}},
    {V4L2_PIX_FMT_Y16_BE, {SamplePacking::words_big, 16}},
    {V4L2_PIX_FMT_RGB24, {SamplePacking::bytes, 8, Cfa::rgb}},

    {V4L2_PIX_FMT_SRGGB8, {SamplePacking::bytes, 8, Cfa::rggb}},
    {V4L2_PIX_FMT_SBGGR8, {SamplePacking::bytes, 8, Cfa::bggr}},
    {V4L2_PIX_FMT_SGRBG8, {SamplePacking::bytes, 8, Cfa::grbg}},
    {V4L2_PIX_FMT_SGBRG8, {SamplePacking::bytes, 8, Cfa::gbrg}},
    {V4L2_PIX_FMT_SRGGB10P, {SamplePacking::mipi, 10, Cfa::rggb}},
    {V4L2_PIX_FMT_SBGGR10P, {SamplePacking::mipi, 10, Cfa::bggr}},
    {V4L2_PIX_FMT_SGRBG10P, {SamplePacking::mipi, 10, Cfa::grbg}},
    {V4L2_PIX_FMT_SGBRG10P, {SamplePacking::mipi, 10, Cfa::gbrg}},
    {V4L2_PIX_FMT_SRGGB10, {SamplePacking::words, 10, Cfa::rggb}},
    {V4L2_PIX_FMT_SBGGR10, {SamplePacking::words, 10, Cfa::bggr}},
    {V4L2_PIX_FMT_SGRBG10, {SamplePacking::words, 10, Cfa::grbg}},
    {V4L2_PIX_FMT_SGBRG10, {SamplePacking::words, 10, Cfa::gbrg}},
    {V4L2_PIX_FMT_SRGGB12P, {SamplePacking::mipi, 12, Cfa::rggb}},
    {V4L2_PIX_FMT_SBGGR12P, {SamplePacking::mipi, 12, Cfa::bggr}},
    {V4L2_PIX_FMT_SGRBG12P, {SamplePacking::mipi, 12, Cfa::grbg}},
    {V4L2_PIX_FMT_SGBRG12P, {SamplePacking::mipi, 12, Cfa::gbrg}},
    {V4L2_PIX_FMT_SRGGB12, {SamplePacking::words, 12, Cfa::rggb}},
    {V4L2_PIX_FMT_SBGGR12, {SamplePacking::words, 12, Cfa::bggr}},
    {V4L2_PIX_FMT_SGRBG12, {SamplePacking::words, 12, Cfa::grbg}},
    {V4L2_PIX_FMT_SGBRG12, {SamplePacking::words, 12, Cfa::gbrg}},
    {V4L2_PIX_FMT_SRGGB14, {SamplePacking::words, 14, Cfa::rggb}},
    {V4L2_PIX_FMT_SBGGR14, {SamplePacking::words, 14, Cfa::bggr}},
    {V4L2_PIX_FMT_SGRBG14, {SamplePacking::words, 14, Cfa::grbg}},
    {V4L2_PIX_FMT_SGBRG14, {SamplePacking::words, 14, Cfa::gbrg}},
    {V4L2_PIX_FMT_SRGGB16, {SamplePacking::words, 16, Cfa::rggb}},
    {V4L2_PIX_FMT_SBGGR16, {SamplePacking::words, 16, Cfa::bggr}},
    {V4L2_PIX_FMT_SGRBG16, {SamplePacking::words, 16, Cfa::grbg}},
    {V4L2_PIX_FMT_SGBRG16, {SamplePacking::words, 16, Cfa::gbrg}},
};

constexpr uint32_t offers_max = 1024;  // a driver that never ends its list is cut short here
constexpr size_t others_named_max = 4;

bool offers(const std::vector<OfferedFormat>& offered, uint32_t fourcc) {
    return std::any_of(offered.begin(), offered.end(), [&](const auto& format) { return format.fourcc == fourcc; });
}

}  // namespace

std::optional<SampleLayout> layout_of_fourcc(uint32_t fourcc) {
    for (const Format& format : formats)
        if (format.fourcc == fourcc) return format.layout;
    return std::nullopt;
}

std::vector<OfferedFormat> offered_formats(V4l2Device& device) {
    std::vector<OfferedFormat> offered;
    for (uint32_t n = 0; n < offers_max; ++n) {
        v4l2_fmtdesc description{};
        description.index = n;
        description.type = V4L2_BUF_TYPE_VIDEO_CAPTURE;
        if (device.ioctl(VIDIOC_ENUM_FMT, &description) != 0) break;
        description.description[sizeof description.description - 1] = 0;
        offered.push_back({description.pixelformat, reinterpret_cast<const char*>(description.description)});
    }
    return offered;
}

std::optional<uint32_t> choose_format(const std::vector<OfferedFormat>& offered, Cfa cfa, int bits) {
    for (const Format& format : formats)
        if (format.layout.cfa == cfa && format.layout.bits == bits && offers(offered, format.fourcc))
            return format.fourcc;
    return std::nullopt;
}

uint32_t nearest_format(const std::vector<OfferedFormat>& offered, Cfa cfa) {
    uint32_t nearest = 0;
    for (const auto& format : offered) {
        const auto layout = layout_of_fourcc(format.fourcc);
        if (layout && layout->cfa == cfa) return format.fourcc;
        if (layout && nearest == 0) nearest = format.fourcc;
    }
    return nearest != 0 || offered.empty() ? nearest : offered.front().fourcc;
}

std::string describe_formats(const std::vector<OfferedFormat>& offered) {
    std::string ours, others;
    size_t count = 0;
    for (const auto& [fourcc, description] : offered) {
        if (layout_of_fourcc(fourcc))
            ours += (ours.empty() ? "" : ", ") + fourcc_text(fourcc) + " (" + description + ")";
        else if (++count <= others_named_max)
            others += (others.empty() ? "" : ", ") + fourcc_text(fourcc);
    }
    if (count > others_named_max) others += " and " + std::to_string(count - others_named_max) + " more";
    if (ours.empty()) ours = "none that is read here";
    return others.empty() ? ours : ours + "; not read here: " + others;
}

}  // namespace ols

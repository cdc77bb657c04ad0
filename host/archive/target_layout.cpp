// SPDX-License-Identifier: MIT
#include "archive/target_layout.hpp"

#include <fmt/format.h>

#include <cstdint>

namespace ols::target_layout {

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

Imf::PixelType lamp_type(const TakeInfo& info) {
    return info.sample_type == SampleType::half_float ? Imf::HALF : Imf::FLOAT;
}

std::string lights_text(const TakeInfo& info) {
    std::string text;
    for (size_t i = 0; i < info.lights.size(); ++i) {
        const Vec3 d = info.lights[i].direction;
        text += fmt::format("{} {:.9f} {:.9f} {:.9f}\n", lamp_layer(int(i), int(info.lights.size())), d.x, d.y, d.z);
    }
    return text;
}

Imf::Slice slice_at(Imf::PixelType type, const void* first, const Box& box) {
    const size_t size = type == Imf::HALF ? sizeof(uint16_t) : sizeof(float);
    return Imf::Slice::Make(type, first, Imath::V2i(box.x, box.y), box.width, box.height, size, size * box.width);
}

}  // namespace ols::target_layout

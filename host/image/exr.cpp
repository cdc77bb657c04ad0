// SPDX-License-Identifier: MIT
// Writing one-part OpenEXR files through the library's OutputFile. Reading: exr_reader.cpp.
#include "image/exr.hpp"

#include <ImfChannelList.h>
#include <ImfFrameBuffer.h>
#include <ImfHeader.h>
#include <ImfOutputFile.h>
#include <ImfStandardAttributes.h>
#include <ImfStdIO.h>
#include <ImfStringAttribute.h>
#include <half.h>

#include <algorithm>
#include <cassert>
#include <cmath>

#include "exceptions.hpp"
#include "image/whole_file.hpp"

namespace ols {

namespace {

::half clamped_half(float v) {
    return ::half(std::isfinite(v) ? std::clamp(v, -float(HALF_MAX), float(HALF_MAX)) : v);
}

// The whole file. In memory, because the library's own file stream forgets errors of its last write.
std::string encoded(const Image& image, ExrType type, const std::map<std::string, std::string>& attributes) {
    static const std::vector<std::vector<std::string>> names = {{}, {"Y"}, {}, {"R", "G", "B"}, {"R", "G", "B", "A"}};
    const auto& channels = names[image.channels];
    Imf::Header header(image.width, image.height);
    for (const auto& [key, value] : attributes) header.insert(key, Imf::StringAttribute(value));
    // The defaults of the type are the primaries and white point of Rec. 709.
    const auto color = attributes.find("colorInteropID");
    if (color != attributes.end() && color->second == "lin_rec709_scene")
        Imf::addChromaticities(header, Imf::Chromaticities());
    const bool half = type == ExrType::half_float;
    for (const auto& name : channels) header.channels().insert(name, Imf::Channel(half ? Imf::HALF : Imf::FLOAT));

    // OutputFile converts nothing: half files need half samples (values beyond 65504 become the largest half, not Inf).
    std::vector<::half> halves;
    Imf::FrameBuffer buffer;
    if (half) {
        halves.reserve(image.data.size());
        for (float v : image.data) halves.push_back(clamped_half(v));
    }
    for (int c = 0; c < image.channels; ++c) {
        const size_t size = half ? sizeof(::half) : sizeof(float);
        const char* base = half ? reinterpret_cast<const char*>(halves.data() + c)
                                : reinterpret_cast<const char*>(image.data.data() + c);
        buffer.insert(channels[c], Imf::Slice(half ? Imf::HALF : Imf::FLOAT, const_cast<char*>(base),
                                              size * image.channels, size * image.channels * image.width));
    }
    Imf::StdOSStream stream;
    {
        Imf::OutputFile file(stream, header);
        file.setFrameBuffer(buffer);
        file.writePixels(image.height);
    }  // its end writes the table of lines
    return stream.str();
}

}  // namespace

Status write_exr(const std::string& path, const Image& image, ExrType type,
                 const std::map<std::string, std::string>& attributes) {
    assert(image.channels == 1 || image.channels == 3 || image.channels == 4);
    try {
        return write_whole_file(path, encoded(image, type, attributes));
    } catch (const std::exception& e) {
        return fail("cannot write '" + path + "': " + words_of(e));
    }
}

}  // namespace ols

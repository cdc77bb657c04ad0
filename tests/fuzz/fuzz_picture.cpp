// SPDX-License-Identifier: MIT
// Picture files with bytes changed and cut off: a picture of the size it states, or an error. The first byte of an input chooses the kind of
// file, the second how much of it is left, then three bytes each change one.
// links: ols_photographs
#include <OpenImageIO/imageio.h>
#include <unistd.h>

#include <array>
#include <cstdint>
#include <cstdlib>
#include <fstream>
#include <iterator>
#include <string>
#include <vector>

#include "photographs/picture.hpp"

namespace {

const std::string path = "/dev/shm/fuzz_picture." + std::to_string(getpid());

std::string picture_file(const std::string& extension, const char* compression, OIIO::TypeDesc type) {
    const std::string name = path + extension;
    OIIO::ImageSpec spec(19, 13, 3, type);
    if (*compression) spec.attribute("compression", compression);
    spec.attribute("Orientation", 6);
    std::vector<float> pixels(19 * 13 * 3);
    for (size_t i = 0; i < pixels.size(); ++i) pixels[i] = float(i * 37 % 256) / 255;
    auto output = OIIO::ImageOutput::create(name);
    if (!output || !output->open(name, spec) || !output->write_image(OIIO::TypeDesc::FLOAT, pixels.data()))
        std::abort();
    output->close();
    std::ifstream stream(name, std::ios::binary);
    const std::string bytes{std::istreambuf_iterator<char>(stream), {}};
    unlink(name.c_str());
    return bytes;
}

const std::vector<std::string>& files() {
    using OIIO::TypeDesc;
    static const std::vector<std::string> all = {
        picture_file(".png", "", TypeDesc::UINT16),    picture_file(".jpg", "", TypeDesc::UINT8),
        picture_file(".tif", "zip", TypeDesc::UINT16), picture_file(".tif", "lzw", TypeDesc::UINT8),
        picture_file(".tif", "none", TypeDesc::FLOAT), picture_file(".bmp", "", TypeDesc::UINT8),
        picture_file(".tga", "rle", TypeDesc::UINT8),  picture_file(".webp", "", TypeDesc::UINT8),
        picture_file(".ppm", "", TypeDesc::UINT8),
    };
    return all;
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
    if (size < 2) return 0;
    std::string bytes = files()[data[0] % files().size()];
    if (data[1] < 128) bytes.resize(bytes.size() * data[1] / 128);
    for (size_t i = 2; i + 2 < size; i += 3)
        if (const size_t at = (data[i] << 8 | data[i + 1]) % (bytes.size() + 1); at < bytes.size())
            bytes[at] = char(data[i + 2]);
    const std::string name = path + (data[0] % files().size() == 6 ? ".tga" : "");
    std::ofstream(name, std::ios::binary).write(bytes.data(), std::streamsize(bytes.size()));
    const auto picture = ols::read_picture(name, {});
    if (!picture.ok()) return 0;
    const ols::Image& light = picture->light;
    if (light.width < 1 || light.height < 1 || light.data.size() != size_t(light.width) * light.height * light.channels)
        std::abort();
    return 0;
}

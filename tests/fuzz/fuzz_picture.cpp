// SPDX-License-Identifier: MIT
// Picture files with bytes changed and cut off: a picture of the size it states, or an error. The first byte of an input chooses the kind of
// file, the second how much of it is left, then three bytes each change one.
// links: ols_photographs
// smoke: 4000
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
    // OpenImageIO 2.4 writes HEIF as if all widths were multiples of 64.
    const bool is_heif = extension == ".heic" || extension == ".avif";
    OIIO::ImageSpec spec(is_heif ? 64 : 19, 13, 3, type);
    if (*compression) spec.attribute("compression", compression);
    spec.attribute("Orientation", 6);
    std::vector<float> pixels(spec.image_pixels() * 3);
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

// An entry of a TIFF directory whose value fits into it.
void entry(std::string& bytes, uint16_t tag, uint16_t type, uint32_t count, uint32_t value) {
    const auto put = [&](uint32_t v, int length) {
        for (int i = 0; i < length; ++i) bytes.push_back(char(v >> 8 * i));
    };
    put(tag, 2), put(type, 2), put(count, 4), put(value, 4);
}

// A camera's raw of 16 bits (DNG 1.4) with one directory, sensor samples behind it.
std::string dng_file() {
    constexpr int width = 64, height = 48, entries = 16;
    constexpr uint32_t directory = 8, matrix = directory + 2 + entries * 12 + 4, samples = matrix + 9 * 8;
    std::string bytes("II*\0\x08\0\0\0", 8);
    bytes += std::string{entries, 0};
    entry(bytes, 254, 4, 1, 0);
    entry(bytes, 256, 4, 1, width);
    entry(bytes, 257, 4, 1, height);
    entry(bytes, 258, 3, 1, 16);
    entry(bytes, 259, 3, 1, 1);
    entry(bytes, 262, 3, 1, 32803);
    entry(bytes, 273, 4, 1, samples);
    entry(bytes, 277, 3, 1, 1);
    entry(bytes, 278, 4, 1, height);
    entry(bytes, 279, 4, 1, width * height * 2);
    entry(bytes, 33421, 3, 2, 2 | 2 << 16);
    entry(bytes, 33422, 1, 4, 0x02010100);
    entry(bytes, 50706, 1, 4, 0x00000401);
    entry(bytes, 50708, 2, 4, 'O' | 'L' << 8 | 'S' << 16);
    entry(bytes, 50717, 3, 1, 4095);
    entry(bytes, 50721, 10, 9, matrix);
    bytes.append(4, '\0');  // no directory behind it
    for (int i = 0; i < 9; ++i) bytes += std::string{i % 4 == 0, 0, 0, 0, 1, 0, 0, 0};
    for (int i = 0; i < width * height; ++i) bytes += std::string{char(i * 37), char(i % 16)};
    return bytes;
}

const std::vector<std::string>& files() {
    using OIIO::TypeDesc;
    static const std::vector<std::string> all = {
        picture_file(".png", "", TypeDesc::UINT16),    picture_file(".jpg", "", TypeDesc::UINT8),
        picture_file(".tif", "zip", TypeDesc::UINT16), picture_file(".tif", "lzw", TypeDesc::UINT8),
        picture_file(".tif", "none", TypeDesc::FLOAT), picture_file(".bmp", "", TypeDesc::UINT8),
        picture_file(".tga", "rle", TypeDesc::UINT8),  picture_file(".webp", "", TypeDesc::UINT8),
        picture_file(".ppm", "", TypeDesc::UINT8),     picture_file(".heic", "", TypeDesc::UINT8),
        picture_file(".avif", "", TypeDesc::UINT8),    dng_file(),
    };
    return all;
}

}  // namespace

// libheif 1.15's decoders keep a damaged picture's memory, which its caller never gets to see; its encoder keeps some, too.
extern "C" const char* __lsan_default_suppressions() {
    return "leak:libdav1d\nleak:libde265\nleak:libheif\nleak:libx265\n";
}

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
    if (size < 2) return 0;
    std::string bytes = files()[data[0] % files().size()];
    if (data[1] < 128) bytes.resize(bytes.size() * data[1] / 128);
    for (size_t i = 2; i + 2 < size; i += 3)
        if (const size_t at = (data[i] << 8 | data[i + 1]) % (bytes.size() + 1); at < bytes.size())
            bytes[at] = char(data[i + 2]);
    const std::string name = path + (data[0] % files().size() == 6 ? ".tga" : "");
    std::ofstream(name, std::ios::binary).write(bytes.data(), std::streamsize(bytes.size()));
    const ols::PictureOptions options{.raw = data[0] < 128 ? ols::RawUse::mosaic : ols::RawUse::rgb};
    const auto picture = ols::read_picture(name, options);
    if (!picture.ok()) return 0;
    const ols::Image& light = picture->light;
    if (light.width < 1 || light.height < 1 || light.data.size() != size_t(light.width) * light.height * light.channels)
        std::abort();
    return 0;
}

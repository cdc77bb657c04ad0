// SPDX-License-Identifier: MIT
// Fuzzes the reader of OpenEXR pictures and through it the library: any bytes give a picture of its stated size, or an error that
// names the file. Inputs that say more than a megapixel are passed over: tests/unit/test_exr_files.py has those.
// links: ols_image
#include <ImfChannelList.h>
#include <ImfFrameBuffer.h>
#include <ImfHeader.h>
#include <ImfOutputFile.h>
#include <unistd.h>

#include <cstdint>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <string>
#include <string_view>
#include <vector>

#include "image/exr.hpp"

namespace {

namespace fs = std::filesystem;

const std::string& path_of_input() {
    static const std::string path = fs::temp_directory_path() / ("fuzz_exr_" + std::to_string(getpid()) + ".exr");
    return path;
}

// A good file in each compression, with overscan and chroma at every second pixel in every other one.
std::vector<std::string> good_files() {
    std::vector<std::string> files;
    for (int compression = 0; compression < Imf::NUM_COMPRESSION_METHODS; ++compression) {
        constexpr int width = 12, height = 8;
        std::vector<float> pixels(width * height);
        for (size_t i = 0; i < pixels.size(); ++i) pixels[i] = float(i % 7) / 4;
        Imf::Header header(Imath::Box2i({0, 0}, {9, 5}), Imath::Box2i({-2, 0}, {width - 3, height - 1}));
        header.compression() = Imf::Compression(compression);
        Imf::FrameBuffer buffer;
        const auto add = [&](const char* name, int sampling) {
            header.channels().insert(name, Imf::Channel(sampling == 2 ? Imf::HALF : Imf::FLOAT, sampling, sampling));
            char* origin = reinterpret_cast<char*>(pixels.data() + 2 / sampling);
            buffer.insert(name, Imf::Slice(sampling == 2 ? Imf::HALF : Imf::FLOAT, origin, sizeof(float),
                                           sizeof(float) * width, sampling, sampling));
        };
        const bool chroma = compression % 2 == 1;
        if (chroma)
            add("Y", 1), add("RY", 2), add("BY", 2);
        else
            add("R", 1), add("G", 1), add("B", 1), add("beauty.Y", 1);
        {
            Imf::OutputFile file(path_of_input().c_str(), header);
            file.setFrameBuffer(buffer);
            file.writePixels(height);
        }
        std::ifstream file(path_of_input(), std::ios::binary);
        files.emplace_back(std::istreambuf_iterator<char>(file), std::istreambuf_iterator<char>());
    }
    return files;
}

// The input as it is, or as changes of a good file: place (2 bytes) and value of each.
std::string file_of(const uint8_t* bytes, size_t size) {
    static const std::vector<std::string> good = good_files();
    if (size == 0) return "";
    if (bytes[0] >= good.size()) return {reinterpret_cast<const char*>(bytes) + 1, size - 1};
    std::string file = good[bytes[0]];
    for (size_t i = 1; i + 2 < size; i += 3) {
        const size_t place = size_t(bytes[i]) + 256 * size_t(bytes[i + 1]);
        file[place % file.size()] = char(bytes[i + 2]);
    }
    return file;
}

// Four signed numbers behind the name and type of a window, wherever it stands in the file.
bool says_more_than_a_megapixel(const std::string& file) {
    using namespace std::string_view_literals;
    for (const auto name : {"dataWindow\0box2i\0"sv, "displayWindow\0box2i\0"sv})
        for (size_t at = file.find(name); at != std::string::npos; at = file.find(name, at + 1)) {
            const size_t box = at + name.size() + 4;
            if (box + 16 > file.size()) continue;
            int32_t w[4];
            std::memcpy(w, file.data() + box, sizeof w);
            if ((double(w[2]) - w[0] + 1) * (double(w[3]) - w[1] + 1) > 1e6) return true;
        }
    return false;
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* bytes, size_t size) {
    const std::string input = file_of(bytes, size);
    if (says_more_than_a_megapixel(input)) return 0;
    std::ofstream(path_of_input(), std::ios::binary) << input;
    const auto picture = ols::read_exr_picture(path_of_input());
    if (!picture) {
        if (picture.error().message.find(path_of_input()) == std::string::npos) abort();
        return 0;
    }
    const ols::Image& image = picture->pixels;
    if (image.data.empty() || image.data.size() != size_t(image.width) * image.height * image.channels) abort();
    return 0;
}

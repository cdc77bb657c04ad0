// SPDX-License-Identifier: MIT
// Fuzzes the reader of Radiance pictures: any bytes behind "#?", or behind a good header, give a picture of the size they state, or
// an error that names the file. Inputs that say more than a megapixel are passed over: tests/unit/test_radiance_files.py has those.
// links: ols_image
#include <unistd.h>

#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <sstream>
#include <string>

#include "image/radiance.hpp"

namespace {

bool says_more_than_a_megapixel(const std::string& file) {
    std::istringstream lines(file);
    for (std::string line; std::getline(lines, line);) {
        char signs[4];
        double first = 0, second = 0;
        if (std::sscanf(line.c_str(), " %c%c %lf %c%c %lf", &signs[0], &signs[1], &first, &signs[2], &signs[3],
                        &second) == 6 &&
            first * second > 1e6)
            return true;
    }
    return false;
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* bytes, size_t size) {
    static const std::string path =
        std::filesystem::temp_directory_path() / ("fuzz_radiance_" + std::to_string(getpid()) + ".hdr");
    if (size == 0) return 0;
    const std::string rest(reinterpret_cast<const char*>(bytes) + 1, size - 1);
    static const char* const starts[] = {"#?", "#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 2 +X 9\n",
                                         "#?RADIANCE\nFORMAT=32-bit_rle_xyze\n\n+X 9 +Y 3\n", "#?RADIANCE\n"};
    const std::string input = starts[bytes[0] % std::size(starts)] + rest;
    if (says_more_than_a_megapixel(input)) return 0;
    std::ofstream(path, std::ios::binary) << input;
    const auto picture = ols::read_radiance(path);
    if (!picture) {
        if (picture.error().message.find(path) == std::string::npos) abort();
        return 0;
    }
    const ols::Image& image = picture->pixels;
    if (image.data.empty() || image.data.size() != size_t(image.width) * image.height * 3) abort();
    return 0;
}

// SPDX-License-Identifier: MIT
// Fuzzes the TGA reader: any bytes give a picture of the size the header states, or an error.
// links: ols_image
#include <unistd.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>

#include "image/tga.hpp"

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* bytes, size_t size) {
    static const std::string path =
        std::filesystem::temp_directory_path() / ("fuzz_tga_" + std::to_string(getpid()) + ".tga");
    std::ofstream(path, std::ios::binary).write(reinterpret_cast<const char*>(bytes), std::streamsize(size));
    const auto image = ols::read_tga(path);
    if (image && image->data.size() != size_t(image->width) * image->height * image->channels) abort();
    if (image && image->data.empty()) abort();
    return 0;
}

// SPDX-License-Identifier: MIT
// Any bytes as an .lp file: lights that can be, or an error.
// links: ols_stage
#include <unistd.h>

#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <fstream>
#include <string>

#include "stage/light_file.hpp"

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
    static const std::string path = "/dev/shm/fuzz_light_file." + std::to_string(getpid());
    std::ofstream(path, std::ios::binary).write(reinterpret_cast<const char*>(data), std::streamsize(size));
    const auto file = ols::read_light_file(path);
    if (!file.ok()) return 0;
    if (file->lights.empty() || file->lines.size() != file->lights.size()) std::abort();
    for (const auto& light : file->lights)
        if (!(std::abs(ols::length(light.direction) - 1) < 1e-9)) std::abort();
    return 0;
}

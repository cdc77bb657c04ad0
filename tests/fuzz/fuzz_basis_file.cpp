// SPDX-License-Identifier: MIT
// Fuzzes the reader of basis files: any bytes give a basis of whole rows whose levels fit its level_max, or an error.
// links: ols_stage
#include <unistd.h>

#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <fstream>

#include "stage/basis_file.hpp"

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* bytes, size_t size) {
    static const std::string path =
        std::filesystem::temp_directory_path() / ("fuzz_basis_" + std::to_string(getpid()) + ".csv");
    std::ofstream(path, std::ios::binary).write(reinterpret_cast<const char*>(bytes), std::streamsize(size));
    const auto basis = ols::read_basis(path, 3);
    if (!basis.ok()) return 0;
    if (basis->levels.size() != size_t(basis->rows) * 3 || basis->images() < 1) abort();
    for (const uint8_t level : basis->levels)
        if (level > basis->level_max) abort();
    for (const double weight : basis->matrix)
        if (!std::isfinite(weight)) abort();
    return 0;
}

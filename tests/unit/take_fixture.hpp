// SPDX-License-Identifier: MIT
// A place for a take, and takes whose every sample is known: shared by the tests of archives.
#pragma once

#include <gtest/gtest.h>
#include <unistd.h>

#include <algorithm>
#include <filesystem>
#include <string>

#include "archive/archive.hpp"

namespace ols::test {

// A fresh name for an archive in a directory of its own, removed afterwards.
class TakeDirectory : public testing::Test {
  protected:
    void SetUp() override {
        std::string pattern = (std::filesystem::temp_directory_path() / "take_XXXXXX").string();
        ASSERT_NE(mkdtemp(pattern.data()), nullptr);
        directory = pattern;
        path = directory + "/take.rfa";
    }
    void TearDown() override { std::filesystem::remove_all(directory); }

    std::string directory, path;
};

inline TakeInfo take_info(int lamps) {
    TakeInfo info;
    info.basis = "s159";
    info.value_unit = "reflectance";
    for (int i = 0; i < lamps; ++i)
        info.lights.push_back({lamp_layer(i, lamps), normalized({0.1 * i + 0.3, 1.0 - 0.01 * i, 0.5})});
    return info;
}

// Lamp values that half floats hold exactly and that differ between lamps, pixels and targets.
inline float numbered_value(int plane, size_t pixel, uint32_t index) {
    return float(int((plane * 37 + pixel * 11 + index * 101) % 2048) - 300) / 1024;
}

inline Target numbered_target(int lamps, int width, int height, Cfa cfa, uint32_t index) {
    Target target;
    target.index = index;
    target.width = width;
    target.height = height;
    target.cfa = cfa;
    const size_t pixels = size_t(width) * height;
    for (int plane = 0; plane < lamps * target.planes(); ++plane) {
        target.lamps.emplace_back(pixels);
        for (size_t p = 0; p < pixels; ++p) target.lamps.back()[p] = numbered_value(plane, p, index);
    }
    for (size_t p = 0; p < pixels; ++p) {
        target.mask.push_back(p % 7 == 0 ? uint32_t(mask_saturated) : 0);
        target.variance.push_back(1e-9f * float(p));
    }
    target.missing_lamps = {int(index) % lamps};
    target.provenance = {{"cycle", index}, {"tick", 57870 * 180 * uint64_t(index)}};
    return target;
}

}  // namespace ols::test

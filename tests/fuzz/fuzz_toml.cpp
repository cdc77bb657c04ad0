// SPDX-License-Identifier: MIT
// Fuzzes the readers of stage.toml and sequence files: any bytes give a stage whose numbers are what its readers count on, or an
// error with the file's name.
// links: ols_stage
#include <unistd.h>

#include <array>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <string>

#include "stage/sequence.hpp"
#include "stage/stage.hpp"
#include "words.hpp"

namespace {

void expect(bool truth) {
    if (!truth) abort();
}

// What bytes of 0x80 and above stand for.
constexpr std::array<const char*, 32> words = {"[lamps]\n",
                                               "[chain]\n",
                                               "[[camera]]\n",
                                               "[[lamps.matte]]\n",
                                               "[[slot]]\n",
                                               "[[trigger]]\n",
                                               "position_m = ",
                                               "look_at_m = ",
                                               "up = ",
                                               "width = ",
                                               "height = ",
                                               "radius_m = ",
                                               "bits = ",
                                               "bit_of_lamp = ",
                                               "frequency_hz = ",
                                               "1e308",
                                               "nan",
                                               "-inf",
                                               "9223372036854775807",
                                               "[0, 0, 1]",
                                               "[1e6, 0, -1]",
                                               "white = ",
                                               "black = ",
                                               "lamps = ",
                                               "levels = ",
                                               "= [{",
                                               "{a = ",
                                               "\n",
                                               "vertical_fov_deg = ",
                                               "basis = ",
                                               "exposure_us = ",
                                               "\"\"\""};

void check_camera(const ols::CameraConfig& camera) {
    double view = 0, up = 0, across = 0;
    for (size_t i = 0; i < 3; ++i) {
        const double d = camera.look_at_m[i] - camera.position_m[i];
        const size_t j = (i + 1) % 3;
        const double e = camera.look_at_m[j] - camera.position_m[j];
        view += d * d;
        up += camera.up[i] * camera.up[i];
        across += std::pow(d * camera.up[j] - e * camera.up[i], 2);
    }
    expect(view > 0 && up > 0 && across > 0 && std::isfinite(view + up + across));
    expect(camera.width > 0 && camera.height > 0 && camera.black < camera.white);
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* bytes, size_t size) {
    static const std::string path =
        std::filesystem::temp_directory_path() / ("fuzz_toml_" + std::to_string(getpid()) + ".toml");
    if (size == 0) return 0;
    const std::string text =
        bytes[0] % 2 == 0 ? std::string(bytes + 1, bytes + size) : with_words({bytes + 1, size - 1}, words);
    std::ofstream(path, std::ios::binary) << text;
    if (bytes[0] % 4 < 2) {
        const auto stage = ols::read_stage(path);
        if (!stage.ok()) return expect(stage.error().message.find(path) != std::string::npos), 0;
        expect(stage->lamp_count() > 0 && std::isfinite(stage->radius_m));
        for (const auto& camera : stage->cameras) check_camera(camera);
    } else {
        const auto sequence = ols::read_sequence(path);
        if (!sequence.ok()) expect(sequence.error().message.find(path) != std::string::npos);
    }
    return 0;
}

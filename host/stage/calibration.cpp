// SPDX-License-Identifier: MIT
// Calibration folders.
#include "stage/calibration.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <filesystem>

#include "image/exr.hpp"
#include "image/whole_file.hpp"
#include "stage/toml_section.hpp"

namespace ols {

namespace {

constexpr const char* remedy = "run `stagectl calibrate` again";

std::string camera_folder(const std::string& folder, size_t camera) {
    return fmt::format("{}/cam{}", folder, camera);
}

Result<Image> read_plane(const std::string& path, const CameraConfig& camera, float smallest) {
    auto picture = read_exr_picture(path);
    if (!picture.ok()) return fail(picture.error().message + "; " + remedy);
    if (!picture->said.empty())
        return fail(fmt::format("'{}' is not as stagectl wrote it ({}): {}", path, picture->said.front(), remedy));
    Image image = std::move(picture->pixels);
    const int channels = samples_per_pixel(camera.cfa);
    if (image.width != camera.width || image.height != camera.height || image.channels != channels)
        return fail(fmt::format("'{}' has {} x {} x {} samples and the camera {} x {} x {}: {}", path, image.width,
                                image.height, image.channels, camera.width, camera.height, channels, remedy));
    for (const float value : image.data)
        if (!std::isfinite(value) || value < smallest)
            return fail(fmt::format("'{}' holds the value {}: {}", path, value, remedy));
    return image;
}

Image filled(const CameraConfig& camera, double value) {
    Image image(camera.width, camera.height, samples_per_pixel(camera.cfa));
    std::fill(image.data.begin(), image.data.end(), float(value));
    return image;
}

}  // namespace

Result<Calibration> read_calibration(const std::string& folder, const StageConfig& stage) {
    Calibration calibration{folder, {}};
    for (size_t c = 0; c < stage.cameras.size(); ++c) {
        const std::string of_camera = camera_folder(folder, c);
        auto file = TomlSection::open(of_camera + "/calibration.toml");
        if (!file.ok())
            return fail(fmt::format("camera {} is not calibrated: {}; {}", c, file.error().message, remedy));
        CalibrationRecord record;
        file->read("card_reflectance", record.card_reflectance, 0, 1);
        file->read("card_exposure_us", record.card_exposure_us, 0, 1e9);
        file->read("frames", record.frames, 1, 1'000'000'000);
        if (const Status status = file->finish(); !status.ok()) return status.error();
        auto black = read_plane(of_camera + "/black.exr", stage.cameras[c], -1e6f);
        if (!black.ok()) return black.error();
        auto flat = read_plane(of_camera + "/flat.exr", stage.cameras[c], 1e-9f);
        if (!flat.ok()) return flat.error();
        calibration.cameras.push_back({std::move(*black), std::move(*flat)});
    }
    return calibration;
}

Status write_calibration(const std::string& folder, size_t camera, const CameraCalibration& calibration,
                         const CalibrationRecord& record) {
    const std::string of_camera = camera_folder(folder, camera), facts = of_camera + "/calibration.toml";
    std::error_code error;
    std::filesystem::create_directories(of_camera, error);
    if (error) return fail(fmt::format("cannot make folder '{}': {}", of_camera, error.message()));
    std::filesystem::remove(facts, error);
    if (error) return fail(fmt::format("cannot replace '{}': {}", facts, error.message()));
    if (Status s = write_exr(of_camera + "/black.exr", calibration.black, ExrType::single_float); !s.ok()) return s;
    if (Status s = write_exr(of_camera + "/flat.exr", calibration.flat, ExrType::single_float); !s.ok()) return s;
    return write_whole_file(facts, fmt::format("card_reflectance = {}\ncard_exposure_us = {}\nframes = {}\n",
                                               record.card_reflectance, record.card_exposure_us, record.frames));
}

Calibration nominal_calibration(const StageConfig& stage) {
    Calibration calibration{"nominal", {}};
    for (const CameraConfig& camera : stage.cameras)
        calibration.cameras.push_back({filled(camera, camera.black), filled(camera, camera.counts_per_us)});
    return calibration;
}

}  // namespace ols

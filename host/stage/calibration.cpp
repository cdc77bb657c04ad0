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
    auto file = TomlSection::open(folder + "/calibration.toml");
    if (!file.ok()) return fail(file.error().message + "; " + remedy);
    CalibrationRecord record;
    int cameras = 0;
    file->read("cameras", cameras, 1, 1000);
    file->read("card_reflectance", record.card_reflectance, 0, 1);
    file->read("card_exposure_us", record.card_exposure_us, 0, 1e9);
    file->read("frames", record.frames, 1, 1'000'000'000);
    if (const Status status = file->finish(); !status.ok()) return status.error();
    if (cameras != int(stage.cameras.size()))
        return fail(fmt::format("'{}' calibrates {} cameras and the stage has {}: {}", folder, cameras,
                                stage.cameras.size(), remedy));
    Calibration calibration{folder, {}};
    for (size_t c = 0; c < stage.cameras.size(); ++c) {
        auto black = read_plane(camera_folder(folder, c) + "/black.exr", stage.cameras[c], -1e6f);
        if (!black.ok()) return black.error();
        auto flat = read_plane(camera_folder(folder, c) + "/flat.exr", stage.cameras[c], 1e-9f);
        if (!flat.ok()) return flat.error();
        calibration.cameras.push_back({std::move(*black), std::move(*flat)});
    }
    return calibration;
}

Status write_calibration(const std::string& folder, const Calibration& calibration, const CalibrationRecord& record) {
    std::error_code error;
    std::filesystem::remove(folder + "/calibration.toml", error);
    for (size_t c = 0; c < calibration.cameras.size(); ++c) {
        const std::string camera = camera_folder(folder, c);
        std::filesystem::create_directories(camera, error);
        if (error) return fail(fmt::format("cannot make folder '{}': {}", camera, error.message()));
        const CameraCalibration& planes = calibration.cameras[c];
        if (Status s = write_exr(camera + "/black.exr", planes.black, ExrType::single_float); !s.ok()) return s;
        if (Status s = write_exr(camera + "/flat.exr", planes.flat, ExrType::single_float); !s.ok()) return s;
    }
    return write_whole_file(
        folder + "/calibration.toml",
        fmt::format("cameras = {}\ncard_reflectance = {}\ncard_exposure_us = {}\nframes = {}\n",
                    calibration.cameras.size(), record.card_reflectance, record.card_exposure_us, record.frames));
}

Calibration nominal_calibration(const StageConfig& stage) {
    Calibration calibration{"nominal", {}};
    for (const CameraConfig& camera : stage.cameras)
        calibration.cameras.push_back({filled(camera, camera.black), filled(camera, camera.counts_per_us)});
    return calibration;
}

}  // namespace ols

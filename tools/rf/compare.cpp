// SPDX-License-Identifier: MIT
// rf compare: error figures of one image against another.
#include "image/compare.hpp"

#include <fmt/format.h>

#include <cmath>
#include <memory>
#include <nlohmann/json.hpp>

#include "image/exr.hpp"
#include "program.hpp"
#include "verbs.hpp"

namespace ols {

namespace {

struct Options {
    std::string image, reference;
    double peak = 0;
    bool json = false;
};

// JSON has no infinity: an exact match has a PSNR of null.
nlohmann::json finite_or_null(double value) {
    return std::isfinite(value) ? nlohmann::json(value) : nlohmann::json(nullptr);
}

Result<Image> read_and_warn(const std::string& path, std::vector<std::string>& warnings) {
    auto picture = read_exr_picture(path);
    if (!picture) return picture.error();
    for (const auto& warning : picture->said) {
        warnings.push_back(path + ": " + warning);
        fmt::print(stderr, "rf compare: {}\n", warnings.back());
    }
    return std::move(picture->pixels);
}

Status run(const Options& options) {
    std::vector<std::string> warnings;
    const auto image = read_and_warn(options.image, warnings);
    if (!image) return image.error();
    const auto reference = read_and_warn(options.reference, warnings);
    if (!reference) return reference.error();
    if (image->width != reference->width || image->height != reference->height ||
        std::min(image->channels, 3) != std::min(reference->channels, 3))
        return fail(fmt::format("'{}' is {} x {} with {} channels, '{}' {} x {} with {}: compare images of one size",
                                options.image, image->width, image->height, image->channels, options.reference,
                                reference->width, reference->height, reference->channels));
    const auto d = image_difference(*image, *reference, options.peak);
    if (options.json) {
        const nlohmann::json report = {{"psnr_db", finite_or_null(d.psnr_db)},
                                       {"peak", finite_or_null(d.peak)},
                                       {"rms", finite_or_null(d.rms)},
                                       {"max_error", finite_or_null(d.max_error)},
                                       {"mean_relative", finite_or_null(d.mean_relative)},
                                       {"bias_relative", finite_or_null(d.bias_relative)},
                                       {"equal", d.max_error == 0},
                                       {"warnings", warnings}};
        print_json(report);
    } else {
        fmt::print("PSNR {:.2f} dB (peak {:.6g}), largest error {:.6g}, mean error {:.4f} %, bias {:+.4f} %\n",
                   d.psnr_db, d.peak, d.max_error, 100 * d.mean_relative, 100 * d.bias_relative);
    }
    return Done{};
}

}  // namespace

void add_compare_verb(CLI::App& app, int& exit_code) {
    auto options = std::make_shared<Options>();
    CLI::App* verb = app.add_subcommand("compare", "print how far one OpenEXR image is from another");
    verb->footer("Example: rf compare relit.exr truth.exr --json");
    verb->add_option("image", options->image, "the image to judge")->required();
    verb->add_option("reference", options->reference, "the truth")->required();
    verb->add_option("--peak", options->peak, "value the PSNR is relative to (default: the reference's maximum)")
        ->check(CLI::PositiveNumber);
    verb->add_flag("--json", options->json, "print JSON; an infinite PSNR is null");
    verb->callback([options, &exit_code] {
        const auto status = run(*options);
        if (status) return;
        fmt::print(stderr, "rf compare: {}\n", status.error().message);
        exit_code = 1;
    });
}

}  // namespace ols

// SPDX-License-Identifier: MIT
// stagesim flow: where each pixel's surface goes between two moments, the truth that estimated flow is held against.
#include <fmt/format.h>

#include <cmath>
#include <nlohmann/json.hpp>

#include "image/outputs.hpp"
#include "program.hpp"
#include "render/true_flow.hpp"
#include "run/inputs.hpp"
#include "verbs.hpp"

namespace ols {

namespace {

struct FlowOptions {
    InputOptions inputs;
    double from_us = 0, to_us = 0;
    std::string out;
    bool json = false;
};

Status flow(const FlowOptions& options) {
    const auto inputs = read_inputs(options.inputs);
    if (!inputs) return inputs.error();
    const Status writable =
        check_outputs({.inputs = {options.inputs.scene, options.inputs.stage}, .files = {options.out}});
    if (!writable) return writable;
    const TrueFlow truth = true_flow(inputs->scene, inputs->camera, options.from_us, options.to_us);
    if (const Status s = write_true_flow(options.out, truth, options.from_us, options.to_us); !s) return s;

    double longest = 0, sum = 0;
    size_t seen = 0, visible = 0;
    for (size_t i = 0; i < truth.flow.size(); ++i) {
        if (std::isnan(truth.flow.u[i])) continue;
        ++seen;
        visible += truth.visible[i];
        const double pixels = std::hypot(truth.flow.u[i], truth.flow.v[i]);
        longest = std::max(longest, pixels);
        sum += pixels;
    }
    const double mean = seen > 0 ? sum / double(seen) : 0;
    if (options.json)
        print_json({{"subject_pixels", seen},
                    {"hidden_or_left_pixels", seen - visible},
                    {"longest_px", longest},
                    {"mean_px", mean}});
    else
        fmt::print(
            "{} pixels of subject; they move by {:.2f} px in the mean, {:.2f} px at most; {} are hidden at the end "
            "or have left the image\n",
            seen, mean, longest, seen - visible);
    return Done{};
}

}  // namespace

void add_flow_verb(CLI::App& app, int& exit_code) {
    auto options = std::make_shared<FlowOptions>();
    CLI::App* verb = app.add_subcommand("flow", "write the true flow between two moments of a moving scene");
    verb->footer(
        "The EXR has two parts: flow (forward.u to the right and forward.v downwards, in pixels; NaN where nothing is "
        "seen) and mask (visible: 1 where the same point is still seen at the end).\nA cycle of 180 slots at 2160 Hz "
        "lasts 83333 us.\nExample: stagesim flow tools/stagesim/scenes/motion_turn60.toml --from-us 0 --to-us 83333 -o "
        "flow.exr");
    add_input_options(*verb, options->inputs);
    verb->add_option("--from-us", options->from_us, "the moment whose pixels are followed")
        ->required()
        ->check(number_from(-1e12, 1e12));
    verb->add_option("--to-us", options->to_us, "the moment at which they are found again")
        ->required()
        ->check(number_from(-1e12, 1e12));
    verb->add_option("-o,--out", options->out, "EXR file")->required();
    verb->add_flag("--json", options->json, "say what was found as JSON");
    verb->callback([options, &exit_code] {
        const Status status = flow(*options);
        if (status) return;
        fmt::print(stderr, "stagesim flow: {}\n", status.error().message);
        exit_code = 1;
    });
}

}  // namespace ols

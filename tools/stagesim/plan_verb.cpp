// SPDX-License-Identifier: MIT
// stagesim plan: which effects a scene calls for, who calls, and what they will cost.
#include <fmt/format.h>

#include <fstream>

#include "program.hpp"
#include "run/inputs.hpp"
#include "run/plan.hpp"
#include "verbs.hpp"

namespace ols {

namespace {

struct PlanOptions {
    InputOptions inputs;
    std::string work;
    bool camera_model = true, json = false;
};

Result<nlohmann::json> read_cost(const std::string& work) {
    const std::string path = work + "/cost.json";
    std::ifstream file(path);
    auto cost = nlohmann::json::parse(file, nullptr, false);
    if (!file || cost.is_discarded() || !cost.contains("actual"))
        return fail("'" + path + "' holds no cost of a run: give the --work folder of a `stagesim run` that ended");
    return std::move(cost["actual"]);
}

Status plan(const PlanOptions& options) {
    const auto inputs = read_inputs(options.inputs);
    if (!inputs) return inputs.error();
    nlohmann::json actual;
    if (!options.work.empty()) {
        auto cost = read_cost(options.work);
        if (!cost) return cost.error();
        actual = std::move(*cost);
    }
    const nlohmann::json foretold = foretell(inputs->setup(options.camera_model), options.inputs.disabled_set());
    if (options.json)
        print_json({{"foretold", foretold}, {"actual", actual}}, 2);
    else
        fmt::print("{}", plan_text(foretold, actual));
    return Done{};
}

}  // namespace

void add_plan_verb(CLI::App& app, int& exit_code) {
    auto options = std::make_shared<PlanOptions>();
    CLI::App* verb = app.add_subcommand("plan", "say which effects a scene calls for, who calls, and what they cost");
    verb->footer("Example: stagesim plan tools/stagesim/scenes/head.toml");
    add_input_options(*verb, options->inputs);
    verb->add_option("--work", options->work, "folder of an ended run: its actual cost is shown beside");
    verb->add_flag("--camera-model,!--no-camera-model", options->camera_model, "with the sensor's effects (default)");
    verb->add_flag("--json", options->json, "print JSON");
    verb->callback([options, &exit_code] {
        if (const Status status = plan(*options); !status) {
            fmt::print(stderr, "stagesim plan: {}\n", status.error().message);
            exit_code = 1;
        }
    });
}

}  // namespace ols

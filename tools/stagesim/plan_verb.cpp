// SPDX-License-Identifier: MIT
// stagesim plan: which effects a scene calls for, who calls, and what they will cost.
#include <fmt/format.h>

#include <fstream>
#include <iterator>
#include <limits>

#include "image/json_object.hpp"
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

// What plan_text() looks up.
Status check_cost(const nlohmann::json& cost, const std::string& path, size_t effects) {
    constexpr uint64_t count_max = std::numeric_limits<int64_t>::max();
    JsonObject file(cost, "'" + path + "'");
    JsonObject actual = file.object("actual");
    for (const char* key : {"exposures", "placings"}) (void)actual.count(key, count_max);
    JsonObject seconds = actual.object("seconds");
    for (const char* key : {"build", "visibility", "lamps", "exposure"}) (void)seconds.number(key, 0, 1e12);
    auto evaluated = actual.objects("effects");
    for (JsonObject& effect : evaluated) (void)effect.count("evaluations", count_max);
    if (evaluated.size() != effects) actual.reject("effects", "is of another version of stagesim");
    return file.first_error();
}

Result<nlohmann::json> read_cost(const std::string& work, size_t effects) {
    const std::string path = work + "/cost.json";
    std::ifstream file(path, std::ios::binary);
    const std::string text{std::istreambuf_iterator<char>(file), {}};
    if (!file)
        return fail("'" + path + "' holds no cost of a run: give the --work folder of a `stagesim run` that ended");
    auto cost = parse_json(text, "'" + path + "'");
    if (!cost) return cost;
    if (const Status checked = check_cost(*cost, path, effects); !checked) return checked.error();
    return std::move((*cost)["actual"]);
}

Status plan(const PlanOptions& options) {
    const auto inputs = read_inputs(options.inputs);
    if (!inputs) return inputs.error();
    const nlohmann::json foretold = foretell(inputs->setup(options.camera_model), options.inputs.disabled_set());
    nlohmann::json actual;
    if (!options.work.empty()) {
        auto cost = read_cost(options.work, foretold["effects"].size());
        if (!cost) return cost.error();
        actual = std::move(*cost);
    }
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

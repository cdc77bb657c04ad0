// SPDX-License-Identifier: MIT
// stagectl basis design: searches for the basis of least noise for a camera, a light level and limits.
#include <fmt/format.h>

#include <cmath>
#include <nlohmann/json.hpp>

#include "image/outputs.hpp"
#include "program.hpp"
#include "stage/basis_file.hpp"
#include "stage/camera_presets.hpp"
#include "stage/design_search.hpp"
#include "stage/noise_bound.hpp"
#include "stagectl/session.hpp"
#include "stagectl/verbs.hpp"

namespace ols {

namespace {

struct Options {
    std::string stage, camera = "phantom_v7.1", subject = "cosine", output;
    double counts = 0, card_counts = 0, white_margin = 0.02, max_lit = 0, max_duty = 0.75, worst = 0;
    int rows = 159;
    DesignOptions search;
    bool json = false;
};

// What a basis leaves of noise within the same limits, at the exposure that they allow.
struct Compared {
    std::string name;
    int rows = 0;
    double exposure = 1, cost = 0, mean_variance = 0, worst_variance = 0;
    double lit_min = 0, lit_max = 0;  // the sum of levels of a row
};

Compared compare(const std::string& name, const DesignProblem& problem, const Light& light) {
    Compared compared{name, int(light.rows())};
    compared.exposure = exposure_share(problem, light);
    const DesignCost cost = design_cost(problem, compared.exposure * light);
    compared.cost = cost.cost;
    if (!std::isfinite(cost.cost)) return compared;
    compared.mean_variance = cost.covariance.diagonal().mean();
    compared.worst_variance = cost.covariance.diagonal().maxCoeff();
    compared.lit_min = light.rowwise().sum().minCoeff();
    compared.lit_max = light.rowwise().sum().maxCoeff();
    return compared;
}

// A preset's name, or the first camera of a stage file.
Result<CameraConfig> find_camera(const std::string& name) {
    if (name.ends_with(".toml")) {
        const auto stage = read_stage(name);
        if (!stage.ok()) return stage.error();
        if (stage->cameras.empty()) return fail(name + ": has no [[camera]]");
        return stage->cameras[0];
    }
    const auto preset = find_camera_preset(name);
    if (!preset.ok()) return preset.error();
    CameraConfig camera;
    camera.bits = preset->bits;
    camera.noise = preset->noise;
    camera.white = double((1 << preset->bits) - 1);
    return camera;
}

Result<DesignProblem> pose(const Options& options, const StageConfig& stage) {
    const auto camera = find_camera(options.camera);
    if (!camera.ok()) return camera.error();
    DesignProblem problem;
    problem.noise = camera->noise;
    problem.white_counts = (camera->white - camera->black) * (1 - options.white_margin);
    problem.subjects = options.subject == "equal" ? equal_subject(int(stage.lamps.size()), options.counts)
                                                  : cosine_subjects(stage.lamps, options.counts);
    if (options.card_counts > 0) problem.cards = problem.subjects * (options.card_counts / options.counts);
    problem.rows = options.rows;
    problem.worst = options.worst;
    problem.brightness_max = options.max_lit;
    problem.duty_max = options.max_duty;
    return problem;
}

std::vector<Compared> compare_all(const DesignProblem& problem, const Design& design, const StageConfig& stage) {
    std::vector<Compared> all = {compare("designed", problem, design.light)};
    for (const std::string name : {"single", "triangle300", "hadamard156", "s159"})
        if (const auto basis = find_basis(name, stage.lamps); basis.ok())
            all.push_back(compare(name, problem, light_of(*basis)));
    return all;
}

// Theory's least for lamps that are all alike.
NoiseBound bound_of(const Options& options, const DesignProblem& problem) {
    BoundProblem bound{problem.lamps(), problem.rows, options.counts, problem.noise, problem.brightness_max};
    if (options.card_counts > 0) {
        const double unsaturated = problem.white_counts / options.card_counts;
        bound.brightness_max = bound.brightness_max > 0 ? std::min(bound.brightness_max, unsaturated) : unsaturated;
    }
    return noise_bound(bound);
}

nlohmann::json to_json(const std::vector<Compared>& all, const Design& design, const DesignProblem& problem,
                       const Options& options) {
    auto subjects = nlohmann::json::array();
    for (Eigen::Index k = 0; k < problem.subjects.rows(); ++k) {
        const Eigen::VectorXd lamps = problem.subjects.row(k);
        subjects.push_back(std::vector<double>(lamps.begin(), lamps.end()));
    }
    auto bases = nlohmann::json::array();
    for (const auto& basis : all)
        bases.push_back({{"name", basis.name},
                         {"rows", basis.rows},
                         {"exposure_share", basis.exposure},
                         {"mean_variance", basis.mean_variance},
                         {"worst_variance", basis.worst_variance},
                         {"gain_over_single", std::sqrt(all[1].cost / basis.cost)},
                         {"lit_min", basis.lit_min},
                         {"lit_max", basis.lit_max}});
    return {{"output", options.output},   {"start", design.start}, {"counts", options.counts},
            {"subject", options.subject}, {"subjects", subjects},  {"bases", bases}};
}

void print_table(const std::vector<Compared>& all, const Design& design) {
    fmt::print("found from {}\n", design.start);
    fmt::print("{:12} {:>5} {:>9} {:>12} {:>12} {:>13}  {}\n", "basis", "rows", "exposure", "sigma, mean", "worst lamp",
               "SNR / single", "lamps lit a row");
    for (const auto& basis : all)
        fmt::print("{:12} {:5} {:8.1f}% {:12.3f} {:12.3f} {:13.3f}  {:.4g} to {:.4g}\n", basis.name, basis.rows,
                   basis.exposure * 100, std::sqrt(basis.mean_variance), std::sqrt(basis.worst_variance),
                   std::sqrt(all[1].cost / basis.cost), basis.lit_min, basis.lit_max);
}

Result<int> run(const Options& options) {
    const Status writable = check_outputs({.inputs = {options.stage, options.camera}, .files = {options.output}});
    if (!writable.ok()) return writable.error();
    const auto stage = options.stage.empty() ? Result<StageConfig>(default_stage()) : read_stage(options.stage);
    if (!stage.ok()) return stage.error();
    const auto problem = pose(options, *stage);
    if (!problem.ok()) return problem.error();
    const auto design = design_basis(*problem, options.search, [](double share, double) {
        show_progress("designing", uint64_t(share * 1000), 1000);
    });
    if (!design.ok()) return design.error();
    const auto basis = basis_of(*design, "designed");
    if (!basis.ok()) return basis.error();
    const std::string comment = fmt::format("for {} counts a lamp ({} subjects), camera {}; found from {}",
                                            options.counts, options.subject, options.camera, design->start);
    if (const Status status = write_basis(options.output, *basis, comment); !status.ok()) return status.error();

    const auto all = compare_all(*problem, *design, *stage);
    auto json = to_json(all, *design, *problem, options);
    if (options.subject == "equal") json["bound_mean_variance"] = bound_of(options, *problem).mean_variance;
    if (options.json) {
        print_json(json);
        return 0;
    }
    print_table(all, *design);
    if (options.subject == "equal" && options.worst == 0) {
        const NoiseBound bound = bound_of(options, *problem);
        fmt::print("{:12} {:5} {:>9} {:12.3f} {:>12} {:13.3f}  {:.4g}\n", "lower bound", options.rows, "",
                   std::sqrt(bound.mean_variance), "", std::sqrt(all[1].cost / bound.mean_variance), bound.lit);
    }
    fmt::print("written to {}\n", options.output);
    return 0;
}

}  // namespace

void add_basis_design_verb(CLI::App& basis, int& exit_code) {
    auto options = std::make_shared<Options>();
    CLI::App* verb = basis.add_subcommand("design", "search for the basis of least noise, within limits");
    verb->footer(
        "Example: stagectl basis design --camera phantom_v7.1 --counts 50 -o designed.csv\n"
        "         stagectl run --basis designed.csv ...\n"
        "The same options find the same basis. What the figures mean: docs/bases.md.");
    verb->add_option("--counts", options->counts, "that a lamp at full level gives a subject facing it, above black")
        ->required()
        ->check(CLI::Range(1e-3, 1e6));
    verb->add_option("--camera", options->camera, "a camera preset, or a stage.toml with a camera")
        ->capture_default_str();
    verb->add_option("--stage", options->stage, "stage.toml; without it, the default stage");
    verb->add_option("--subject", options->subject,
                     "cosine: matte surfaces that the camera sees; equal: every lamp gives --counts")
        ->check(CLI::IsMember({"cosine", "equal"}))
        ->capture_default_str();
    verb->add_option("--card", options->card_counts,
                     "counts that a lamp gives what must not saturate; without it, nothing saturates")
        ->check(CLI::Range(0.0, 1e6));
    verb->add_option("--white-margin", options->white_margin, "share of full scale kept free below saturation")
        ->check(CLI::Range(0.0, 0.9))
        ->capture_default_str();
    verb->add_option("--max-lit", options->max_lit, "limit on brightness: lamps' worth of light in a slot")
        ->check(CLI::Range(1.0, 1e4));
    verb->add_option("--max-duty", options->max_duty, "share of the slots in which a lamp may be lit")
        ->check(CLI::Range(0.001, 1.0))
        ->capture_default_str();
    verb->add_option("--rows", options->rows, "slots of the basis")->check(CLI::Range(1, 1024))->capture_default_str();
    verb->add_flag("--grey", options->search.grey, "8-bit levels; otherwise on or off");
    verb->add_option("--worst", options->worst, "0: least mean variance; 1: least variance of the worst lamp")
        ->check(CLI::Range(0.0, 1.0))
        ->capture_default_str();
    verb->add_option("--seed", options->search.seed, "of the random starts")->capture_default_str();
    verb->add_option("--starts", options->search.starts, "how many of the best starts are improved")
        ->check(CLI::Range(1, 1000))
        ->capture_default_str();
    verb->add_option("--sweeps", options->search.exchange_sweeps, "of the exchange over all slots, a start")
        ->check(CLI::Range(0, 1000))
        ->capture_default_str();
    verb->add_option("-o,--output", options->output, "basis file to write (designed.csv)")->required();
    verb->add_flag("--json", options->json, "print as JSON");
    verb->callback([options, &exit_code] { exit_code = report_errors([&] { return run(*options); }); });
}

}  // namespace ols

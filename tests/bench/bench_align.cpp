// SPDX-License-Identifier: MIT
// Motion compensation as a whole: what is relit of a moving subject against the scene frozen at the target's moment, by quality,
// beside no compensation and beside alignment by the true flow.
// links: ols_bench_motion
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <ctime>
#include <opencv2/core.hpp>

#include "align_limit.hpp"
#include "align_sheet.hpp"
#include "align_takes.hpp"
#include "bench.hpp"

using namespace ols;

namespace {

constexpr const char* bases[] = {"single", "triangle", "s159"};
constexpr const char* by = "`stagectl run --quality`";

// A broken recording ends the program: the page must not be made of half of the figures.
template <typename Value>
Value sure(Result<Value> value) {
    if (value) return std::move(*value);
    fmt::print(stderr, "bench_align: {}\n", value.error().message);
    std::exit(1);
}

// `standard` with flow alone: from the nearer frames, as they are; and with these, following the brightness.
constexpr const char* flow_only = "flow only";
constexpr const char* nearer_only = "nearer only";
// `standard` with flow between as many tracking frames as `preview` takes.
constexpr const char* sparse = "flow at 60 Hz";

std::string quality_of(const std::string& way) {
    return way == flow_only || way == nearer_only || way == sparse ? "standard" : way;
}

std::unique_ptr<MotionDeveloper> developer(const Recording& recording, const std::string& name, Estimate estimate) {
    DevelopOptions options;
    options.threads = 1;
    options.estimate = estimate;
    MotionQuality quality = *motion_quality(quality_of(name));
    quality.follows_brightness = name != flow_only;
    quality.interpolates = quality.interpolates && name != flow_only && name != nearer_only;
    if (name == sparse) quality.flow_apart_s = motion_quality("preview")->flow_apart_s;
    return std::unique_ptr<MotionDeveloper>(new MotionDeveloper(developer_of(recording, quality, options)));
}

Target first_target(const Recording& recording, const std::string& quality, const MotionPath* path = nullptr) {
    return sure(developer(recording, quality, Estimate::clipped)->develop(recording.targets[0], path));
}

// 100 at a PSNR of 0 dB.
double percent_of_peak(double psnr_db) {
    return 100 * std::pow(10, -psnr_db / 20);
}

// A knob whose figures stand in a line of a table. Each is of `run`, called once.
struct Line {
    std::string name, unit, table, note;
    std::vector<std::pair<std::string, std::function<double()>>> figures;  // by setting
    std::string peer = "none", default_setting = "standard";
};

void measure(Bench& bench, const Line& line) {
    std::vector<double> found(line.figures.size());
    std::vector<Setting> settings;
    for (size_t i = 0; i < line.figures.size(); ++i)
        settings.push_back({line.figures[i].first, [&found, &line, i] { found[i] = line.figures[i].second(); },
                            [&found, i] { return found[i]; }});
    bench.measure({.name = line.name,
                   .set_by = by,
                   .error_unit = line.unit,
                   .peer = line.peer,
                   .default_setting = line.default_setting,
                   .settings = settings,
                   .table = line.table,
                   .table_note = line.note,
                   .most_rounds = 1});
}

// The targets of one take by setting, each developed once. Empty where nothing is measured.
using Targets = std::vector<std::pair<std::string, Target>>;

constexpr const char* ways[] = {"none",     flow_only, nearer_only, "preview", sparse,
                                "standard", "final",   "true flow", "frozen"};

Targets develop_all(Takes& takes, const Take& take) {
    Targets targets;
    for (const std::string way : ways) {
        if (way == "none" || way == sparse)
            targets.push_back({way, first_target(take.recording, way)});
        else if (way == "true flow")
            targets.push_back({way, first_target(take.recording, "final", &take.true_path)});
        else if (way == "frozen")
            targets.push_back({way, first_target(*take.frozen, "none")});
        else
            targets.push_back({way, first_target(take.recording, way, sure(takes.found(take, quality_of(way))))});
    }
    return targets;
}

void measure_targets(Bench& bench, Line line, const Targets& targets,
                     const std::function<double(const Target&)>& error) {
    for (size_t i = 0; i < std::size(ways); ++i)
        line.figures.push_back({ways[i], [&targets, &error, i] { return error(targets[i].second); }});
    measure(bench, line);
}

void measure_relit(Bench& bench, const std::string& name, const Take* take, const Targets& targets) {
    const Line line{
        .name = name,
        .unit = "% of peak rms",
        .table = "PSNR relit, dB",
        .note =
            "**What is relit.** After each scene's name the subject's motion at 320 x 240: the mean and the most "
            "pixels a cycle. Left to right: as recorded; `standard` with flow alone, then following the tracking "
            "frames' brightness, both from the frames nearest in time only ([motion.md](motion.md)); `preview`; "
            "`standard` with flow between only as many tracking frames as `preview` takes; `standard`; `final`; "
            "`final` with the scene's own geometry in place of a flow; and a subject that stands still in the "
            "target's pose: noise and saturation alone, the most that there is to gain.",
        .figures = {}};
    measure_targets(bench, line, targets,
                    [&](const Target& target) { return percent_of_peak(take->truth->psnr_db(target)); });
}

// What lids in the middle of a blink leave, of the pixels that they pass.
void measure_banding(Bench& bench, const std::string& basis, const Take* take, const Targets& targets) {
    const std::string note =
        "**A blink, and what multiplexing makes of it.** Of the pixels that the lids pass only: rms error of what is "
        "relit (mean over the three lightings) and of the single images. `frozen` is noise alone. A basis of single "
        "lamps gets each lamp's lid at another height; a multiplexed one spreads each height over all lamps as plus "
        "and minus ([motion.md](motion.md)).";
    const auto moving = take ? moving_pixels(take->true_path, take->truth->subject()) : std::vector<unsigned char>();
    const auto line = [&](const std::string& what) {
        return Line{.name = basis + ", " + what, .unit = "%", .table = "lids, % of peak", .note = note, .figures = {}};
    };
    measure_targets(bench, line("relit"), targets,
                    [&](const Target& target) { return take->truth->relit_percent(target, moving); });
    measure_targets(bench, line("images"), targets,
                    [&](const Target& target) { return take->truth->images_percent(target, moving); });
}

constexpr const char* limit_note =
    "**What no flow mends.** The scene in full colour under the key light, without noise, mosaic or basis, at the "
    "moments of the tracking frames half a cycle around the target's, each moved to it, where the point can be seen "
    "at both; and of these pixels only those that are three or more from any other. All but `preview` and `true flow, "
    "nearer` are blended with the moment a cycle away across the target, as `standard` and `final` do. What the true "
    "flow leaves is shading that does not change evenly (highlights, edges of shadows), interpolation, and outlines, "
    "whose pixels mix what moves with what does not. A found flow may be nearer than the true one: it follows what "
    "pictures show, where shading stays with the lamps while the surface moves, and outlines as they are drawn.";

// What flow does for a scene where nothing else is in its way.
void measure_limit(Bench& bench, Takes& takes, const MovingScene& scene, const Take* take) {
    std::unique_ptr<AlignLimit> limit;
    if (take) limit = std::make_unique<AlignLimit>(take->recording, take->true_path);
    for (const auto& [where, suffix] :
         {std::pair(AlignLimit::Where::visible, ""), std::pair(AlignLimit::Where::inside, ", away from outlines")}) {
        Line line{.name = scene.name + suffix,
                  .unit = "% of peak rms",
                  .table = "PSNR of the tracking frames' moments, dB",
                  .note = limit_note,
                  .figures = {{"none", [&] { return percent_of_peak(limit->still_db(where)); }}}};
        for (const std::string quality : {"preview", "standard", "final"})
            line.figures.push_back({quality, [&, quality] {
                                        return percent_of_peak(limit->moved_db(*sure(takes.found(*take, quality)),
                                                                               where,
                                                                               motion_quality(quality)->interpolates));
                                    }});
        for (const bool interpolates : {false, true})
            line.figures.push_back({interpolates ? "true flow" : "true flow, nearer", [&, interpolates] {
                                        return percent_of_peak(limit->moved_db(take->true_path, where, interpolates));
                                    }});
        measure(bench, line);
    }
}

void measure_flow(Bench& bench, Takes& takes, const MovingScene& scene, const Take* take) {
    struct Figure {
        const char* name;
        Knots knots;
        double PathError::*value;
    };
    for (const Figure figure :
         {Figure{"next, mean", Knots::nearest, &PathError::mean},
          Figure{"half a cycle, mean", Knots::half_a_cycle, &PathError::mean},
          Figure{"half a cycle, 95th percentile", Knots::half_a_cycle, &PathError::percentile_95}}) {
        const auto error = [take, figure](const MotionPath* found) {
            const auto cycle = double(take->recording.sequence.cycle_ticks());
            return path_error(found, take->true_path, figure.knots, cycle, take->truth->subject()).*figure.value;
        };
        Line line{
            .name = scene.name + ", " + figure.name,
            .unit = "px",
            .table = "endpoint error of the flow, px",
            .note =
                "**Flow, and its drift.** From the target to the next tracking frame on either side, 8 ms away, and "
                "to half a cycle away, 42 ms and five links of the concatenation (two with `preview`, which takes the "
                "subject to move evenly between), where the subject is visible at both. `none` is the motion itself. "
                "Five times the error at five times the distance would be the same error a frame.",
            .figures = {{"none", [error] { return error(nullptr); }}}};
        for (const std::string quality : {"preview", "standard", "final"})
            line.figures.push_back(
                {quality, [&takes, take, error, quality] { return error(sure(takes.found(*take, quality))); }});
        measure(bench, line);
    }
}

// The steady state: a target whose predecessor, half a cycle before, has been developed.
class SecondTarget {
  public:
    SecondTarget(const Take* take, const std::string& quality) : take_(take), quality_(quality) {}

    void prepare() {
        second_ = {};  // as one that has been written
        developer_ = developer(take_->recording, quality_, Estimate::none);
        first_ = sure(developer_->develop(take_->recording.targets[0]));
        before_ = developer_->times();
    }
    // Parts are told by the clock, which runs on while others have the processor: they count as shares of the processor time.
    void run() {
        const std::clock_t begin = std::clock();
        second_ = sure(developer_->develop(take_->recording.targets[1]));
        all_ms_.push_back(1e3 * double(std::clock() - begin) / CLOCKS_PER_SEC);
        const MotionDeveloper::Times& after = developer_->times();
        const double parts[] = {after.flow - before_.flow, after.planes - before_.planes,
                                after.invert - before_.invert};
        for (size_t i = 0; i < 3; ++i)
            parts_ms_[i].push_back(all_ms_.back() * parts[i] / (parts[0] + parts[1] + parts[2]));
    }
    double error() const { return percent_of_peak(take_->truth->psnr_db(first_)); }
    double part_ms(size_t part) const { return median(parts_ms_[part]); }
    // At 24 targets a second, on two cores.
    double times_real_time() const { return 2 * (1e3 / 24) / median(all_ms_); }

  private:
    static double median(std::vector<double> values) {
        // The lower of two in the middle: one of the runs is for its memory, with every page fresh.
        std::ranges::sort(values);
        return values.empty() ? 0 : values[(values.size() - 1) / 2];
    }

    const Take* take_;
    std::string quality_;
    std::unique_ptr<MotionDeveloper> developer_;
    Target first_, second_;
    MotionDeveloper::Times before_;
    std::vector<double> parts_ms_[3], all_ms_;
};

void measure_time(Bench& bench, const std::string& basis, const Take* take) {
    const std::vector<std::string> names = {"none", "preview", sparse, "standard", "final"};
    std::vector<std::unique_ptr<SecondTarget>> runs;
    std::vector<Setting> settings;
    for (const std::string& name : names) {
        runs.push_back(std::make_unique<SecondTarget>(take, name));
        SecondTarget* const one = runs.back().get();
        settings.push_back({.name = name,
                            .run = [one] { one->run(); },
                            .error = [one] { return one->error(); },
                            .prepare = [one] { one->prepare(); }});
    }
    bench.measure({.name = "quality, turn60 at 640 x 480, " + basis,
                   .set_by = by,
                   .error_unit = "% of peak rms",
                   .peer = "final",
                   .default_setting = "standard",
                   .why_off_front =
                       "flow at 60 Hz brings a head that turns as near in less time, but a hand that passes before it "
                       "comes out 1 dB farther off.",
                   .settings = settings,
                   .most_rounds = 7});
    const auto figures = [&](const std::string& name, const std::string& unit, const auto& figure) {
        Line line{.name = basis + ", " + name,
                  .unit = unit,
                  .table = "one target of 640 x 480, core-milliseconds",
                  .note =
                      "**Where the time goes**, of one core. The last line of a basis: how many times faster than the "
                      "performance targets are made, 24 a second on two cores.",
                  .figures = {}};
        for (size_t i = 0; i < names.size(); ++i)
            line.figures.push_back({names[i], [one = runs[i].get(), figure] { return figure(*one); }});
        measure(bench, line);
    };
    const std::string parts[] = {"flow", "planes", "warp and inversion"};
    for (size_t part = 0; part < 3; ++part)
        figures(parts[part], "ms", [part](const SecondTarget& run) { return run.part_ms(part); });
    figures("multiple of real time", "x", [](const SecondTarget& run) { return run.times_real_time(); });
}

// Pictures to look at, under the smooth environment.
SheetBand sheet_band(const std::string& basis, const Take& take, const Targets& targets) {
    SheetBand band{basis, take.truth->relit_truth(1), {}};
    for (const auto& [way, target] : targets)
        if (way != nearer_only && way != sparse && way != "preview" && way != "true flow")
            band.pictures.push_back({way, take.truth->relit(target, lightings()[1])});
    return band;
}

// A moving head, and the lids in the middle of it, enlarged.
void write_sheet(const std::string& scene, Cfa cfa, const std::vector<SheetBand>& bands) {
    const Box box = scene == "blink" ? Box{130, 98, 60, 30} : Box{100, 70, 120, 140};
    sure(write_align_sheet(fmt::format("out/bench/align_{}.png", scene), cfa, bands, box, scene == "blink" ? 5 : 2));
}

void measure_scene(Bench& bench, Takes& takes, const MovingScene& scene) {
    takes.forget();
    std::vector<SheetBand> bands;
    const Take* take = nullptr;
    for (const std::string basis : bases) {
        Targets targets;
        if (bench.measures()) {
            take = sure(takes.get(scene, basis));
            targets = develop_all(takes, *take);
        }
        measure_relit(bench, scene.title() + ", " + basis, take, targets);
        if (scene.name == "blink") measure_banding(bench, basis, take, targets);
        if (bench.full() && bench.measures() && basis != "triangle") bands.push_back(sheet_band(basis, *take, targets));
    }
    if (!bands.empty() && (scene.name == "turn60" || scene.name == "blink"))
        write_sheet(scene.name, take->recording.camera().cfa, bands);
    measure_limit(bench, takes, scene, take);
    measure_flow(bench, takes, scene, take);
}

}  // namespace

int main(int argc, char** argv) {
    require_freed_planes("bench_align");
    cv::setNumThreads(1);
    Bench bench(
        argc, argv,
        {.name = "align",
         .truth =
             "The scenes of [motion_scenes.md](motion_scenes.md) through a 12-bit mosaic of 320 x 240 with the "
             "camera's noise, each basis at its derived exposure, developed with `--estimate clipped`; one target of "
             "each. Truth is the scene frozen at the target's moment, without noise. Both are relit as mosaics by a "
             "key light of a few lamps, a smooth environment and a grazing side light; the PSNR is over all pixels "
             "that show the subject (truth under all lamps above 2 % of its 99.9th percentile, misaligned ones "
             "included), relative to the 99.9th percentile of the relit truth, the mean of the three in dB. Settings "
             "were tuned on spin, blink, hair and turn180; turn60, talk, hand and still are for reporting. Times are "
             "those of the second target in a row, every fifth tracking frame being one, of turn60 at 640 x 480 on "
             "one core, without matte frames and estimates. The first run renders the scenes into out/bench/motion, "
             "which takes some twenty minutes; later ones take less than ten.",
         .advice =
             "Take `standard`; `preview` to look at takes, `final` where time does not matter. Flow gains most "
             "where things pass before each other, where the picture turns and where texture is fine. Where even "
             "the true flow gains little, the subject is lit anew as it turns under the lamps: what changes evenly "
             "is blended from both sides, edges of shadows and highlights are not."});
    Takes takes(bench.full() ? "out/bench/motion" : "");
    const auto is_turn60 = [](const MovingScene& scene) { return scene.name == "turn60"; };
    for (const std::string basis : {"single", "s159"}) {
        const MovingScene& turn60 = *std::ranges::find_if(moving_scenes(), is_turn60);
        measure_time(bench, basis, bench.measures() ? sure(takes.get(turn60, basis, 640, 480, 2)) : nullptr);
        takes.forget();
    }
    for (const MovingScene& scene : moving_scenes()) measure_scene(bench, takes, scene);
    return bench.finish();
}

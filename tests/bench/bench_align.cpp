// SPDX-License-Identifier: MIT
// Motion compensation as a whole: what is relit of a moving subject against the scene frozen at the target's moment, by quality,
// beside no compensation and beside alignment by the true flow.
// links: ols_bench_motion
#include <fmt/format.h>
#include <malloc.h>

#include <algorithm>
#include <cmath>
#include <ctime>
#include <map>
#include <memory>
#include <opencv2/core.hpp>

#include "align_limit.hpp"
#include "align_score.hpp"
#include "align_sheet.hpp"
#include "bench.hpp"

using namespace ols;

namespace {

constexpr const char* folder = "out/bench/motion";
constexpr const char* bases[] = {"single", "triangle", "s159"};
constexpr const char* by = "`stagectl run --quality`";
constexpr const char* relit_table = "PSNR relit, dB";
constexpr const char* flow_table = "endpoint error of long-range flow, px";
constexpr const char* limit_table = "PSNR of frames in full colour without noise, dB";
constexpr const char* part_table = "one target of 640 x 480, s159, core-milliseconds";

// Settings were chosen on the first four, and are reported on all.
constexpr const char* scenes[] = {"spin", "blink", "hair", "turn180", "turn60", "talk", "hand", "still"};

struct Take {
    RecordingPlan plan;
    Recording recording;
    std::unique_ptr<TrueTarget> truth;  // of the first target
    MotionPath true_path;               // of the first target
    std::unique_ptr<Recording> frozen;
};

void stop(const std::string& message) {
    fmt::print(stderr, "bench_align: {}\n", message);
    std::exit(1);
}

// The motion of the lids is at its height in the first cycle.
RecordingPlan plan_of(const std::string& scene, const std::string& basis) {
    return {"tools/stagesim/scenes/motion_" + scene + ".toml", basis, 320, 240, scene == "blink" ? 0u : 2u, 1};
}

// Where the program is only to be seen working, all takes are those of one small scene that needs no assets.
class Takes {
  public:
    explicit Takes(bool full) : full_(full) {}

    const Take& get(RecordingPlan plan) {
        if (!full_) plan.scene = plan_of("hair", "").scene, plan.width = 48, plan.height = 32;
        const std::string key = plan.scene + plan.basis + std::to_string(plan.targets);
        auto& take = takes_[key];
        if (!take) take = load(plan);
        return *take;
    }
    void forget() {
        if (full_) takes_.clear();
    }

  private:
    std::unique_ptr<Take> load(const RecordingPlan& plan) const {
        const std::string kept_in = full_ ? folder : "";
        auto recording = record(plan, kept_in);
        if (!recording) stop(recording.error().message);
        auto take = std::make_unique<Take>(Take{plan, std::move(*recording), {}, {}, {}});
        const auto lamps = true_lamps(take->recording, plan, kept_in);
        if (!lamps) stop(lamps.error().message);
        take->truth = std::make_unique<TrueTarget>(take->recording, *lamps);
        take->true_path = true_path(take->recording, 0);
        if (plan.targets > 1) return take;
        RecordingPlan frozen_plan = plan;
        frozen_plan.is_frozen = true;
        auto frozen = record(frozen_plan, kept_in);
        if (!frozen) stop(frozen.error().message);
        take->frozen = std::make_unique<Recording>(std::move(*frozen));
        return take;
    }

    const bool full_;
    std::map<std::string, std::unique_ptr<Take>> takes_;
};

std::unique_ptr<MotionDeveloper> developer(const Recording& recording, const std::string& quality) {
    DevelopOptions options;
    options.threads = 1;
    return std::make_unique<MotionDeveloper>(recording.sequence, recording.calibration, recording.camera().noise,
                                             options, *motion_quality(quality));
}

Target developed(MotionDeveloper& developer, const Recording& recording, size_t target,
                 const MotionPath* path = nullptr) {
    auto made = developer.develop(recording.targets[target], path);
    if (!made) stop(made.error().message);
    return std::move(*made);
}

Target first_target(const Recording& recording, const std::string& quality, const MotionPath* path = nullptr) {
    return developed(*developer(recording, quality), recording, 0, path);
}

// 100 at a PSNR of 0 dB.
double percent_of_peak(double psnr_db) {
    return 100 * std::pow(10, -psnr_db / 20);
}

// What is relit of one take, which is null where nothing is measured. Leaves the pictures under the second lighting.
std::vector<SheetPicture> measure_relit(Bench& bench, const std::string& name, const Take* take) {
    Target target;
    std::vector<SheetPicture> pictures;
    std::vector<Setting> settings;
    const auto add = [&](const std::string& setting, const std::function<Target()>& develop) {
        settings.push_back({setting, [&target, develop] { target = develop(); },
                            [&, take, setting] {
                                pictures.push_back({setting, take->truth->relit(target, lightings()[1])});
                                return percent_of_peak(take->truth->psnr_db(target));
                            }});
    };
    for (const std::string& quality : motion_quality_names())
        add(quality, [take, quality] { return first_target(take->recording, quality); });
    add("true flow", [take] { return first_target(take->recording, "final", &take->true_path); });
    add("frozen", [take] { return first_target(*take->frozen, "none"); });
    bench.measure({.name = name,
                   .set_by = by,
                   .error_unit = "% of peak rms",
                   .peer = "none",
                   .default_setting = "standard",
                   .settings = settings,
                   .table = relit_table,
                   .most_rounds = 1});
    return pictures;
}

// The scenes whose pictures are to be looked at: a moving head, and the lids in the middle of it, enlarged.
void write_sheets(const std::string& scene, const Take& take, const std::vector<SheetPicture>& pictures) {
    if (scene != "turn60" && scene != "blink") return;
    const Box box = scene == "blink" ? Box{130, 98, 60, 30} : Box{100, 70, 120, 140};
    const Status written = write_align_sheet(fmt::format("out/bench/align_{}.png", scene), take.truth->relit_truth(1),
                                             take.recording.camera().cfa, pictures, box, scene == "blink" ? 6 : 3);
    if (!written) stop(written.error().message);
}

// What the true flow does for a scene where nothing else is in its way.
void measure_limit(Bench& bench, const std::string& scene, const Take* take) {
    AlignLimit limit;
    const auto run = [&limit, take] { limit = align_limit(take->recording, take->true_path); };
    bench.measure(
        {.name = scene,
         .set_by = by,
         .error_unit = "% of peak rms",
         .peer = "as they stand",
         .default_setting = "moved by the true flow",
         .settings = {{"as they stand", run, [&limit] { return percent_of_peak(limit.still_psnr_db); }},
                      {"moved by the true flow", run, [&limit] { return percent_of_peak(limit.moved_psnr_db); }}},
         .table = limit_table,
         .most_rounds = 1});
}

// The flow from a target to the tracking frames farthest from it.
void measure_flow(Bench& bench, const std::string& scene, const Take* take) {
    PathError error;
    for (const bool is_mean : {true, false}) {
        std::vector<Setting> settings;
        for (const std::string& quality : motion_quality_names()) {
            if (quality == "none") continue;
            settings.push_back({quality,
                                [&error, take, quality] {
                                    MotionQuality single = *motion_quality(quality);
                                    single.flow.threads = 1;
                                    const auto path = found_path(take->recording, 0, single);
                                    if (!path) stop(path.error().message);
                                    error = path_error(*path, take->true_path, take->truth->subject());
                                },
                                [&error, is_mean] { return is_mean ? error.mean : error.percentile_95; }});
        }
        bench.measure({.name = scene + (is_mean ? ", mean" : ", 95th percentile"),
                       .set_by = by,
                       .error_unit = "px",
                       .peer = "preview",
                       .default_setting = "standard",
                       .settings = settings,
                       .table = flow_table,
                       .most_rounds = 1});
    }
}

// The steady state: a target whose predecessor, half a cycle before, has been developed.
class SecondTarget {
  public:
    SecondTarget(const Take* take, const std::string& quality) : take_(take), quality_(quality) {}

    void prepare() {
        developer_ = developer(take_->recording, quality_);
        first_ = developed(*developer_, take_->recording, 0);
        before_ = developer_->times();
    }
    // Parts are told by the clock, which runs on while others have the processor: they count as shares of the processor time.
    void run() {
        const std::clock_t begin = std::clock();
        second_ = developed(*developer_, take_->recording, 1);
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
        std::ranges::sort(values);
        return values.empty() ? 0 : values[values.size() / 2];
    }

    const Take* take_;
    std::string quality_;
    std::unique_ptr<MotionDeveloper> developer_;
    Target first_, second_;
    MotionDeveloper::Times before_;
    std::vector<double> parts_ms_[3], all_ms_;
};

void measure_time(Bench& bench, const Take* take) {
    std::vector<std::string> names = motion_quality_names();
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
    bench.measure({.name = "quality, 640 x 480, s159",
                   .set_by = by,
                   .error_unit = "% of peak rms",
                   .peer = "final",
                   .default_setting = "standard",
                   .settings = settings,
                   .most_rounds = 5});
    const auto figures = [&](const std::string& name, const std::string& unit, const auto& figure) {
        std::vector<Setting> shown;
        for (size_t i = 0; i < names.size(); ++i)
            shown.push_back({names[i], [] {}, [one = runs[i].get(), figure] { return figure(*one); }});
        bench.measure({.name = name,
                       .set_by = by,
                       .error_unit = unit,
                       .peer = "final",
                       .default_setting = "standard",
                       .settings = shown,
                       .table = part_table,
                       .most_rounds = 1});
    };
    const std::string parts[] = {"flow", "planes", "warp and inversion"};
    for (size_t part = 0; part < 3; ++part)
        figures(parts[part], "ms", [part](const SecondTarget& run) { return run.part_ms(part); });
    figures("multiple of real time, 24 targets a second, 2 cores", "x",
            [](const SecondTarget& run) { return run.times_real_time(); });
}

}  // namespace

int main(int argc, char** argv) {
    // Freed planes stay with the process, as in one that develops target after target.
    mallopt(M_MMAP_THRESHOLD, 1 << 28);
    mallopt(M_TRIM_THRESHOLD, 1 << 29);
    cv::setNumThreads(1);
    Bench bench(
        argc, argv,
        {.name = "align",
         .truth =
             "The scenes of docs/motion_scenes.md through a 12-bit mosaic of 320 x 240 with the camera's noise, each "
             "basis at "
             "its derived exposure; one target of each. Truth is the scene frozen at the target's moment, without "
             "noise. "
             "Both are relit as mosaics by a key light of a few lamps, a smooth environment and a grazing side light; "
             "the "
             "PSNR is over all pixels that show the subject (truth under all lamps above 2 % of its 99.9th percentile, "
             "masked ones included), relative to the 99.9th percentile of the relit truth, the mean of the three in "
             "dB. "
             "`true flow` aligns by the scene's own geometry; `frozen` is a subject that stands still in the target's "
             "pose: "
             "noise alone. Settings were tuned on spin, blink, hair and turn180; turn60, talk, hand and still are for "
             "reporting. Times are those of the second target in a row, every fifth tracking frame being one, of "
             "turn60 at "
             "640 x 480 on one core. Endpoint errors are those of the flow to the tracking frames farthest from the "
             "target, "
             "where the subject is visible at both. The first run renders the scenes into out/bench/motion, for some "
             "ten to twenty "
             "minutes.",
         .advice =
             "No alignment undoes that a subject turns under the lamps, and lights up what it hid: where even the true "
             "flow "
             "gains little, so does every quality. It gains most where things pass before each other. Take `standard`, "
             "`preview` to look at takes, `final` where time does not matter."});
    Takes takes(bench.full());
    const auto take = [&](const RecordingPlan& plan) { return bench.measures() ? &takes.get(plan) : nullptr; };
    RecordingPlan large = plan_of("turn60", "s159");
    large.width = 640, large.height = 480, large.targets = 2;
    measure_time(bench, take(large));
    for (const std::string scene : scenes) {
        takes.forget();
        for (const std::string basis : bases) {
            const Take* const one = take(plan_of(scene, basis));
            const auto pictures = measure_relit(bench, scene + ", " + basis, one);
            if (bench.full() && bench.measures() && basis == "s159") write_sheets(scene, *one, pictures);
        }
        measure_limit(bench, scene, take(plan_of(scene, "s159")));
        measure_flow(bench, scene, take(plan_of(scene, "s159")));
    }
    return bench.finish();
}

// SPDX-License-Identifier: MIT
// Masked samples: what lost slots and saturated highlights cost the inversion.
// links: ols_demultiplex
#include <algorithm>
#include <cmath>
#include <random>

#include "bench.hpp"
#include "demultiplex/demultiplex.hpp"
#include "demultiplex/row_filler.hpp"

using namespace ols;

namespace {

// Rows of s159 for a frame of skin-like lamps, with the paper's noise, and the mask of a case.
using Rows = std::vector<std::vector<int32_t>>;

struct Scene {
    Basis basis = *find_basis("s159");
    FillModel model = fill_model(basis);
    int width, height;
    std::vector<std::vector<float>> truth, lamps;
    Rows rows;  // nothing masked
    std::vector<SampleFill> fills;

    Scene(int w, int h) : width(w), height(h) {
        add_smooth_prior(model, image_lights(basis, named_lamps()));
        const size_t samples = size_t(width) * size_t(height);
        truth.assign(156, std::vector<float>(samples));
        lamps = truth;
        rows.assign(159, std::vector<int32_t>(samples));
        fills.resize(samples);
        const auto lights = named_lamps();
        std::mt19937 random(1);
        std::normal_distribution<float> gauss;
        for (size_t p = 0; p < samples; ++p) {
            const double x = double(p % size_t(width)) / width - 0.5, y = double(p / size_t(width)) / height - 0.5;
            const Vec3 normal = normalized({x, y, 0.6});
            for (size_t i = 0; i < 156; ++i) truth[i][p] = float(30 * std::max(0.0, dot(normal, lights[i].direction)));
        }
        for (int r = 0; r < 159; ++r)
            for (size_t p = 0; p < samples; ++p) {
                float mean = 0;
                for (int i = 0; i < 156; ++i)
                    if (basis.lit(r, i)) mean += truth[size_t(i)][p];
                rows[size_t(r)][p] = int32_t(std::lround(mean + (2.68f + 0.492f * std::sqrt(mean)) * gauss(random)));
            }
    }

    size_t samples() const { return fills.size(); }

    // Highlights of `lamp_count` neighbouring lamps on 5 % of the pixels, in 12 round spots: all rows that light all of these
    // lamps saturate, as a lobe does that takes all of them to get there.
    Rows burn_spots(int lamp_count) const {
        Rows burnt = rows;
        const double radius = std::sqrt(0.05 * double(samples()) / 12 / 3.14159);
        const auto lights = named_lamps();
        for (int spot = 0; spot < 12; ++spot) {
            const int first = 10 + 11 * spot;
            std::vector<int> near(156);
            for (int i = 0; i < 156; ++i) near[size_t(i)] = i;
            std::sort(near.begin(), near.end(), [&](int a, int b) {
                return dot(lights[size_t(a)].direction, lights[size_t(first)].direction) >
                       dot(lights[size_t(b)].direction, lights[size_t(first)].direction);
            });
            const double cx = width * (spot % 4 + 0.5) / 4, cy = height * (spot / 4 + 0.5) / 3;
            for (size_t p = 0; p < samples(); ++p) {
                if (std::hypot(double(p % size_t(width)) - cx, double(p / size_t(width)) - cy) > radius) continue;
                for (int r = 0; r < 159; ++r)
                    if (std::all_of(near.begin(), near.begin() + lamp_count, [&](int i) { return basis.lit(r, i); }))
                        burnt[size_t(r)][p] = masked_sample<int32_t>;
            }
        }
        return burnt;
    }
    // One random row of 5 % of the pixels.
    Rows scatter() const {
        Rows scattered = rows;
        std::mt19937 random(2);
        for (size_t p = 0; p < samples(); ++p)
            if (random() % 20 == 0) scattered[random() % 159][p] = masked_sample<int32_t>;
        return scattered;
    }
    Rows lose(int row) const {
        Rows lost = rows;
        std::fill(lost[size_t(row)].begin(), lost[size_t(row)].end(), masked_sample<int32_t>);
        return lost;
    }

    void invert(const Rows& some, bool masked, Estimate estimate) {
        std::vector<const int32_t*> in;
        std::vector<float*> out;
        for (const auto& row : some) in.push_back(row.data());
        for (auto& lamp : lamps) out.push_back(lamp.data());
        fills.assign(samples(), {});
        FillCache cache(model, estimate);  // empty, as at the begin of a take
        const RowFiller filler(cache, {}, fills);
        demultiplex(basis, in, samples(), out, {{}, 1, masked ? &filler : nullptr});
    }

    // Counts rms over the pixels that are solved or estimated.
    double error() const {
        double squares = 0, count = 0;
        for (size_t p = 0; p < samples(); ++p)
            for (size_t i = 0; i < 156 && fills[p].kind != FillKind::unsolved; ++i)
                squares += std::pow(lamps[i][p] - truth[i][p], 2), count += 1;
        return std::sqrt(squares / count);
    }
};

}  // namespace

int main(int argc, char** argv) {
    Bench bench(
        argc, argv,
        {.name = "masks",
         .truth =
             "Lamp values of a matte frame, 12-bit rows of s159 with the paper's noise; errors are noise, counts rms "
             "over what is solved or estimated. 640 x 480, one thread, fills made anew in every run.",
         .advice = "Masks cost what they mask: none, next to nothing. Estimates of highlights cost most where every "
                   "pixel has its own set of saturated rows."});
    const int width = bench.full() ? 640 : 64, height = bench.full() ? 480 : 48;
    Scene scene(width, height);
    struct Case {
        const char* name;
        Rows rows;
        bool masked = true;
        Estimate estimate = Estimate::none;
    };
    const std::vector<Case> cases = {
        {"masks off", scene.rows, false},
        {"nothing masked", scene.rows},
        {"a lost slot", scene.lose(42)},
        {"5 % in one row, scattered", scene.scatter()},
        {"5 % highlights, unsolved", scene.burn_spots(1)},
        {"5 % highlights of three lamps, smooth", scene.burn_spots(3), true, Estimate::smooth},
        {"5 % highlights of one lamp, smooth", scene.burn_spots(1), true, Estimate::smooth}};
    std::vector<Setting> settings;
    for (const Case& one : cases)
        settings.push_back(
            {one.name, [&] { scene.invert(one.rows, one.masked, one.estimate); }, [&] { return scene.error(); }});
    bench.measure({.name = "masked samples",
                   .set_by = "`stagectl run --estimate`",
                   .error_unit = "counts rms",
                   .peer = "masks off",
                   .default_setting = "nothing masked",
                   .why_off_front = "masks are always on: what is saturated is not a count",
                   .settings = settings});
    return bench.finish();
}

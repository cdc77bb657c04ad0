// SPDX-License-Identifier: MIT
// Kinds of lighting basis: the noise that a recovered lamp has on a grey card and in deep shadow, and the time that the
// inversion of a target takes.
// links: ols_demultiplex
#include <algorithm>
#include <cmath>
#include <memory>
#include <random>

#include "bench.hpp"
#include "demultiplex/demultiplex.hpp"
#include "stage/sequence.hpp"

using namespace ols;

namespace {

constexpr double card_albedo = 0.18;  // a grey card

// A card at the stage's centre that faces the camera: r of an image is the mean over its lamps of albedo cos(angle).
std::vector<double> card_reflectance(const Basis& basis) {
    const auto lamps = stage_lamp_directions();
    std::vector<double> r;
    for (const auto& shown : basis.image_lamps) {
        double sum = 0;
        for (const int lamp : shown) sum += card_albedo * std::max(0.0, lamps[size_t(lamp)].z);
        r.push_back(sum / double(shown.size()));
    }
    return r;
}

// Wenger's exposures: 412 us where a few lamps are lit at once, 100 us where half of them are (sections 5.1 to 5.3).
double exposure_us(const Basis& basis) {
    int most = 0;
    for (int row = 0; row < basis.rows; ++row) {
        int lit = 0;
        for (int lamp = 0; lamp < basis.lamps; ++lamp) lit += basis.lit(row, lamp);
        most = std::max(most, lit);
    }
    return most <= 3 ? 412 : 100;
}

enum class Side { lit, shadowed };

// Frames of the card under each row, with the camera's noise, rounded to counts, and their inversion. The first `drawn`
// samples are drawn, the others repeat them.
class CardTake {
  public:
    CardTake(const std::string& name, size_t samples, size_t drawn)
        : basis_(*find_basis(name)), samples_(samples), drawn_(std::min(samples, drawn)) {
        const CameraConfig camera;
        const double unit = camera.counts_per_us * exposure_us(basis_);  // counts of r = 1
        gain_.assign(samples, float(1 / unit));
        truth_ = card_reflectance(basis_);
        const auto lamps = stage_lamp_directions();
        std::mt19937 random(5);
        for (int r = 0; r < basis_.rows; ++r) {
            double mean = 0;
            for (int i = 0; i < basis_.lamps; ++i)
                mean += unit * basis_.light(r, i) * card_albedo * std::max(0.0, lamps[size_t(i)].z);
            std::normal_distribution<double> counts(mean,
                                                    camera.noise.read_counts + camera.noise.shot * std::sqrt(mean));
            std::vector<int32_t> row(samples);
            for (size_t p = 0; p < drawn_; ++p) row[p] = int32_t(std::lround(counts(random)));
            for (size_t p = drawn_; p < samples; ++p) row[p] = row[p - drawn_];
            rows_.push_back(std::move(row));
        }
    }

    void invert(std::vector<std::vector<float>>& images) const {
        std::vector<const int32_t*> in;
        std::vector<float*> out;
        for (const auto& row : rows_) in.push_back(row.data());
        for (int i = 0; i < basis_.images(); ++i) out.push_back(images[size_t(i)].data());
        demultiplex(basis_, in, samples_, out, {gain_, 1});
    }

    // Root mean square over samples and the images of lamps before (or behind) the card, in percent of a white card under
    // one lamp (r = 1).
    double error_percent(const std::vector<std::vector<float>>& images, Side side) const {
        double squares = 0, count = 0;
        for (size_t i = 0; i < truth_.size(); ++i) {
            if ((truth_[i] > 0) != (side == Side::lit)) continue;
            for (size_t p = 0; p < drawn_; ++p) squares += std::pow(double(images[i][p]) - truth_[i], 2);
            count += double(drawn_);
        }
        return 100 * std::sqrt(squares / count);
    }

  private:
    Basis basis_;
    size_t samples_, drawn_;
    std::vector<float> gain_;
    std::vector<double> truth_;
    std::vector<std::vector<int32_t>> rows_;
};

constexpr const char* names[] = {"single",      "triangle", "triangle300",           "planes156", "s155", "s159",
                                 "hadamard156", "paley163", "spherical_harmonics:10"};
constexpr size_t most_images = 156;

}  // namespace

int main(int argc, char** argv) {
    Bench bench(
        argc, argv,
        {.name = "bases",
         .truth =
             "A grey card (18 %) that faces the camera, under the exposures of Wenger et al. (412 us where up to three "
             "lamps are "
             "lit at once, 100 us where half of them are) and their camera's noise, 2.68 + 0.492 sqrt(counts). The "
             "error "
             "is the noise of the recovered images against the card's cosine law, in percent of a white card under one "
             "lamp, for the lamps before the card and for those behind it, whose images are shadow. The time is the "
             "inversion of a mosaic of 320 x 240 on one core.",
         .advice =
             "While photon noise rules, a single lamp a slot is the least noisy that still resolves every lamp; "
             "`triangle` is "
             "better by more than half where the mean of three neighbours will do. Multiplexed bases pay with the "
             "noise of "
             "all lamps in the shadow of one, and are for dim light, a steadier flicker, and fewer saturated "
             "highlights: of "
             "them take `s159`, which loses no lamp with a slot; `hadamard156` has one noisy lamp. Grey harmonics "
             "are for what needs no single lamps."});
    const size_t samples = bench.full() ? 320 * 240 : 500, drawn = 8192;
    std::vector<std::vector<float>> images(most_images, std::vector<float>(samples));
    std::vector<std::unique_ptr<const CardTake>> takes;
    for (const char* name : names) takes.push_back(std::make_unique<CardTake>(name, samples, drawn));
    for (const Side side : {Side::lit, Side::shadowed}) {
        std::vector<Setting> settings;
        for (size_t i = 0; i < takes.size(); ++i)
            settings.push_back({names[i], [&, i] { takes[i]->invert(images); },
                                [&, i] { return takes[i]->error_percent(images, side); }});
        bench.measure(
            {.name = side == Side::lit ? "basis, lit" : "basis, in shadow",
             .set_by = "`basis` in sequence.toml, `stagectl run --basis`",
             .error_unit = "% of white rms",
             .peer = "single",
             .default_setting = SequenceConfig{}.basis,
             .why_off_front =
                 "it alone shows every lamp by itself without the noise of the others: `triangle` is less noisy "
                 "because each of its images is three lamps.",
             .settings = settings});
    }
    return bench.finish();
}

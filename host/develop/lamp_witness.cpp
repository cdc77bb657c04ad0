// SPDX-License-Identifier: MIT
// Foretold and found, lamp by lamp.
#include "develop/lamp_witness.hpp"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>

#include "demultiplex/fill_model.hpp"

namespace ols {

namespace {

double median(std::vector<double> values) {
    const auto middle = values.begin() + ptrdiff_t(values.size() / 2);
    std::ranges::nth_element(values, middle);
    return *middle;
}

// Of the first target's mean over the lamps: darker ones, whose quotients are noisy, are not compared with it.
constexpr double quotient_light_least = 0.2;

bool has(const std::vector<int>& images, int image) {
    return std::ranges::find(images, image) != images.end();
}

}  // namespace

LampWitness::LampWitness(const Basis& basis, const std::vector<LightPosition>& lamps)
    : basis_(basis), inverse_(basis.images(), basis.rows) {
    const Eigen::LLT<Eigen::MatrixXd> kernel(smooth_kernel(image_lights(basis, lamps), SmoothPrior{}));
    precision_ = kernel.solve(Eigen::MatrixXd::Identity(basis.images(), basis.images()));
    for (int image = 0; image < basis.images(); ++image)
        for (int row = 0; row < basis.rows; ++row) inverse_(image, row) = basis.inverse(row, image);
}

// What is left out takes the value that the others foretell, all of it at once: the mean of K conditioned on the rest. Its own
// weight is 0 then, and it stays as foretold.
Eigen::VectorXd LampWitness::foretell(Eigen::VectorXd values, const std::vector<int>& left_out) const {
    double sum = 0;
    for (int image = 0; image < basis_.images(); ++image) sum += has(left_out, image) ? 0 : values(image);
    const double mean = sum / double(basis_.images() - int(left_out.size()));
    values.array() -= mean;
    if (!left_out.empty()) {
        values(left_out).setZero();
        const Eigen::VectorXd pulled = (precision_ * values)(left_out);
        const Eigen::MatrixXd own = precision_(left_out, left_out);
        values(left_out) = -Eigen::LLT<Eigen::MatrixXd>(own).solve(pulled);
    }
    return (values.array() - (precision_ * values).array() / precision_.diagonal().array()) + mean;
}

// The one that is farthest below is left out, and the rest foretold anew: beside a dark lamp its neighbours look bright, and
// those that are dim next to others that are, less dim than they are.
LampWitness::Found LampWitness::find(const Eigen::VectorXd& values, std::vector<int> unknown,
                                     const Eigen::VectorXd& noise) const {
    const size_t unknown_count = unknown.size();
    std::vector<int>& left_out = unknown;
    // With all lamps in: an edge of light (a flat subject's) is foretold too dark on one side as it is too bright on the other, and what is
    // left out on one takes that on the other away.
    double most_above = 0;
    for (;;) {
        const Eigen::VectorXd foretold = foretell(values, left_out);
        const Eigen::VectorXd off = (values - foretold).cwiseQuotient(noise);
        std::vector<double> sizes;
        int weakest = -1;
        for (int image = 0; image < basis_.images(); ++image) {
            if (has(left_out, image)) continue;
            sizes.push_back(std::abs(off(image)));
            most_above = std::max(most_above, off(image));
            if (weakest < 0 || off(image) < off(weakest)) weakest = image;
        }
        if (sizes.size() < 3) return {};
        const double spread = std::max({1.4826 * median(sizes), most_above / 3, 1.0});
        const auto is_weak = [&](int image) { return off(image) <= -sigma_least * spread; };
        if (left_out.size() - unknown_count == size_t(lamps_max) && is_weak(weakest)) return {};
        // While there are others that are as far above as it is below, it may be they that the dark one makes look so.
        if (left_out.size() - unknown_count < size_t(lamps_max) && -off(weakest) > 2 * std::max(spread, most_above)) {
            left_out.push_back(weakest);
            continue;
        }
        Found found;
        for (int image = 0; image < basis_.images(); ++image)
            found.unjudged += foretold(image) < sigma_least * spread * noise(image);
        for (size_t k = unknown_count; k < left_out.size(); ++k)
            if (const int image = left_out[k]; is_weak(image) && foretold(image) > 0)
                found.lamps.push_back(
                    {image, values(image) / foretold(image), spread * noise(image) / foretold(image), false});
        std::ranges::sort(found.lamps, {}, &LampFinding::factor);
        return found;
    }
}

std::vector<LampFinding> LampWitness::judge(const ParitySamples& samples) {
    Eigen::VectorXd rows = Eigen::VectorXd::Zero(basis_.rows);
    double variance = 0, count = 0;
    for (Eigen::Index k = 0; k < samples.counts().cols(); ++k) {
        if (samples.variance()(k) <= 0) continue;
        rows += samples.counts().col(k).cast<double>();
        variance += double(samples.variance()(k));
        ++count;
    }
    if (count == 0 || basis_.images() < 3) return {};
    const Eigen::VectorXd values = inverse_ * rows / count;
    if (values.mean() <= 0) return {};
    // Of a lamp's mean, from the camera's noise.
    const double noise = std::sqrt(variance * inverse_.squaredNorm() / double(basis_.images())) / count;
    Found found = find(values, {}, Eigen::VectorXd::Constant(values.size(), noise));
    unjudged_ = found.unjudged;
    if (first_.size() == 0) {
        first_ = values;
        return found.lamps;
    }
    // Against the first target: its own pattern over the lamps is divided out, where it was lit well enough.
    Eigen::VectorXd quotients = values.array() / first_.array(), noises = noise * std::sqrt(2.0) / first_.array();
    std::vector<int> unknown;
    for (int image = 0; image < basis_.images(); ++image)
        if (first_(image) <= quotient_light_least * first_.mean())
            unknown.push_back(image), quotients(image) = 0, noises(image) = 1;
    if (int(unknown.size()) > basis_.images() / 2) return found.lamps;
    for (LampFinding change : find(quotients, unknown, noises).lamps) {
        change.is_new = true;
        const auto same = std::ranges::find(found.lamps, change.image, &LampFinding::image);
        if (same == found.lamps.end())
            found.lamps.push_back(change);
        else
            *same = change;
    }
    return found.lamps;
}

}  // namespace ols

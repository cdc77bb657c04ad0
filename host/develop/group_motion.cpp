// SPDX-License-Identifier: MIT
// A row at a time: its vectors are sampled from the fields into the nearest cache, lines are laid through runs of sixteen.
#include "develop/group_motion.hpp"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <limits>

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "develop/group_motion.cpp"
// clang-format off
#include <hwy/foreach_target.h>
// clang-format on
#include <hwy/highway.h>

#ifndef OLS_GROUP_MOTION_TYPES
#define OLS_GROUP_MOTION_TYPES
namespace ols {

// Sample `phases * i + j` of a row lies at i + before + weight of the field's, j < phases; before is -1 or 0.
struct FieldPhase {
    int before;
    float weight;
};

constexpr int vector_slack = 16;  // floats of a vector, which may reach beyond a row

}  // namespace ols
#endif

HWY_BEFORE_NAMESPACE();
namespace ols {
namespace HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

// (a + weight (b - a)) scale. Nothing is read beyond `count`.
void blend_rows(const float* a, const float* b, float weight, float scale, int count, float* out) {
    const hn::CappedTag<float, 16> d;
    const auto w = hn::Set(d, weight), s = hn::Set(d, scale);
    int i = 0;
    for (; i + int(hn::Lanes(d)) <= count; i += int(hn::Lanes(d))) {
        const auto first = hn::LoadU(d, a + i), change = hn::Sub(hn::LoadU(d, b + i), first);
        hn::StoreU(hn::Mul(hn::Add(first, hn::Mul(w, change)), s), d, out + i);
    }
    for (; i < count; ++i) out[i] = (a[i] + weight * (b[i] - a[i])) * scale;
}

// `row` may be read from -1 to vector_slack beyond its end, `out` written so far for each phase.
void spread_row(const float* row, const FieldPhase* phases, int phase_count, int count, float* out) {
    const hn::CappedTag<float, 16> d;
    const auto phase = [&](int j, int i) HWY_ATTR {
        const float* const from = row + i + phases[j].before;
        const auto first = hn::LoadU(d, from), change = hn::Sub(hn::LoadU(d, from + 1), first);
        return hn::Add(first, hn::Mul(hn::Set(d, phases[j].weight), change));
    };
    for (int i = 0; i * phase_count < count; i += int(hn::Lanes(d))) {
        float* const to = out + i * phase_count;
        if (phase_count == 1)
            hn::StoreU(phase(0, i), d, to);
        else if (phase_count == 2)
            hn::StoreInterleaved2(phase(0, i), phase(1, i), d, to);
        else
            hn::StoreInterleaved4(phase(0, i), phase(1, i), phase(2, i), phase(3, i), d, to);
    }
}

// The line through the first and the last sample of each run of one row; whether the others are near it, as a vector component.
// first_of[run] is the run's first sample.
void fit_row(const float* row, const int* first_of, int runs, float tolerance, float* first, float* change,
             uint8_t* is_line) {
    constexpr int last = GroupMotion::run_samples - 1;
    const hn::CappedTag<float, GroupMotion::run_samples> d;
    const auto most = hn::Set(d, tolerance);
    for (int run = 0; run < runs; ++run) {
        const float* const v = row + first_of[run];
        first[run] = v[0];
        change[run] = (v[last] - v[0]) * (1.0f / float(last));
        const auto begin = hn::Set(d, first[run]), slope = hn::Set(d, change[run]);
        bool near = true;
        for (int k = 0; k <= last; k += int(hn::Lanes(d))) {
            const auto line = hn::Add(begin, hn::Mul(hn::Iota(d, float(k)), slope));
            near = near && hn::AllTrue(d, hn::Le(hn::Abs(hn::Sub(line, hn::LoadU(d, v + k))), most));
        }
        is_line[run] &= uint8_t(near);
    }
}

}  // namespace HWY_NAMESPACE
}  // namespace ols
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace ols {

HWY_EXPORT(blend_rows);
HWY_EXPORT(spread_row);
HWY_EXPORT(fit_row);

namespace {

// Rows of a grid, sampled from a component of a flow field at a resolution `enlarged` times lower.
class RowSampler {
  public:
    RowSampler(const std::vector<float>& values, int width, int height, const SampleGrid& grid)
        : values_(values),
          width_(width),
          height_(height),
          grid_(grid),
          enlarged_(grid.width / width),
          blended_(size_t(width + 2 + 2 * vector_slack)),
          row_(size_t(grid.width + 4 * vector_slack)) {
        for (int j = 0; j < enlarged_; ++j) phases_.push_back(phase_at(j));
    }

    // Lasts until the next call.
    const float* row(int y) {
        if (enlarged_ == 1 && grid_.step == 1) return &values_[size_t(y) * size_t(width_)];
        const FieldPhase place = phase_at(y);
        blend(place.before, place.weight > 0 ? place.before + 1 : place.before, place.weight);
        if (enlarged_ == 1) return &blended_[1];
        HWY_DYNAMIC_DISPATCH(spread_row)
        (&blended_[1], phases_.data(), int(phases_.size()), grid_.width, row_.data());
        return row_.data();
    }

  private:
    // Centres of pixels lie half a pixel from their edges, at every resolution.
    FieldPhase phase_at(int sample) const {
        const double place = (sample + 0.5) / enlarged_ - 0.5, whole = std::floor(place);
        return {int(whole), float(place - whole)};
    }

    // Field rows a and b (edges held) to blended_, from 1, in steps of the grid.
    void blend(int a, int b, float weight) {
        const auto at = [&](int y) { return &values_[size_t(std::clamp(y, 0, height_ - 1)) * size_t(width_)]; };
        HWY_DYNAMIC_DISPATCH(blend_rows)
        (at(a), at(b), weight, float(enlarged_) / float(grid_.step), width_, &blended_[1]);
        blended_[0] = blended_[1];
        blended_[size_t(width_) + 1] = blended_[size_t(width_)];
    }

    const std::vector<float>& values_;
    int width_, height_;
    SampleGrid grid_;
    int enlarged_;
    std::vector<FieldPhase> phases_;
    std::vector<float> blended_, row_;
};

bool is_sampled_by_row(const FlowField& flow, const SampleGrid& grid) {
    for (const int enlarged : {1, 2, 4})
        if (flow.width * enlarged == grid.width && flow.height * enlarged == grid.height) return true;
    return false;
}

}  // namespace

GroupMotion::GroupMotion(const FlowField& base, const FlowField& step, float tolerance_steps)
    : GroupMotion(base, step, {base.width, base.height}, tolerance_steps) {}

GroupMotion::GroupMotion(const FlowField& base, const FlowField& step, const SampleGrid& grid, float tolerance_steps)
    : grid_(grid), runs_((grid.width + run_samples - 1) / run_samples) {
    assert(base.width == step.width && base.height == step.height && grid.width > 0 && grid.height > 0);
    assert(grid.step == 1 || grid.step == 2);
    if (is_sampled_by_row(base, grid))
        make(base, step, tolerance_steps);
    else
        make(resized(base, grid.width, grid.height), resized(step, grid.width, grid.height), tolerance_steps);
}

void GroupMotion::make(const FlowField& base, const FlowField& step, float tolerance_steps) {
    const size_t count = size_t(runs_) * size_t(grid_.height);
    std::vector<float>* const firsts[] = {&lines_.base_u, &lines_.base_v, &lines_.step_u, &lines_.step_v};
    std::vector<float>* const changes[] = {&lines_.base_du, &lines_.base_dv, &lines_.step_du, &lines_.step_dv};
    for (auto* list : firsts) list->assign(count + vector_slack, std::numeric_limits<float>::quiet_NaN());
    for (auto* list : changes) list->assign(count + vector_slack, 0);
    own_index_.assign(count, -1);
    RowSampler samplers[] = {{base.u, base.width, base.height, grid_},
                             {base.v, base.width, base.height, grid_},
                             {step.u, step.width, step.height, grid_},
                             {step.v, step.width, step.height, grid_}};
    std::vector<int> first;
    for (int run = 0; run < runs_; ++run) first.push_back(first_of(run));
    const bool has_lines = tolerance_steps > 0 && grid_.width >= run_samples;
    std::vector<uint8_t> is_line(first.size());
    for (int y = 0; y < grid_.height; ++y) {
        std::fill(is_line.begin(), is_line.end(), uint8_t(has_lines));
        const float* rows[4];
        const size_t at = size_t(y) * size_t(runs_);
        for (size_t k = 0; k < 4; ++k) {
            rows[k] = samplers[k].row(y);
            if (has_lines) HWY_DYNAMIC_DISPATCH(fit_row)
            (rows[k], first.data(), runs_, tolerance_steps / 2, &(*firsts[k])[at], &(*changes[k])[at], is_line.data());
        }
        keep_own(rows, y, is_line);
    }
}

void GroupMotion::keep_own(const float* const (&rows)[4], int y, const std::vector<uint8_t>& is_line) {
    for (int run = 0; run < runs_; ++run) {
        if (is_line[size_t(run)]) continue;
        const size_t at = size_t(y) * size_t(runs_) + size_t(run);
        lines_.base_u[at] = std::numeric_limits<float>::quiet_NaN();
        own_index_[at] = int32_t(own_.size());
        OwnVectors& own = own_.emplace_back();
        for (size_t k = 0; k < 4; ++k)
            for (int i = 0; i < run_samples; ++i) own.of[k][i] = rows[k][std::min(first_of(run) + i, grid_.width - 1)];
    }
}

bool GroupMotion::is_still(size_t run) const {
    float sum = 0;  // NaN where it is no line
    for (const auto* part : {&lines_.base_u, &lines_.base_du, &lines_.base_v, &lines_.base_dv, &lines_.step_u,
                             &lines_.step_du, &lines_.step_v, &lines_.step_dv})
        sum += std::abs((*part)[run]);
    return sum == 0;
}

void GroupMotion::mark_moving(std::span<uint8_t> marks) const {
    assert(marks.size() == size_t(grid_.width) * size_t(grid_.height));
    for (int y = 0; y < grid_.height; ++y)
        for (int run = 0; run < runs_; ++run) {
            if (is_still(size_t(y) * size_t(runs_) + size_t(run))) continue;
            const int first = run * run_samples;
            std::fill_n(&marks[size_t(y) * size_t(grid_.width) + size_t(first)],
                        std::min(run_samples, grid_.width - first), uint8_t(1));
        }
}

double GroupMotion::linear_share() const {
    return own_index_.empty() ? 0 : 1 - double(own_.size()) / double(own_index_.size());
}

void GroupMotion::vectors(int y, float fraction, float* u_out, float* v_out) const {
    for (int run = 0; run < runs_; ++run) {
        const size_t at = size_t(y) * size_t(runs_) + size_t(run);
        const auto component = [&](const std::vector<float>& base, const std::vector<float>& step) {
            return base[at] + fraction * step[at];
        };
        const float u = component(lines_.base_u, lines_.step_u), du = component(lines_.base_du, lines_.step_du);
        const float v = component(lines_.base_v, lines_.step_v), dv = component(lines_.base_dv, lines_.step_dv);
        const OwnVectors* const own = own_vectors(run, y);
        for (int k = 0; k < std::min(run_samples, grid_.width); ++k) {
            const int x = first_of(run) + k;
            u_out[x] = own ? own->of[0][k] + fraction * own->of[2][k] : u + float(k) * du;
            v_out[x] = own ? own->of[1][k] + fraction * own->of[3][k] : v + float(k) * dv;
        }
    }
}

}  // namespace ols
#endif

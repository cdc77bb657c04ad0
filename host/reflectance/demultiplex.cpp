// SPDX-License-Identifier: MIT
// Two exact inversions: a plan of additions where the basis has a known structure (hadamard_plan.hpp), and for any other
// a small integer matrix product, tiled so that a tile of all rows stays in the second-level cache (159 rows x 256
// samples x 4 bytes = 163 KB) while every lamp is summed from it. Both give the same bits.
#include "reflectance/demultiplex.hpp"

#include <algorithm>
#include <atomic>
#include <cassert>
#include <cmath>
#include <map>
#include <memory>
#include <mutex>
#include <thread>
#include <vector>

#include "reflectance/hadamard_tile.hpp"

namespace ols {

namespace {

constexpr size_t block_samples = 256;
constexpr int lamps_at_once = 4;  // share each load of a row

// A vector of what row samples are summed in: one AVX2 register, two of SSE2. Tiles are aligned for their elements only.
template <typename Sum>
struct Arithmetic {
    typedef Sum Vector __attribute__((vector_size(32), aligned(sizeof(Sum)), may_alias));
};

// sums[lamp][p] of four lamps over one tile[row * block_samples + p]; weights[row * lamps_at_once + lamp].
template <typename Sum>
__attribute__((always_inline)) inline void sum_tile(const Sum* tile, int rows, const Sum* weights,
                                                    Sum (*sums)[block_samples]) {
    using Vector = typename Arithmetic<Sum>::Vector;
    for (size_t p = 0; p < block_samples; p += sizeof(Vector) / sizeof(Sum)) {
        // Four names instead of an array: the compiler keeps these in registers.
        Vector sum0{}, sum1{}, sum2{}, sum3{};
        for (int r = 0; r < rows; ++r) {
            const Vector y = *reinterpret_cast<const Vector*>(tile + size_t(r) * block_samples + p);
            const auto* w = weights + size_t(r) * lamps_at_once;
            sum0 += y * w[0], sum1 += y * w[1], sum2 += y * w[2], sum3 += y * w[3];
        }
        *reinterpret_cast<Vector*>(sums[0] + p) = sum0;
        *reinterpret_cast<Vector*>(sums[1] + p) = sum1;
        *reinterpret_cast<Vector*>(sums[2] + p) = sum2;
        *reinterpret_cast<Vector*>(sums[3] + p) = sum3;
    }
}

template <typename Sum>
void sum_tile_portable(const Sum* tile, int rows, const Sum* weights, Sum (*sums)[block_samples]) {
    sum_tile<Sum>(tile, rows, weights, sums);
}

#if defined(__x86_64__)
template <typename Sum>
__attribute__((target("avx2"))) void sum_tile_avx2(const Sum* tile, int rows, const Sum* weights,
                                                   Sum (*sums)[block_samples]) {
    sum_tile<Sum>(tile, rows, weights, sums);
}
#endif

// Chosen at run time: shipped binaries are built for the baseline processor. Integer sums agree by nature; double sums
// agree because each lane adds its rows in the same order and products are not fused.
template <typename Sum>
auto best_sum_tile() {
#if defined(__x86_64__)
    if (__builtin_cpu_supports("avx2")) return sum_tile_avx2<Sum>;
#endif
    return sum_tile_portable<Sum>;
}

// Weights as the kernel reads them: [group of four lamps][row][lamp in group], zero beyond the last lamp.
template <typename Sum>
std::vector<Sum> grouped_weights(const Basis& basis) {
    const int groups = (basis.images() + lamps_at_once - 1) / lamps_at_once;
    std::vector<Sum> weights(size_t(groups) * basis.rows * lamps_at_once);
    for (int r = 0; r < basis.rows; ++r)
        for (int i = 0; i < basis.images(); ++i)
            weights[(size_t(i / lamps_at_once) * basis.rows + r) * lamps_at_once + i % lamps_at_once] =
                basis.has_integers() ? Sum(basis.weight(r, i)) : Sum(basis.inverse(r, i));
    return weights;
}

// Runs `threads` workers, each calling its own work(begin, count) for tiles it takes from a shared counter. Tiles are
// independent, so who takes which does not matter.
template <typename MakeWorker>
void for_each_tile(size_t samples, int threads, const MakeWorker& make_worker) {
    std::atomic<size_t> next{0};
    const auto run = [&] {
        auto work = make_worker();
        for (size_t begin; (begin = next.fetch_add(block_samples)) < samples;)
            work(begin, std::min(block_samples, samples - begin));
    };
    if (threads <= 0) threads = std::max(1, int(std::thread::hardware_concurrency()));
    std::vector<std::jthread> others;
    for (int t = 1; t < threads; ++t) others.emplace_back(run);
    run();
}

std::vector<float> sample_factors(const Basis& basis, size_t samples, const DemultiplexOptions& options) {
    const double scale = basis.has_integers() ? basis.scale : 1;
    std::vector<float> factors(samples, float(scale));
    for (size_t p = 0; p < options.gain.size(); ++p) factors[p] = float(scale * double(options.gain[p]));
    return factors;
}

// A plan and its layout, made once for each basis of a known name; null where there is none.
struct LaidOutPlan {
    std::vector<int8_t> weights;  // of the basis that it was made for
    HadamardPlan plan;
    SumCode code;
};

std::shared_ptr<const LaidOutPlan> plan_for(const Basis& basis) {
    static std::mutex mutex;
    static std::map<std::string, std::shared_ptr<const LaidOutPlan>> plans;
    const std::lock_guard lock(mutex);
    const auto known = plans.find(basis.name);
    if (known != plans.end() && (!known->second || known->second->weights == basis.weights)) return known->second;
    std::shared_ptr<const LaidOutPlan> made;
    if (auto plan = hadamard_plan(basis)) {
        SumCode code = lay_out(plan->plan, {plan->extra_row});
        made = std::make_shared<LaidOutPlan>(LaidOutPlan{basis.weights, std::move(*plan), std::move(code)});
    }
    return plans[basis.name] = made;
}

void demultiplex_by_plan(const LaidOutPlan& made, const Basis& basis, std::span<const int32_t* const> rows,
                         size_t samples, std::span<float* const> lamps, const DemultiplexOptions& options) {
    const auto factors = sample_factors(basis, samples, options);
    const HadamardJob job{&made.plan, &made.code, {}, rows, lamps, {}, factors};
    for_each_tile(samples, options.threads, [&] {
        return [&, scratch = std::make_unique<TileScratch>(made.code)](size_t begin, size_t count) {
            TileCounts counts;
            invert_tiles(job, begin, begin + count, *scratch, counts);
        };
    });
}

template <typename Sum, typename Sample>
void demultiplex_samples(const Basis& basis, std::span<const Sample* const> rows, size_t samples,
                         std::span<float* const> lamps, const DemultiplexOptions& options) {
    assert(int(rows.size()) == basis.rows && int(lamps.size()) == basis.images());
    assert(options.gain.empty() || options.gain.size() == samples);
    const auto weights = grouped_weights<Sum>(basis);
    const auto kernel = best_sum_tile<Sum>();
    const auto factors = sample_factors(basis, samples, options);

    const auto make_worker = [&] {
        return [&, tile = std::vector<Sum>(rows.size() * block_samples)](size_t begin, size_t count) mutable {
            for (size_t r = 0; r < rows.size(); ++r)
                std::copy_n(rows[r] + begin, count, tile.data() + r * block_samples);
            for (int first = 0; first < basis.images(); first += lamps_at_once) {
                Sum sums[lamps_at_once][block_samples];
                kernel(tile.data(), basis.rows, weights.data() + size_t(first) * basis.rows, sums);
                for (int k = 0; k < std::min(lamps_at_once, basis.images() - first); ++k)
                    for (size_t p = 0; p < count; ++p)
                        lamps[first + k][begin + p] = float(sums[k][p]) * factors[begin + p];
            }
        };
    };
    for_each_tile(samples, options.threads, make_worker);
}

}  // namespace

void demultiplex(const Basis& basis, std::span<const int32_t* const> rows, size_t samples,
                 std::span<float* const> lamps, const DemultiplexOptions& options) {
    assert(int(rows.size()) == basis.rows && int(lamps.size()) == basis.images());
    if (const auto made = plan_for(basis))
        demultiplex_by_plan(*made, basis, rows, samples, lamps, options);
    else if (basis.has_integers())
        demultiplex_samples<int32_t>(basis, rows, samples, lamps, options);
    else
        demultiplex_samples<double>(basis, rows, samples, lamps, options);
}

void demultiplex(const Basis& basis, std::span<const float* const> rows, size_t samples, std::span<float* const> lamps,
                 const DemultiplexOptions& options) {
    demultiplex_samples<double>(basis, rows, samples, lamps, options);
}

void combine_masks(std::span<const uint32_t* const> rows, size_t samples, uint32_t* out) {
    for (const uint32_t* row : rows)
        for (size_t p = 0; p < samples; ++p) out[p] |= row[p];
}

void estimate_variance(const Basis& basis, std::span<const int32_t* const> rows, size_t samples,
                       const NoiseModel& noise, std::span<const float> gain, float* out) {
    assert(int(rows.size()) == basis.rows && (gain.empty() || gain.size() == samples));
    std::vector<double> sums(samples);
    for (int r = 0; r < basis.rows; ++r) {
        double squares = 0;
        for (int i = 0; i < basis.images(); ++i) squares += basis.inverse(r, i) * basis.inverse(r, i);
        for (size_t p = 0; p < samples; ++p) {
            const double sigma = noise.read_counts + noise.shot * std::sqrt(double(std::max(rows[r][p], 0)));
            sums[p] += squares / basis.images() * sigma * sigma;
        }
    }
    for (size_t p = 0; p < samples; ++p) {
        const double factor = gain.empty() ? 1.0 : gain[p];
        out[p] = float(factor * factor * sums[p]);
    }
}

}  // namespace ols

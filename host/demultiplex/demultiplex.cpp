// SPDX-License-Identifier: MIT
// A plan of additions where the basis has a known structure (hadamard_plan.hpp); a factor where each row is an image of its own
// (single lamps, scaled_row.hpp); for any other a matrix product by OpenBLAS, in blocks of samples that stay in the
// second-level cache (159 rows x 256 samples x 4 bytes = 163 KB). Integer weights are exact in all: sums of whole numbers below
// 2^24 are exact in float, whatever their order, and below 2^53 in double.
#include "demultiplex/demultiplex.hpp"

#include <cblas.h>

#include <algorithm>
#include <atomic>
#include <cassert>
#include <cmath>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <vector>

#include "demultiplex/fill_model.hpp"
#include "demultiplex/hadamard_tile.hpp"
#include "demultiplex/scaled_row.hpp"
#include "worker_threads.hpp"

namespace ols {

namespace {

constexpr size_t block_samples = 8 * tile_samples;

// Runs `threads` workers, each calling its own work(begin, count) for blocks it takes from a shared counter. Blocks are
// independent, so who takes which does not matter.
template <typename MakeWorker>
void for_each_block(size_t samples, size_t block, int threads, const MakeWorker& make_worker) {
    std::atomic<size_t> next{0};
    run_workers(thread_count(threads), [&](int) {
        auto work = make_worker();
        for (size_t begin; (begin = next.fetch_add(block)) < samples;) work(begin, std::min(block, samples - begin));
    });
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
};

std::shared_ptr<const LaidOutPlan> plan_for(const Basis& basis) {
    static std::mutex mutex;
    static std::map<std::string, std::shared_ptr<const LaidOutPlan>> plans;
    const std::lock_guard lock(mutex);
    const auto known = plans.find(basis.name);
    if (known != plans.end() && (!known->second || known->second->weights == basis.weights)) return known->second;
    std::shared_ptr<const LaidOutPlan> made;
    if (auto plan = hadamard_plan(basis))
        made = std::make_shared<LaidOutPlan>(LaidOutPlan{basis.weights, std::move(*plan)});
    return plans[basis.name] = made;
}

template <typename Sample>
void demultiplex_by_plan(const LaidOutPlan& made, const Basis& basis, std::span<const Sample* const> rows,
                         size_t samples, std::span<float* const> lamps, const DemultiplexOptions& options) {
    const auto factors = sample_factors(basis, samples, options);
    HadamardJob job{.plan = &made.plan,
                    .floats = {lamps},
                    .factors = factors,
                    .offsets = options.offsets,
                    .filler = options.filler};
    if constexpr (std::is_same_v<Sample, int16_t>)
        job.rows16 = {rows};
    else
        job.rows32 = {rows};
    for_each_block(samples, block_samples, options.threads, [&] {
        return [&, scratch = std::make_unique<TileScratch>(made.plan)](size_t begin, size_t count) {
            TileCounts counts;
            invert_tiles(job, begin, begin + count, *scratch, counts);
        };
    });
}

// The inversion of any basis as a matrix, images x rows, in both precisions.
struct InverseMatrix {
    std::vector<float> floats;
    std::vector<double> doubles;
    double counts_limit = 0;  // below it, sums of counts are exact in float

    explicit InverseMatrix(const Basis& basis) {
        double largest = 0;  // sum of the magnitudes of an image's weights
        for (int i = 0; i < basis.images(); ++i) {
            double magnitude = 0;
            for (int r = 0; r < basis.rows; ++r) {
                doubles.push_back(basis.has_integers() ? basis.weight(r, i) : basis.inverse(r, i));
                magnitude += std::abs(doubles.back());
            }
            largest = std::max(largest, magnitude);
        }
        floats.assign(doubles.begin(), doubles.end());
        if (basis.has_integers()) counts_limit = double(1 << 24) / largest;
    }
};

// All rows of up to block_samples samples, inverted.
template <typename Real>
struct Block {
    std::vector<Real> rows, images;  // empty until first used

    template <typename Sample>
    void invert(const Basis& basis, const std::vector<Real>& matrix, const std::vector<const Sample*>& from,
                size_t count) {
        rows.resize(size_t(basis.rows) * block_samples);
        images.resize(size_t(basis.images()) * block_samples);
        for (size_t r = 0; r < from.size(); ++r) std::copy_n(from[r], count, rows.data() + r * block_samples);
        const auto product = [&](auto gemm) {
            gemm(CblasRowMajor, CblasNoTrans, CblasNoTrans, basis.images(), int(block_samples), basis.rows, 1,
                 matrix.data(), basis.rows, rows.data(), int(block_samples), 0, images.data(), int(block_samples));
        };
        if constexpr (std::is_same_v<Real, float>)
            product(cblas_sgemm);
        else
            product(cblas_dgemm);
    }
};

// The rows of a block as 32-bit counts, masked ones filled.
template <typename Sample>
class CountBlock {
  public:
    CountBlock(const Basis& basis, const SampleFiller* filler)
        : filler_(filler),
          is_copied_(filler || !std::is_same_v<Sample, int32_t>),
          counts_(is_copied_ ? size_t(basis.rows) * block_samples : 0),
          tile_(size_t(basis.rows) * tile_samples) {}

    // from: the rows at the block's begin. What is returned lasts until the next call.
    std::vector<const int32_t*> load(const std::vector<const Sample*>& from, size_t begin, size_t count) {
        if constexpr (std::is_same_v<Sample, int32_t>)
            if (!is_copied_) return from;
        std::vector<const int32_t*> rows;
        for (size_t r = 0; r < from.size(); ++r) {
            int32_t* const to = counts_.data() + r * block_samples;
            copy(from[r], count, to);
            rows.push_back(to);
        }
        for (size_t at = 0; filler_ && at < count; at += tile_samples)
            fill_tile(from.size(), begin, at, std::min(tile_samples, count - at));
        return rows;
    }

  private:
    void copy(const Sample* from, size_t count, int32_t* to) const {
        const auto widened = [](Sample sample) {
            return sample == masked_sample<Sample> ? masked_sample<int32_t> : int32_t(sample);
        };
        if (!from)
            std::fill_n(to, count, masked_sample<int32_t>);
        else if (filler_)
            std::transform(from, from + count, to, widened);
        else
            std::copy_n(from, count, to);
    }

    void fill_tile(size_t rows, size_t begin, size_t at, size_t count) {
        bool masked = false;
        for (size_t r = 0; r < rows; ++r) {
            const int32_t* const row = counts_.data() + r * block_samples + at;
            std::fill(std::copy_n(row, count, tile_.data() + r * tile_samples), tile_.data() + (r + 1) * tile_samples,
                      0);
            masked = masked || std::find(row, row + count, masked_sample<int32_t>) != row + count;
        }
        if (!masked) return;
        filler_->fill(tile_.data(), begin + at, count);
        for (size_t r = 0; r < rows; ++r)
            std::copy_n(tile_.data() + r * tile_samples, count, counts_.data() + r * block_samples + at);
    }

    const SampleFiller* filler_;
    bool is_copied_;
    std::vector<int32_t> counts_, tile_;
};

double largest_count(const std::vector<const int32_t*>& rows, size_t count) {
    double largest = 0;
    for (const int32_t* row : rows)
        for (size_t p = 0; p < count; ++p) largest = std::max(largest, std::abs(double(row[p])));
    return largest;
}

// Both precisions of a block, of which the counts choose one.
class MatrixWorker {
  public:
    MatrixWorker(const Basis& basis, const InverseMatrix& matrix, std::span<float* const> lamps,
                 std::span<const float> factors, std::span<const float* const> offsets)
        : basis_(basis), matrix_(matrix), lamps_(lamps), factors_(factors), offsets_(offsets) {}

    template <typename Sample>
    void invert(const std::vector<const Sample*>& rows, size_t begin, size_t count) {
        multiply(rows, begin, count);
        for (size_t i = 0; i < offsets_.size(); ++i)
            for (size_t p = begin; p < begin + count; ++p) lamps_[i][p] -= offsets_[i][p];
    }

  private:
    template <typename Sample>
    void multiply(const std::vector<const Sample*>& rows, size_t begin, size_t count) {
        bool fits_float = false;
        if constexpr (std::is_same_v<Sample, int32_t>) fits_float = largest_count(rows, count) < matrix_.counts_limit;
        if (fits_float)
            multiply(small_, matrix_.floats, rows, begin, count);
        else
            multiply(large_, matrix_.doubles, rows, begin, count);
    }

    template <typename Real, typename Sample>
    void multiply(Block<Real>& block, const std::vector<Real>& matrix, const std::vector<const Sample*>& rows,
                  size_t begin, size_t count) {
        block.invert(basis_, matrix, rows, count);
        store(block.images, begin, count);
    }

    template <typename Real>
    void store(const std::vector<Real>& images, size_t begin, size_t count) {
        for (size_t i = 0; i < lamps_.size(); ++i)
            for (size_t p = 0; p < count; ++p)
                lamps_[i][begin + p] = float(images[i * block_samples + p]) * factors_[begin + p];
    }

    const Basis& basis_;
    const InverseMatrix& matrix_;
    std::span<float* const> lamps_;
    std::span<const float> factors_;
    std::span<const float* const> offsets_;
    Block<float> small_;
    Block<double> large_;
};

// From a block's first sample on; null where a row is.
template <typename Sample>
std::vector<const Sample*> rows_at(std::span<const Sample* const> rows, size_t begin) {
    std::vector<const Sample*> from;
    for (const Sample* row : rows) from.push_back(row ? row + begin : nullptr);
    return from;
}

template <typename Sample>
void demultiplex_by_matrix(const InverseMatrix& matrix, const Basis& basis, std::span<const Sample* const> rows,
                           size_t samples, std::span<float* const> lamps, const DemultiplexOptions& options) {
    const auto factors = sample_factors(basis, samples, options);
    for_each_block(samples, block_samples, options.threads, [&] {
        MatrixWorker worker(basis, matrix, lamps, factors, options.offsets);
        if constexpr (std::is_same_v<Sample, float>)
            return [&, worker = std::move(worker)](size_t begin, size_t count) mutable {
                worker.invert(rows_at(rows, begin), begin, count);
            };
        else
            return [&, worker = std::move(worker), counts = CountBlock<Sample>(basis, options.filler)](
                       size_t begin, size_t count) mutable {
                worker.invert(counts.load(rows_at(rows, begin), begin, count), begin, count);
            };
    });
}

// By image the weight of its row, where each row is an image of its own; else empty.
std::vector<double> own_weights(const Basis& basis) {
    if (!is_one_image_a_row(basis)) return {};
    std::vector<double> weights;
    for (int i = 0; i < basis.images(); ++i)
        weights.push_back(basis.has_integers() ? basis.weight(i, i) : basis.inverse(i, i));
    return weights;
}

template <typename Sample>
void demultiplex_by_scale(const std::vector<double>& weights, const Basis& basis, std::span<const Sample* const> rows,
                          size_t samples, std::span<float* const> lamps, const DemultiplexOptions& options) {
    const auto factors = sample_factors(basis, samples, options);
    const auto scale = [&](const auto& from, size_t begin, size_t count) {
        for (size_t i = 0; i < lamps.size(); ++i) {
            const float* const offsets = options.offsets.empty() ? nullptr : options.offsets[i] + begin;
            scale_row(from[i], count, {weights[i], &factors[begin], offsets}, lamps[i] + begin);
        }
    };
    if constexpr (!std::is_same_v<Sample, float>)
        if (options.filler)
            return for_each_block(samples, block_samples, options.threads, [&] {
                return [&, counts = CountBlock<Sample>(basis, options.filler)](size_t begin, size_t count) mutable {
                    scale(counts.load(rows_at(rows, begin), begin, count), begin, count);
                };
            });
    constexpr size_t long_block = 16 * block_samples;  // so that memory is read and written in long runs
    for_each_block(samples, long_block, options.threads,
                   [&] { return [&](size_t begin, size_t count) { scale(rows_at(rows, begin), begin, count); }; });
}

}  // namespace

struct Demultiplexer::Ready {
    const Basis& basis;
    std::shared_ptr<const LaidOutPlan> plan;
    std::vector<double> weights;  // own_weights()
    std::once_flag matrix_made;
    std::optional<InverseMatrix> matrix;

    template <typename Sample>
    void invert(std::span<const Sample* const> rows, size_t samples, std::span<float* const> lamps,
                const DemultiplexOptions& options) {
        assert(int(rows.size()) == basis.rows && int(lamps.size()) == basis.images());
        assert(options.gain.empty() || options.gain.size() == samples);
        if constexpr (!std::is_same_v<Sample, float>)
            if (plan) return demultiplex_by_plan(*plan, basis, rows, samples, lamps, options);
        if (!weights.empty()) return demultiplex_by_scale(weights, basis, rows, samples, lamps, options);
        std::call_once(matrix_made, [&] {
            openblas_set_num_threads(1);  // blocks are what runs in parallel
            matrix.emplace(basis);
        });
        demultiplex_by_matrix(*matrix, basis, rows, samples, lamps, options);
    }
};

Demultiplexer::Demultiplexer(const Basis& basis)
    : ready_(new Ready{basis, plan_for(basis), own_weights(basis), {}, {}}) {}

Demultiplexer::~Demultiplexer() = default;

void Demultiplexer::invert(std::span<const int32_t* const> rows, size_t samples, std::span<float* const> lamps,
                           const DemultiplexOptions& options) const {
    ready_->invert(rows, samples, lamps, options);
}

void Demultiplexer::invert(std::span<const int16_t* const> rows, size_t samples, std::span<float* const> lamps,
                           const DemultiplexOptions& options) const {
    ready_->invert(rows, samples, lamps, options);
}

void Demultiplexer::invert(std::span<const float* const> rows, size_t samples, std::span<float* const> lamps,
                           const DemultiplexOptions& options) const {
    assert(!options.filler);
    ready_->invert(rows, samples, lamps, options);
}

}  // namespace ols

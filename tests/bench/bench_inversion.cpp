// SPDX-License-Identifier: MIT
// The inversion of a basis to single lamps: arithmetic and method, what it writes, how images are stored, SIMD path.
// links: ols_demultiplex ols_bench_openblas Eigen3::Eigen
#include <cblas.h>

#include <half.h>
#include <Eigen/Core>
#include <cmath>
#include <cstring>
#include <memory>

#include "bench.hpp"
#include "demultiplex/demultiplex.hpp"
#include "demultiplex/hadamard_tile.hpp"
#include "four_russians.hpp"
#include "openblas_kernel.hpp"

using namespace ols;

namespace {

// Images behind each other, aligned as a camera's memory is: 640 x 480 of 16 bits are a multiple of 4 KB.
template <typename Sample>
struct Images {
    std::unique_ptr<Sample[], decltype(&std::free)> samples;
    size_t pitch;

    Images(int images, size_t samples_of_image)
        : samples(nullptr, &std::free), pitch((samples_of_image + tile_samples - 1) / tile_samples * tile_samples) {
        const size_t bytes = (size_t(images) * pitch * sizeof(Sample) + 4095) / 4096 * 4096;
        samples.reset(static_cast<Sample*>(std::aligned_alloc(4096, bytes)));
        std::memset(samples.get(), 0, bytes);
    }
    std::vector<Sample*> plain(int images) const {
        std::vector<Sample*> first;
        for (int i = 0; i < images; ++i) first.push_back(samples.get() + size_t(i) * pitch);
        return first;
    }
    std::vector<Sample*> tiled(int images) const {
        std::vector<Sample*> first;
        for (int i = 0; i < images; ++i) first.push_back(samples.get() + size_t(i) * tile_samples);
        return first;
    }
};

// One basis, rows of 12-bit counts above black, room for every kind of output, and every way from the ones to the other.
class Inversion {
  public:
    Inversion(const std::string& name, size_t samples)
        : basis(*find_basis(name)),
          plan(*hadamard_plan(basis)),
          samples_(samples),
          rows_(basis.rows, samples),
          tiles_(basis.rows, samples),
          wide_rows_(basis.rows, samples),
          float_rows_(basis.rows, samples),
          shorts_(basis.images(), samples),
          halves_(basis.images(), samples),
          floats_(basis.images(), samples),
          factors_(samples, float(basis.scale)),
          scratch_(plan) {
        uint32_t random = 1;
        for (int r = 0; r < basis.rows; ++r) {
            int lit = 0;
            for (int lamp = 0; lamp < basis.lamps; ++lamp) lit += basis.lit(r, lamp);
            for (size_t p = 0; p < samples; ++p) {
                random = random * 1664525 + 1013904223;
                const auto count = int16_t(11 * lit + int(random >> 24));  // 11 counts a lamp, and 8 bits of noise
                rows_.samples[size_t(r) * rows_.pitch + p] = count;
                tiles_.samples[(p / tile_samples * size_t(basis.rows) + size_t(r)) * tile_samples + p % tile_samples] =
                    count;
                wide_rows_.samples[size_t(r) * rows_.pitch + p] = count * 64;
            }
        }
        for (int i = 0; i < basis.images(); ++i)
            for (int r = 0; r < basis.rows; ++r) scaled_weights_.push_back(float(basis.inverse(r, i)));
    }

    enum class Rows { plain, tiled, wide };

    template <typename Value>
    Setting structured(const std::string& name, Rows from, const Images<Value>& to, bool tiled_output) {
        const auto run = [this, from, &to, tiled_output] {
            const auto plain = rows_.plain(basis.rows), tiled = tiles_.tiled(basis.rows);
            const auto wide = wide_rows_.plain(basis.rows);
            const std::vector<const int16_t*> rows16 = from == Rows::tiled ? constant(tiled) : constant(plain);
            const std::vector<const int32_t*> rows32 = constant(wide);
            const std::vector<Value*> images = tiled_output ? to.tiled(basis.images()) : to.plain(basis.images());
            HadamardJob job{.plan = &plan, .factors = factors_};
            if (from == Rows::wide)
                job.rows32 = {rows32};
            else
                job.rows16 = {rows16, from == Rows::tiled ? size_t(basis.rows) * tile_samples : tile_samples};
            const Planes<Value> planes{images, tiled_output ? size_t(basis.images()) * tile_samples : tile_samples};
            if constexpr (std::is_same_v<Value, int16_t>) job.shorts = planes;
            if constexpr (std::is_same_v<Value, float>) job.floats = planes;
            if constexpr (std::is_same_v<Value, uint16_t>) job.halves = planes;
            TileCounts counts;
            invert_tiles(job, 0, samples_, scratch_, counts);
        };
        const auto error = [this, from, &to, tiled_output] {
            const Planes<Value> layout{{}, tiled_output ? size_t(basis.images()) * tile_samples : tile_samples};
            return largest_error([&](int image, size_t p) {
                const size_t first = size_t(image) * (tiled_output ? tile_samples : to.pitch);
                const Value value = to.samples[first + layout.offset(p)];
                if constexpr (std::is_same_v<Value, int16_t>) return basis.scale * value;
                if constexpr (std::is_same_v<Value, uint16_t>) return double(Imath::half(Imath::half::FromBits, value));
                return double(value) / (from == Rows::wide ? 64 : 1);
            });
        };
        return {name, run, error};
    }

    // Of a single precision product of the counts as floats, by `product`.
    Setting product(const std::string& name, void (Inversion::*product)()) {
        const auto run = [this, product] {
            const size_t values = size_t(basis.rows) * rows_.pitch;
            for (size_t at = 0; at < values; ++at) float_rows_.samples[at] = rows_.samples[at];
            (this->*product)();
        };
        return {name, run, [this] { return float_error(); }};
    }
    Setting openblas() {
        Setting setting = product("OpenBLAS sgemm", &Inversion::by_openblas);
        setting.detail = openblas_kernel_note();
        return setting;
    }
    void by_openblas() {
        cblas_sgemm(CblasRowMajor, CblasNoTrans, CblasNoTrans, basis.images(), int(rows_.pitch), basis.rows, 1,
                    scaled_weights_.data(), basis.rows, float_rows_.samples.get(), int(rows_.pitch), 0,
                    floats_.samples.get(), int(rows_.pitch));
    }
    void by_eigen() {
        using Matrix = Eigen::Matrix<float, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
        const Eigen::Map<const Matrix> weights(scaled_weights_.data(), basis.images(), basis.rows);
        const Eigen::Map<const Matrix> rows(float_rows_.samples.get(), basis.rows, Eigen::Index(rows_.pitch));
        Eigen::Map<Matrix> images(floats_.samples.get(), basis.images(), Eigen::Index(rows_.pitch));
        images.noalias() = weights * rows;
    }

    Setting four_russians() {
        const auto run = [this] {
            const auto rows = rows_.plain(basis.rows);
            const auto images = floats_.plain(basis.images());
            invert_by_four_russians(basis, rows, rows_.pitch, images);
        };
        return {"four Russians, int16", run, [this] { return float_error(); }};
    }

    // The path for any basis, which this one takes when its name is not known.
    Setting any_basis() {
        const auto run = [this] {
            Basis unnamed = basis;
            unnamed.name.clear();
            const auto rows = wide_rows_.plain(basis.rows);
            const auto images = floats_.plain(basis.images());
            demultiplex(unnamed, std::span<const int32_t* const>(constant(rows)), samples_, images,
                        {.gain = {}, .threads = 1});
        };
        const auto error = [this] {
            return largest_error(
                [&](int image, size_t p) { return floats_.samples[size_t(image) * floats_.pitch + p] / 64; });
        };
        return {"matrix product, exact", run, error};
    }

    const Images<float>& floats() const { return floats_; }
    const Images<int16_t>& shorts() const { return shorts_; }
    const Images<uint16_t>& halves() const { return halves_; }

    const Basis basis;
    const HadamardPlan plan;

  private:
    template <typename Sample>
    static std::vector<const Sample*> constant(const std::vector<Sample*>& pointers) {
        return {pointers.begin(), pointers.end()};
    }

    double float_error() const {
        return largest_error([&](int image, size_t p) { return floats_.samples[size_t(image) * floats_.pitch + p]; });
    }

    template <typename Value>
    double largest_error(const Value& value) const {
        double largest = 0;
        for (size_t p = 0; p < samples_; p += std::max<size_t>(1, samples_ / 1000))
            for (int i = 0; i < basis.images(); ++i) {
                int64_t sum = 0;
                for (int r = 0; r < basis.rows; ++r)
                    sum += int64_t(basis.weight(r, i)) * rows_.samples[size_t(r) * rows_.pitch + p];
                largest = std::max(largest, std::abs(double(value(i, p)) - basis.scale * double(sum)));
            }
        return largest;
    }

    size_t samples_;
    Images<int16_t> rows_, tiles_;
    Images<int32_t> wide_rows_;
    Images<float> float_rows_;
    Images<int16_t> shorts_;
    Images<uint16_t> halves_;
    Images<float> floats_;
    std::vector<float> factors_, scaled_weights_;
    TileScratch scratch_;
};

using Rows = Inversion::Rows;

void measure_methods(Bench& bench, Inversion& work) {
    bench.measure(
        {.name = "method",
         .set_by = "the basis: `hadamard_plan`",
         .error_unit = "counts, largest",
         .peer = "OpenBLAS sgemm",
         .default_setting = "structured int16",
         .why_off_front =
             "frames come as images and the chain reads floats; tiles and shorts are for who can use them.",
         .settings = {work.openblas(), work.product("Eigen sgemm", &Inversion::by_eigen), work.four_russians(),
                      work.any_basis(), work.structured("structured int32", Rows::wide, work.floats(), false),
                      work.structured("structured int16", Rows::plain, work.floats(), false),
                      work.structured("structured int16, tiles to shorts", Rows::tiled, work.shorts(), true)}});
}

void measure_storage(Bench& bench, Inversion& work) {
    bench.measure({.name = "output and storage",
                   .set_by = "`HadamardJob`",
                   .error_unit = "counts, largest",
                   .peer = "OpenBLAS sgemm",
                   .default_setting = "images to floats",
                   .why_off_front = "floats in images are what the rest of the chain reads.",
                   .settings = {work.openblas(), work.structured("images to floats", Rows::plain, work.floats(), false),
                                work.structured("images to halves", Rows::plain, work.halves(), false),
                                work.structured("images to shorts", Rows::plain, work.shorts(), false),
                                work.structured("tiles to floats", Rows::tiled, work.floats(), false),
                                work.structured("tiles to halves", Rows::tiled, work.halves(), false),
                                work.structured("tiles to shorts", Rows::tiled, work.shorts(), false),
                                work.structured("tiles to floats in tiles", Rows::tiled, work.floats(), true),
                                work.structured("tiles to shorts in tiles", Rows::tiled, work.shorts(), true)}});
}

void measure_paths(Bench& bench, Inversion& work) {
    std::vector<Setting> settings;
    for (const char* path : tile_paths()) {
        Setting setting = work.structured(path, Rows::tiled, work.shorts(), true);
        setting.run = [path, run = setting.run] {
            choose_tile_path(path);
            run();
            choose_tile_path(nullptr);
        };
        settings.push_back(setting);
    }
    bench.measure({.name = "SIMD path",
                   .set_by = "the processor (by Highway's names: AVX3 is AVX-512)",
                   .error_unit = "counts, largest",
                   .peer = settings.back().name,
                   .default_setting = settings.front().name,
                   .settings = settings,
                   .differs_by_machine = true});
}

void measure_bases(Bench& bench, Inversion& s159, Inversion& hadamard156) {
    bench.measure({.name = "structured basis",
                   .set_by = "`stagectl run --basis`",
                   .error_unit = "counts, largest",
                   .peer = "OpenBLAS sgemm",
                   .default_setting = "s159",
                   .settings = {s159.openblas(), s159.structured("s159", Rows::tiled, s159.shorts(), true),
                                hadamard156.structured("hadamard156", Rows::tiled, hadamard156.shorts(), true)}});
}

}  // namespace

int main(int argc, char** argv) {
    choose_openblas_kernel(argc, argv, {.rows = 156, .columns = 640 * 48, .inner = 159});
    openblas_set_num_threads(1);
    Bench bench(
        argc, argv,
        {.name = "inversion",
         .truth = "Exact integer sums. 640 x 480 samples of 12 bits in 159 rows (156 for hadamard156) become 156 "
                  "lamps, on one thread; conversions between counts and floats are part of the work.",
         .advice = "The structured inversion is exact and is chosen by itself. Where memory is what limits, store "
                   "frames in tiles as they arrive and keep results as shorts, which are exact too."});
    const size_t samples = bench.full() ? 640 * 480 : 1000;
    Inversion s159("s159", samples), hadamard156("hadamard156", samples);
    measure_methods(bench, s159);
    measure_storage(bench, s159);
    measure_paths(bench, s159);
    measure_bases(bench, s159, hadamard156);
    return bench.finish();
}

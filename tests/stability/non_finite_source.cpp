// SPDX-License-Identifier: MIT
// A float source that delivers NaN or Inf in one row: all 156 lamps of the pixel rest on it.
// links: ols_develop ols_archive
#include <algorithm>
#include <array>
#include <cmath>
#include <filesystem>
#include <limits>
#include <memory>
#include <random>

#include "archive/archive.hpp"
#include "develop/develop.hpp"
#include "hard_case.hpp"

using namespace ols;

namespace {

constexpr int width = 6, height = 4, pixels = width * height;
constexpr float inf = std::numeric_limits<float>::infinity(), nan = std::numeric_limits<float>::quiet_NaN();
struct Fault {
    int row, pixel;
    float value;
};
constexpr std::array faults = {Fault{70, 3, nan}, Fault{0, 9, inf}, Fault{158, 14, -inf}};

bool is_faulty(size_t pixel) {
    return std::any_of(faults.begin(), faults.end(), [&](const Fault& f) { return size_t(f.pixel) == pixel; });
}

Sequence s159_sequence() {
    SequenceConfig config;
    config.basis = "s159";
    config.basis_exposure_us = 100;
    return *compile_sequence(config, default_stage());
}

// Float frames of random counts above a black of 64.
CycleFrames random_frames(const Sequence& sequence) {
    CycleFrames frames;
    std::mt19937 random(8);
    for (const Slot& slot : sequence.slots) {
        auto frame = std::make_shared<Frame>();
        frame->width = width, frame->height = height;
        frame->format = PixelFormat::f32;
        frame->pitch_bytes = width * sizeof(float);
        frame->exposure_ticks = slot.exposure_ticks;
        frame->samples.resize(pixels * sizeof(float));
        auto* samples = reinterpret_cast<float*>(frame->samples.data());
        for (int p = 0; p < pixels; ++p) samples[p] = 64 + float(random() % 3000);
        for (const Fault& fault : faults)
            if (slot.kind == SlotKind::basis && slot.row == fault.row) samples[fault.pixel] = fault.value;
        frames.slots.push_back(std::move(frame));
    }
    return frames;
}

CameraCalibration plain_calibration() {
    CameraCalibration calibration;
    calibration.black = calibration.flat = Image(width, height, 1);
    std::fill_n(calibration.black.data.begin(), pixels, 64.0f);
    std::fill_n(calibration.flat.data.begin(), pixels, 2.5f);
    return calibration;
}

Target through_archive(const Target& target) {
    const auto path = std::filesystem::temp_directory_path() / "stability_non_finite_source.rfa";
    TakeInfo info;
    info.lights = named_lamps();
    info.value_unit = "reflectance";
    info.sample_type = SampleType::single_float;
    auto writer = ArchiveWriter::create(path, info, true);
    EXPECT_TRUE(writer.ok() && writer->write_target(target).ok() && writer->finish().ok());
    const auto back = ArchiveReader::open(path)->read_target(0, 0);
    std::filesystem::remove_all(path);
    return *back;
}

// r of one lamp and pixel by the plain weighted sum, exact but for the last factor.
double weighted_sum(const Sequence& sequence, const CycleFrames& frames, int lamp, size_t pixel) {
    double sum = 0;
    for (size_t s = 0; s < frames.slots.size(); ++s)
        if (sequence.slots[s].kind == SlotKind::basis)
            sum += sequence.basis.weight(sequence.slots[s].row, lamp) *
                   (reinterpret_cast<const float*>(frames.slots[s]->samples.data())[pixel] - 64);
    return sum * sequence.basis.scale / (2.5 * 100);
}

}  // namespace

// Bound: 0, for what is not finite is masked and filled from the other rows. The other pixels do not meet it: each is the plain sum, but
// for four roundings to float: of the sum, 1 / (F t), its product with the scale, and the product of both.
TEST(NonFiniteSource, marks_its_pixel_and_leaves_the_others_alone) {
    const Sequence sequence = s159_sequence();
    const CycleFrames frames = random_frames(sequence);
    const auto developed = develop_cycle(frames, sequence, plain_calibration(), NoiseModel{});
    ASSERT_TRUE(developed.ok()) << developed.error().message;
    const Target target = through_archive(*developed);
    int naive = 0, ours = 0;
    for (size_t p = 0; p < pixels; ++p) {
        EXPECT_EQ(target.mask[p] != 0, is_faulty(p)) << "pixel " << p;
        for (int lamp = 0; lamp < sequence.basis.images(); ++lamp) {
            const double plain = weighted_sum(sequence, frames, lamp, p);
            const float stored = target.lamps[size_t(lamp)][p];
            naive += !std::isfinite(plain);
            ours += !std::isfinite(stored) ||
                    (target.mask[p] == 0 && !(std::abs(stored - plain) <= 4.001 * 0x1p-24 * std::abs(plain)));
        }
    }
    EXPECT_EQ(naive, int(faults.size()) * sequence.basis.images());
    expect_within(
        "NaN, Inf and -Inf in one row each of a float source: lamp values poisoned without a mark, of 3 pixels", naive,
        ours, 0, "values");
}

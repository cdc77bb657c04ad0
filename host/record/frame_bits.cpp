// SPDX-License-Identifier: MIT
// XXH3 over the samples; a count of those that noise can move.
#include "record/frame_bits.hpp"

#if defined(__x86_64__)
#include <xxh_x86dispatch.h>  // by the vectors that this machine has; the values are the same
#else
#include <xxhash.h>
#endif

#include <algorithm>
#include <cmath>
#include <limits>
#include <new>
#include <span>

namespace ols {

namespace {

// ln of the chance that two exposures agree in all samples, for one pair. A take of an hour has 3e13 pairs.
constexpr double ln_chance_max = -60;

// How many samples have to agree by chance, until they do not.
double samples_for(double chance) {
    return chance < 1 ? ln_chance_max / std::log(chance) : std::numeric_limits<double>::infinity();
}

size_t samples_in_range(std::span<const uint16_t> samples, uint16_t saturated) {
    uint32_t count = 0;
    for (const uint16_t sample : samples) count += (sample > 0) & (sample < saturated);
    return count;
}

}  // namespace

RowHash::RowHash() : state_(XXH3_createState()) {
    if (!state_) throw std::bad_alloc();
    begin();
}

void RowHash::Release::operator()(XXH3_state_s* state) const {
    XXH3_freeState(state);
}

void RowHash::begin() {
    XXH3_64bits_reset(state_.get());
}

void RowHash::add(const Frame& frame, uint32_t rows, const std::byte* samples) {
    const size_t pitch = frame.pitch_bytes, row_bytes = row_samples(frame) * sample_bytes(frame.format);
    if (pitch == row_bytes) {
        XXH3_64bits_update(state_.get(), samples, row_bytes * rows);
        return;
    }
    for (size_t y = 0; y < rows; ++y) XXH3_64bits_update(state_.get(), samples + y * pitch, row_bytes);
}

uint64_t RowHash::value() const {
    return XXH3_64bits_digest(state_.get());
}

double equal_chance(double sigma_counts) {
    if (!(sigma_counts > 0)) return 1;
    const auto below = [&](double x) { return 0.5 * std::erfc(-x / (sigma_counts * std::sqrt(2.0))); };
    double chance = 0;
    const int last = int(std::min(40 * sigma_counts + 2, 1e6));
    for (int k = -last; k <= last; ++k) {
        const double p = below(k + 0.5) - below(k - 0.5);
        chance += p * p;
    }
    return chance;
}

BitsReader::BitsReader(const CameraConfig& camera)
    : saturated_(uint16_t(std::clamp(camera.white, 0.0, 65535.0))),
      samples_needed_(samples_for(equal_chance(camera.noise.read_counts))) {}

FrameBits BitsReader::read(const Frame& frame, uint64_t hash) const {
    FrameBits bits{.hash = hash};
    if (frame.format != PixelFormat::u16) return bits;
    size_t moved = 0;
    for (size_t y = 0; y < frame.height && !bits.tells; ++y) {
        const auto* row = reinterpret_cast<const uint16_t*>(frame.samples.data() + y * frame.pitch_bytes);
        moved += samples_in_range({row, row_samples(frame)}, saturated_);
        bits.tells = double(moved) > samples_needed_;  // of most frames in the first row
    }
    return bits;
}

std::optional<BitsSeen::Seen> BitsSeen::add(const FrameBits& bits, const Seen& frame) {
    if (!bits.tells) return std::nullopt;
    const auto [found, is_new] = frames_.try_emplace(bits.hash, frame);
    if (!is_new) return found->second;
    order_.push_back(bits.hash);
    if (order_.size() > frames_max) {
        frames_.erase(order_.front());
        order_.pop_front();
    }
    return std::nullopt;
}

}  // namespace ols

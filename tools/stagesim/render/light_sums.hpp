// SPDX-License-Identifier: MIT
// Remembers sums of lamp images by their weights: the cycles of a take repeat their patterns, and a sum over many lamps
// reads hundreds of megabytes.
#pragma once

#include <algorithm>
#include <list>
#include <vector>

#include "image/frame.hpp"
#include "scene/vector.hpp"

namespace ols {

class LightSums {
  public:
    // Keeps the sums used last, up to so many bytes.
    explicit LightSums(size_t capacity_bytes) : capacity_bytes_(capacity_bytes) {}

    // Nothing when these weights are not remembered; the pointer holds until the next `remember` or `forget`.
    const Image* find(const std::vector<Float3>& weights) {
        const auto it = std::find_if(sums_.begin(), sums_.end(), [&](const Sum& s) { return s.weights == weights; });
        if (it == sums_.end()) return nullptr;
        sums_.splice(sums_.begin(), sums_, it);
        return &sums_.front().image;
    }

    void remember(const std::vector<Float3>& weights, const Image& image) {
        sums_.push_front({weights, image});
        bytes_ += bytes_of(image);
        while (bytes_ > capacity_bytes_) {
            bytes_ -= bytes_of(sums_.back().image);
            sums_.pop_back();
        }
    }

    void forget() {
        sums_.clear();
        bytes_ = 0;
    }

  private:
    struct Sum {
        std::vector<Float3> weights;
        Image image;
    };
    static size_t bytes_of(const Image& image) { return image.data.size() * sizeof(float); }

    std::list<Sum> sums_;  // the one used last comes first
    size_t capacity_bytes_, bytes_ = 0;
};

}  // namespace ols

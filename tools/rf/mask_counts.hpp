// SPDX-License-Identifier: MIT
// How many pixels of a target have each bit of the mask, and which of that a person who looks at the picture must know.
#pragma once

#include <cstddef>
#include <cstdint>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

namespace ols {

class MaskCounts {
  public:
    void add(const std::vector<uint32_t>& mask);

    // A line for each kind of pixel whose values are not measured ones.
    std::vector<std::string> warnings() const;

    // {"pixels": all, "saturated": .., "missing": .., ...}
    nlohmann::json report() const;

  private:
    size_t pixels_ = 0;
    size_t counts_[32] = {};  // by bit
};

}  // namespace ols

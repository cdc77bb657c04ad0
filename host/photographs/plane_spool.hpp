// SPDX-License-Identifier: MIT
// Image planes put aside on the disk, to be read again in blocks: how lamps that come one after the other become tiles
// that hold all lamps, whatever fits in memory.
#pragma once

#include <span>
#include <string>

#include "archive/archive.hpp"
#include "result.hpp"

namespace ols {

class PlaneSpool {
  public:
    // An unnamed file in `directory`; it vanishes with this object, or with the process.
    static Result<PlaneSpool> create(const std::string& directory, int width, int height);

    // Keeps a plane of width * height samples; different planes may come from different threads.
    Status write(int plane, std::span<const float> samples);
    Status read(int plane, const Box& box, float* out) const;

    PlaneSpool(PlaneSpool&& other) noexcept;
    ~PlaneSpool();

  private:
    PlaneSpool(std::string directory, int fd, int width, int height);
    std::string directory_;
    int fd_ = -1, width_ = 0, height_ = 0;
};

}  // namespace ols

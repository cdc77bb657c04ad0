// SPDX-License-Identifier: MIT
// Streamed copy: into memory that is not read again soon.
#pragma once

#include <cstddef>

namespace ols {

// As std::memcpy, past the caches: what is written is not read into them first, and what is in them stays.
void copy_past_caches(const std::byte* from, size_t bytes, std::byte* to);

}  // namespace ols

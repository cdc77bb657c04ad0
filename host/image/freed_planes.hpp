// SPDX-License-Identifier: MIT
// What becomes of planes that are let go of.
#pragma once

namespace ols {

// Keeps freed blocks of up to 32 MB with the process, for the planes that are made anew, target after target: memory that went
// back to the kernel in between is cleared page by page, which takes as long as an inversion or a flow. To be called before the
// first plane is made. False where the allocator refuses (a sanitizer's has no such settings): slower, and otherwise the same.
bool keep_freed_planes();

}  // namespace ols

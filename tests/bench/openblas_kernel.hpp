// SPDX-License-Identifier: MIT
// OpenBLAS at its best: which of its kernels multiplies fastest on this processor, so that the peer is no straw man.
//
// OpenBLAS takes the newest kernel that the processor knows, which is not always the fastest: with AVX-512 a thin product can take
// twice the time that it takes with AVX2. It chooses as it is loaded, from OPENBLAS_CORETYPE where that is set; each kernel is therefore
// timed by a process of its own, and the program then begins anew with the fastest.
#pragma once

#include <string>

namespace ols {

// Of a row-major product of single precision, (rows x inner) (inner x columns), on one thread.
struct ProductShape {
    int rows, columns, inner;
};

// To be called first in main. Where OPENBLAS_CORETYPE is not set, times the kernels with a product of this shape, sets it, and runs the
// program again from its beginning, but for one that is to list its knobs. Ends the program where it was begun to time a kernel,
// and when it cannot begin itself.
void choose_openblas_kernel(int argc, char** argv, ProductShape shape);

// What runs, for Setting::detail: "kernel Haswell, the fastest here: Haswell 23 ms, SkylakeX 34 ms, for 156 x 159 x 30720".
std::string openblas_kernel_note();

}  // namespace ols

// SPDX-License-Identifier: MIT
// The same work on many indices, by several threads.
#pragma once

#include <tbb/parallel_for.h>
#include <tbb/task_arena.h>

#include <cstddef>

namespace ols {

// work(i) for every i < count, in any order and at the same time. threads: 0: as many as there are processors.
template <typename Work>
void for_each_index(int threads, size_t count, const Work& work) {
    tbb::task_arena arena(threads > 0 ? threads : tbb::task_arena::automatic);
    arena.execute([&] { tbb::parallel_for(size_t(0), count, work, tbb::simple_partitioner()); });
}

}  // namespace ols

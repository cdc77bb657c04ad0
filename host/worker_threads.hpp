// SPDX-License-Identifier: MIT
// Workers that share the work of one call: the one place where an exception is carried from a thread to its caller.
#pragma once

#include <algorithm>
#include <exception>
#include <mutex>
#include <system_error>
#include <thread>
#include <vector>

namespace ols {

// How many threads an option stands for; 0: one a processor.
inline int thread_count(int asked) {
    return asked > 0 ? asked : std::max(1, int(std::thread::hardware_concurrency()));
}

// Calls work(worker) for worker = 0 .. threads - 1 at the same time, the first on this thread, and waits for all. Workers must
// share out what is to be done among those that there are: where the system gives no more threads, there are fewer.
// The first exception of any of them is thrown again here.
template <typename Work>
void run_workers(int threads, const Work& work) {
    std::exception_ptr first;
    std::mutex guard;
    const auto contained = [&](int worker) {
        try {
            work(worker);
        } catch (...) {
            const std::scoped_lock lock(guard);
            if (!first) first = std::current_exception();
        }
    };
    {
        std::vector<std::jthread> others;
        try {
            for (int worker = 1; worker < threads; ++worker) others.emplace_back(contained, worker);
        } catch (const std::exception&) {  // no more threads, or no memory for one
        }
        contained(0);
    }
    if (first) std::rethrow_exception(first);
}

}  // namespace ols

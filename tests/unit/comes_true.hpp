// SPDX-License-Identifier: MIT
// Waiting for what another thread brings about, with a patience that no machine exhausts.
#pragma once

#include <chrono>
#include <thread>

namespace ols::test {

template <typename Condition>
bool comes_true(Condition condition) {
    using namespace std::chrono_literals;
    for (const auto end = std::chrono::steady_clock::now() + 120s; std::chrono::steady_clock::now() < end;) {
        if (condition()) return true;
        std::this_thread::sleep_for(1ms);
    }
    return false;
}

}  // namespace ols::test

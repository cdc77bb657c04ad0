// SPDX-License-Identifier: MIT
// A virtual camera started by its ring's reader, with no board between them.
#pragma once

#include <gtest/gtest.h>

#include <thread>

#include "run/virtual_camera.hpp"

namespace ols {

inline void start_camera(RingReader& reader, VirtualCamera& camera) {
    std::thread starting([&] { EXPECT_TRUE(reader.start(60'000).ok()); });
    while (!camera.start_asked()) std::this_thread::yield();
    camera.confirm_start(*camera.start_asked(), 0);
    starting.join();
}

}  // namespace ols

// SPDX-License-Identifier: MIT
// A V4L2 camera on a model of the kernel, for tests.
#pragma once

#include <gtest/gtest.h>

#include <atomic>

#include "camera_rig.hpp"
#include "device/v4l2_camera.hpp"
#include "v4l2_model.hpp"

namespace ols::test {

constexpr int width = 24, height = 8;

inline CameraSetup setup_of(Cfa cfa, int bits) {
    CameraSetup setup;
    setup.width = width;
    setup.height = height;
    setup.cfa = cfa;
    setup.bits = bits;
    return setup;
}

template <typename T>
std::string error_of(const Result<T>& result) {
    return result.ok() ? "" : result.error().message;
}

inline bool has(const std::string& text, const std::string& part) {
    return text.find(part) != std::string::npos;
}

// A model, and a camera on it.
class V4l2CameraTest : public testing::Test {
  protected:
    void open(int patience_ms = surely_ms) {
        auto camera = make_v4l2_camera(model_, "/dev/video7", 2, patience_ms);
        ASSERT_TRUE(camera.ok()) << error_of(camera);
        camera_ = std::move(*camera);
    }
    std::string set_up(const CameraSetup& wanted) {
        if (!camera_) open();
        return error_of(camera_->set_up(wanted));
    }
    uint64_t start(const CameraSetup& wanted = setup_of(Cfa::rggb, 12)) {
        EXPECT_EQ(set_up(wanted), "");
        const auto started = camera_->start();
        EXPECT_TRUE(started.ok()) << error_of(started);
        return started.ok() ? *started : 0;
    }
    std::vector<uint64_t> read_ids(size_t count) {
        std::vector<uint64_t> ids;
        while (ids.size() < count) {
            const auto frame = camera_->read(surely_ms);
            if (!frame) break;
            ids.push_back(frame->stamp.frame_id);
        }
        return ids;
    }
    using Ids = std::vector<uint64_t>;

    std::shared_ptr<V4l2Model> model_ = std::make_shared<V4l2Model>();
    std::unique_ptr<Camera> camera_;
    std::atomic<bool> has_failed_ = false;
};

}  // namespace ols::test

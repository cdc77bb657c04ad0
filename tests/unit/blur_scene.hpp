// SPDX-License-Identifier: MIT
// A scene whose blur is known by brute force: a textured disc passes in front of a textured wall on a path that curves and
// speeds up. Every sub-frame of the truth is the scene itself at that time, evaluated at the pixels' centres.
#pragma once

#include <array>
#include <cmath>
#include <vector>

#include "image/frame.hpp"
#include "image/target_motion.hpp"

namespace ols::test {

struct DiscScene {
    int width = 110, height = 72;
    double radius = 20;
    double speed_px_s = 1200;  // across; 12.5 pixels in the 1/96 s of half a shutter of 180 degrees at 24 frames/s
    double wall_detail = 1;    // 0: an even wall

    // Of the disc's centre at a time, relative to the target.
    std::array<double, 2> moved(double t) const {
        return {speed_px_s * t + 8 * speed_px_s * t * t, 20 * speed_px_s * t * t};
    }

    // Three channels: detail of both signs of slope, the disc's matte (1 inside), and the disc alone before black.
    std::array<double, 3> color(double x, double y, double t) const {
        const auto [u, v] = moved(t);
        const double dx = x - width / 2.0 - u, dy = y - height / 2.0 - v;
        if (dx * dx + dy * dy < radius * radius) {
            const double value = 1 + 0.5 * std::sin(0.5 * dx + 0.2 * dy);
            return {value, 1, value};
        }
        return {0.3 + wall_detail * 0.15 * std::sin(0.35 * x - 0.4 * y), 0, 0};
    }

    Image at(double t) const {
        Image image(width, height, 3);
        for (int y = 0; y < height; ++y)
            for (int x = 0; x < width; ++x)
                for (int c = 0; c < 3; ++c) image.at(x, y, c) = float(color(x, y, t)[size_t(c)]);
        return image;
    }

    // At 120 tracking frames a second.
    TargetMotion motion(int instants_each_way) const {
        TargetMotion motion;
        for (int k = -instants_each_way; k <= instants_each_way; ++k) {
            if (k == 0) continue;
            motion.times_s.push_back(k / 120.0);
            FlowField flow(width, height);
            for (int y = 0; y < height; ++y)
                for (int x = 0; x < width; ++x)
                    if (color(x, y, 0)[1] == 1) {
                        flow.u[size_t(y * width + x)] = float(moved(k / 120.0)[0]);
                        flow.v[size_t(y * width + x)] = float(moved(k / 120.0)[1]);
                    }
            motion.flows.push_back(std::move(flow));
        }
        return motion;
    }

    Image brute_force(double open_s, double close_s, int sub_frames) const {
        std::vector<double> sum(size_t(width) * size_t(height) * 3);
        for (int n = 0; n < sub_frames; ++n) {
            const Image frame = at(open_s + (close_s - open_s) * (n + 0.5) / sub_frames);
            for (size_t i = 0; i < sum.size(); ++i) sum[i] += double(frame.data[i]);
        }
        Image mean(width, height, 3);
        for (size_t i = 0; i < sum.size(); ++i) mean.data[i] = float(sum[i] / sub_frames);
        return mean;
    }
};

}  // namespace ols::test

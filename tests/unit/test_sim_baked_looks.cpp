// SPDX-License-Identifier: MIT
// Looks on a lattice of triangles against looks where they are asked for; what part of the image is traced at all.
// links: ols_stagesim
#include <gtest/gtest.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>
#include <cstring>

#include "render/baked_looks.hpp"
#include "render/pinhole.hpp"
#include "sim_scenes.hpp"

using namespace ols;

namespace {

// A patch of skin, 2 cm wide, and places all over it.
class Skin : public testing::Test {
  protected:
    Skin() {
        Material skin = matte(0.5f);
        skin.type = MaterialType::skin;
        add_quad(scene_, {0.01, 0.02, 0}, {0, 0, 1}, {0, 1, 0}, 0.02, skin);
        const Geometry geometry(scene_, 0);
        for (int i = 0; i < 5000; ++i) {
            const float x = 0.02f * std::fmod(float(i) * 0.6180340f, 1.0f), y = 0.02f * float(i) / 5000;
            if (const auto hit = geometry.intersect({x, 0.01f + y, 1}, {0, 0, -1})) hits_.push_back(*hit);
        }
    }

    // Of albedo (the first) and slope (the second), root mean square over the places.
    std::array<double, 2> error(float step_m) {
        BakedLooks baked(scene_, step_m);
        std::array<double, 2> squares{};
        for (const SurfaceHit& hit : hits_) {
            const Look exact = look_of(scene_.materials[0], hit.rest_position, hit.mask), look = baked.at(hit);
            squares[0] += std::pow(length(look.albedo - exact.albedo), 2);
            squares[1] += std::pow(length(look.slope - exact.slope), 2);
        }
        for (double& s : squares) s = std::sqrt(s / double(hits_.size()));
        return squares;
    }

    Scene scene_;
    std::vector<SurfaceHit> hits_;
};

}  // namespace

// Linear interpolation errs with the square of the step where a texture is smooth; speckles have edges.
TEST_F(Skin, baked_on_a_lattice_comes_near_to_itself_as_the_lattice_gets_finer) {
    ASSERT_GT(hits_.size(), 4900u);
    const auto coarse = error(2e-4f), fine = error(1e-4f);
    for (int i = 0; i < 2; ++i) EXPECT_LT(fine[i], 0.45 * coarse[i]) << i;
    EXPECT_LT(coarse[0], 0.02);
}

TEST_F(Skin, baked_on_a_lattice_wider_than_its_pores_loses_them) {
    EXPECT_GT(error(5e-3f)[1], 10 * error(1e-4f)[1]);
}

TEST_F(Skin, baked_in_two_triangles_is_one_along_their_edge) {
    const Mesh& mesh = std::get<Mesh>(scene_.objects[0].shape);
    const auto &a = mesh.triangles[0].vertex, &b = mesh.triangles[1].vertex;
    std::vector<uint32_t> shared;
    for (const uint32_t v : a)
        if (std::find(b.begin(), b.end(), v) != b.end()) shared.push_back(v);
    ASSERT_EQ(shared.size(), 2u);
    const auto hit_at = [&](uint32_t triangle, float t) {
        SurfaceHit hit = hits_[0];
        hit.triangle = triangle;
        const auto& corner = mesh.triangles[triangle].vertex;
        const auto weight = [&](uint32_t vertex) {
            return vertex == shared[0] ? 1 - t : vertex == shared[1] ? t : 0.0f;
        };
        hit.u = weight(corner[1]), hit.v = weight(corner[2]);
        return hit;
    };
    BakedLooks baked(scene_, 4e-4f);
    for (int i = 0; i <= 100; ++i) {
        const Look here = baked.at(hit_at(0, float(i) / 100)), there = baked.at(hit_at(1, float(i) / 100));
        ASSERT_LT(length(here.albedo - there.albedo), 1e-4f) << i;
        ASSERT_LT(length(here.slope - there.slope), 1e-3f) << i;
    }
}

TEST_F(Skin, baked_by_many_threads_is_the_same) {
    BakedLooks serial(scene_, 4e-4f), parallel(scene_, 4e-4f);
    std::vector<Look> looks(hits_.size());
    tbb::parallel_for(size_t(0), hits_.size(), [&](size_t i) { looks[i] = parallel.at(hits_[i]); });
    for (size_t i = 0; i < hits_.size(); ++i) {
        const Look look = serial.at(hits_[i]);
        ASSERT_EQ(std::memcmp(&look, &looks[i], sizeof look), 0) << i;
    }
}

TEST(SeenBounds, hold_every_pixel_whose_rays_meet_something) {
    const CameraConfig camera = small_stage({{0, 0, 1}}).cameras[0];
    const Pinhole pinhole(camera);
    // In the middle, across the image's border, and around the camera.
    for (const auto& [center, radius] : std::vector<std::pair<Vec3, double>>{
             {{0.02, -0.03, 0}, 0.05}, {{-0.2, 0.17, 0.1}, 0.08}, {{0, 0, 1.6}, 0.3}, {{0, 0, 1.3}, 0.4}}) {
        Scene scene;
        add_sphere(scene, center, radius, matte(0.5f));
        const Geometry geometry(scene, 0);
        const auto pixels = pinhole.cover(geometry.bounds(), camera.width, camera.height);
        int met = 0;
        for (int y = 0; y < camera.height; ++y)
            for (int x = 0; x < camera.width; ++x) {
                bool meets = false;
                for (const double s : {0.01, 0.99})
                    for (const double t : {0.01, 0.99})
                        meets |= geometry.intersect(pinhole.position(), pinhole.ray(x + s, y + t)).has_value();
                met += meets;
                if (!meets) continue;
                ASSERT_TRUE(x >= pixels.left && x < pixels.right && y >= pixels.top && y < pixels.bottom)
                    << x << ' ' << y;
            }
        EXPECT_GT(met, 20);
    }
    const auto empty = pinhole.cover(Geometry(Scene{}, 0).bounds(), camera.width, camera.height);
    EXPECT_TRUE(empty.left >= 0 && empty.right <= camera.width);
}

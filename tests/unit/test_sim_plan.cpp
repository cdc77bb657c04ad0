// SPDX-License-Identifier: MIT
// What `stagesim plan` foretells, against what rendering then does.
// links: ols_stagesim
#include <gtest/gtest.h>

#include "run/plan.hpp"
#include "sim_scenes.hpp"

using namespace ols;

namespace {

Scene glossy_balls() {
    Scene scene;
    Material gloss = matte(0.4f);
    gloss.f0 = 0.05f;
    add_sphere(scene, {-0.08, 0, 0}, 0.1, matte(0.7f));
    add_sphere(scene, {0.1, 0.02, 0.05}, 0.07, gloss);
    return scene;
}

}  // namespace

TEST(SimPlan, foretells_the_evaluations_of_every_effect_within_a_tenth) {
    const Scene scene = glossy_balls();
    StageConfig stage = default_stage();
    stage.cameras[0].width = 320, stage.cameras[0].height = 240;
    const ols::Setup setup{scene, stage, stage.cameras[0], true};
    const auto foretold = foretell(setup, {});
    Renderer renderer(setup, {});
    renderer.expose(std::vector<double>(renderer.lamp_count(), 1), 0, 0, 0);
    const auto actual = account(renderer);
    ASSERT_EQ(foretold["effects"].size(), actual["effects"].size());
    for (size_t i = 0; i < foretold["effects"].size(); ++i) {
        const double expected = actual["effects"][i]["evaluations"];
        EXPECT_NEAR(double(foretold["effects"][i]["evaluations"]), expected, 0.1 * expected)
            << foretold["effects"][i]["name"];
    }
    EXPECT_EQ(foretold["primary_rays"], actual["primary_rays"]);
    EXPECT_GT(foretold["seconds"]["lamps"], 0);
}

TEST(SimPlan, names_who_calls_for_an_effect_and_which_are_disabled) {
    Scene scene = glossy_balls();
    StageConfig stage = default_stage();
    stage.cameras[0].width = 96, stage.cameras[0].height = 72;
    const std::string text = plan_text(foretell({scene, stage, stage.cameras[0], true}, {"noise"}), nullptr);
    EXPECT_NE(text.find("'matte' of 'sphere' has f0 > 0"), std::string::npos) << text;
    EXPECT_NE(text.find("(disabled) camera: sigma = 2.68"), std::string::npos) << text;
    const size_t stray = text.find("stray");
    EXPECT_NE(text.substr(stray, text.find('\n', stray) - stray).find("nobody"), std::string::npos) << text;
}

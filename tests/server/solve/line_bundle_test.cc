// SPDX-License-Identifier: Apache-2.0
#include "server/solve/line_bundle.h"

#include <gtest/gtest.h>

#include "tests/bench/reference_bundle.h"
#include "tests/testing/bundle_scene.h"
#include "tests/testing/status_matchers.h"

namespace rigcal::server {
namespace {

using ::rigcal::testing::BundleScene;
using ::rigcal::testing::BundleSceneOptions;
using ::rigcal::testing::IsOk;
using ::rigcal::testing::MakeBundleScene;
using ::rigcal::testing::SolveReferenceBundle;

TEST(LineBundle, First) {
  BundleSceneOptions scene_options;
  const BundleScene scene = MakeBundleScene(scene_options);
  BundleOptions options;
  BundleProblem mine = scene.start, reference = scene.start;
  ASSERT_OK_AND_ASSIGN(const BundleSummary a, SolveLineBundle(options, &mine));
  ASSERT_OK_AND_ASSIGN(const BundleSummary b, SolveReferenceBundle(options, &reference));
  printf("%.15g %.15g %d %s | %.15g %.15g %d %s\n", a.initial_cost, a.final_cost, a.iterations,
         a.message.c_str(), b.initial_cost, b.final_cost, b.iterations, b.message.c_str());
  EXPECT_NEAR(a.final_cost, b.final_cost, 1e-9 * b.final_cost);
}

}  // namespace
}  // namespace rigcal::server

// SPDX-License-Identifier: Apache-2.0
#include "common/simulation/frames/frame_renderer.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/testing/status_matchers.h"

namespace rigcal::frame_renderer_test {
namespace {

using ::rigcal::testing::StatusIs;
using ::testing::HasSubstr;

std::shared_ptr<const SimulatedWorld> World(const SimulationOptions& options) {
  const Target target = *ParseTarget("wand:0,0.13,0.39;diameter=0.04;hz=500");
  return std::make_shared<const SimulatedWorld>(*SimulatedWorld::Create(options, target));
}

SimulationOptions FourExactCameras() {
  SimulationOptions options;
  options.camera_count = 4;
  options.rate_hz = 5;
  options.duration_s = 8;
  options.noise_px = options.outlier_share = options.dropout_share = 0;
  return options;
}

TEST(FrameRenderer, ThePapersRigHasFourLargeCamerasWithDistortion) {
  const auto world = World(FourExactCameras());
  ASSERT_EQ(world->cameras().size(), 4u);
  for (const SimulatedCamera& camera : world->cameras()) {
    EXPECT_EQ(camera.description.image_size_px, (ImageSize{1280, 1024}));
    EXPECT_LT(camera.true_intrinsics.distortion.at(0), -0.1);
  }
}

TEST(FrameRenderer, ItsTruthIsWhatTheWorldObservesWithoutNoise) {
  SimulationOptions options = FourExactCameras();
  options.length_error_m = 0.01;
  options.focal_sigma_rel = 0.02;
  const auto world = World(options);
  int seen = 0;
  for (int camera = 0; camera < 4; ++camera) {
    ASSERT_OK_AND_ASSIGN(FrameRenderer renderer, FrameRenderer::Create(world, camera, {}));
    std::vector<uint8_t> image(renderer.buffer_size());
    for (int frame = 0; frame < world->FrameCount(camera); frame += 3) {
      ASSERT_OK_AND_ASSIGN(const FrameGroundTruth truth, renderer.Render(frame, image));
      const Observation observation = world->Observe(camera, frame);
      for (size_t m = 0; m < 3; ++m) {
        if (!observation.markers[m].visible) continue;
        ++seen;
        EXPECT_TRUE(truth.markers[m].inside);
        EXPECT_LT((truth.markers[m].centre_px - observation.markers[m].centre_px).norm(), 1e-9);
      }
    }
  }
  EXPECT_GT(seen, 50);
}

TEST(FrameRenderer, EveryProcessDrawsTheSame) {
  FrameRenderOptions options;
  options.clutter = 0.5;
  ASSERT_OK_AND_ASSIGN(FrameRenderer a,
                       FrameRenderer::Create(World(FourExactCameras()), 2, options));
  ASSERT_OK_AND_ASSIGN(FrameRenderer b,
                       FrameRenderer::Create(World(FourExactCameras()), 2, options));
  ASSERT_OK_AND_ASSIGN(FrameRenderer other,
                       FrameRenderer::Create(World(FourExactCameras()), 3, options));
  std::vector<uint8_t> first(a.buffer_size()), second(a.buffer_size()), third(a.buffer_size());
  ASSERT_OK_AND_ASSIGN(const FrameGroundTruth ignored, a.Render(0, second));
  ASSERT_OK_AND_ASSIGN(const FrameGroundTruth truth_a, a.Render(7, first));
  ASSERT_OK_AND_ASSIGN(const FrameGroundTruth truth_b, b.Render(7, second));
  ASSERT_OK_AND_ASSIGN(const FrameGroundTruth truth_other, other.Render(7, third));
  EXPECT_EQ(first, second);
  EXPECT_NE(first, third);
  EXPECT_EQ(truth_a.markers[0].centre_px, truth_b.markers[0].centre_px);
}

TEST(FrameRenderer, ShowsNoWandInTheGap) {
  SimulationOptions options = FourExactCameras();
  options.gap_start_s = 2;
  options.gap_duration_s = 1;
  ASSERT_OK_AND_ASSIGN(FrameRenderer renderer, FrameRenderer::Create(World(options), 0, {}));
  std::vector<uint8_t> image(renderer.buffer_size());
  ASSERT_OK_AND_ASSIGN(const FrameGroundTruth before, renderer.Render(9, image));
  ASSERT_OK_AND_ASSIGN(const FrameGroundTruth within, renderer.Render(12, image));
  EXPECT_EQ(before.markers.size(), 3u);
  EXPECT_TRUE(within.markers.empty());
}

TEST(FrameRenderer, RefusesCamerasAndFramesThatAreNotThere) {
  const auto world = World(FourExactCameras());
  for (const int camera : {-1, 4}) {
    EXPECT_THAT(FrameRenderer::Create(world, camera, {}).status(),
                StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("the world has 0 to 3")));
  }
  ASSERT_OK_AND_ASSIGN(FrameRenderer renderer, FrameRenderer::Create(world, 0, {}));
  std::vector<uint8_t> image(renderer.buffer_size());
  for (const int frame : {-1, world->FrameCount(0)}) {
    EXPECT_THAT(renderer.Render(frame, image).status(),
                StatusIs(absl::StatusCode::kOutOfRange, HasSubstr("it has 0 to")));
  }
  image.pop_back();
  EXPECT_THAT(renderer.Render(0, image).status(),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("bytes")));
}

}  // namespace
}  // namespace rigcal::frame_renderer_test

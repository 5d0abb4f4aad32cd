// SPDX-License-Identifier: Apache-2.0
// Wands of which a sphere is not seen as a whole.
#include <algorithm>
#include <cmath>
#include <numbers>
#include <optional>

#include "agent/detect/frame/wand_detector.h"
#include "tests/agent/detect/frame/rendered_wand.h"
#include "tests/testing/status_matchers.h"

namespace rigcal::agent::partial_wand_test {
namespace {

// In a lit room, with a stick.
FrameRenderOptions RoomWithStick() {
  FrameRenderOptions options = RenderedWand::QuietRoom();
  options.rod_m = 0.012;
  options.lux = 300;
  options.auto_gain = true;
  return options;
}

std::optional<Observation> Detected(const RenderedWand& scene,
                                    const WandDetectorOptions& options = {}) {
  auto detector = WandDetector::Create(options, scene.target, scene.camera);
  EXPECT_TRUE(detector.ok()) << detector.status();
  auto detection = detector->Detect(scene.View(), 1, 0);
  EXPECT_TRUE(detection.ok()) << detection.status();
  if (detection->outcome != DetectionOutcome::kWand) return std::nullopt;
  return detection->observation;
}

void ExpectAt(const MarkerObservation& marker, const MarkerGroundTruth& truth, double within_px) {
  ASSERT_TRUE(marker.visible);
  const Eigen::Vector2d error_px = marker.centre_px - truth.centre_px;
  EXPECT_LT(error_px.norm(), within_px);
  EXPECT_LT(error_px.dot(marker.covariance_px2.inverse() * error_px), 14);  // 0.1 % of those
}

TEST(PartialWand, ASphereThatTheBorderCutsIsTakenFromItsArc) {
  RenderedWand scene;
  for (double x_m = -1.3; x_m < -1.1; x_m += 0.002) {
    const FrameGroundTruth truth = scene.Render(RenderedWand::Wand({x_m, 0.1, 2.2}, {1, 0.2, 0.3}));
    const double x_px = truth.markers[0].centre_px.x();
    if (x_px < 2.3 || x_px > 3.3) continue;
    const auto seen = Detected(scene);
    ASSERT_TRUE(seen);
    ExpectAt(seen->markers[0], truth.markers[0], 0.5);
    ExpectAt(seen->markers[1], truth.markers[1], 0.1);
    ExpectAt(seen->markers[2], truth.markers[2], 0.1);
    return;
  }
  FAIL() << "no pose at the border";
}

TEST(PartialWand, TwoSpheresWithoutAStickAreNone) {
  FrameRenderOptions room = RoomWithStick();
  room.rod_m = 0;
  RenderedWand scene(room);
  const FrameGroundTruth truth = scene.Render(RenderedWand::Wand({-0.2, 0.1, 1.6}, {1, 0.2, 0.1}));
  const Eigen::Vector2d covered = truth.markers[1].centre_px;
  scene.Fill(static_cast<int>(covered.x()) - 12, static_cast<int>(covered.y()) - 20, 24, 40, 60, 40,
             30);
  EXPECT_FALSE(Detected(scene));
}

}  // namespace
}  // namespace rigcal::agent::partial_wand_test

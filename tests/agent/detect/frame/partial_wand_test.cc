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

TEST(PartialWand, OfOneThatTheBorderHidesNearlyTheOtherTwoAreFoundInARoom) {
  RenderedWand scene(RoomWithStick());
  int tried = 0, found = 0;
  for (double x_m = -1.1; x_m < -0.6; x_m += 0.0004) {
    const WandMotion motion = RenderedWand::Wand({x_m, 0.1, 1.6}, {1, 0.2, 0.1});
    const FrameGroundTruth truth = scene.Render(motion);
    const MarkerGroundTruth& cut = truth.markers[0];
    // A twelfth to a sixth of it is seen.
    const double beyond = -(cut.centre_px.x() + 0.5) / cut.radius_px;
    if (beyond < 0.53 || beyond > 0.72) continue;
    ++tried;
    const auto seen = Detected(scene);
    if (!seen) continue;
    ++found;
    ExpectAt(seen->markers[1], truth.markers[1], 0.2);
    ExpectAt(seen->markers[2], truth.markers[2], 0.2);
  }
  EXPECT_GT(tried, 1);
  EXPECT_EQ(found, tried);
}

TEST(PartialWand, OfOneOfThreeThatIsMostlySeenTheOtherTwoAreFound) {
  RenderedWand scene;
  const FrameGroundTruth truth = scene.Render(RenderedWand::Wand({-0.3, 0.1, 2.2}, {1, 0.2, 0.3}));
  const MarkerGroundTruth& hidden = truth.markers[2];
  scene.Fill(static_cast<int>(hidden.centre_px.x() + 0.3 * hidden.radius_px),
             static_cast<int>(hidden.centre_px.y()) - 15, 20, 30, 9, 9, 9);
  const auto seen = Detected(scene);
  ASSERT_TRUE(seen);
  ExpectAt(seen->markers[0], truth.markers[0], 0.1);
  ExpectAt(seen->markers[1], truth.markers[1], 0.1);
  if (seen->markers[2].visible) ExpectAt(seen->markers[2], hidden, 1);
}

TEST(PartialWand, WhereTheMiddleOfAStickIsCoveredItsEndsAreFound) {
  RenderedWand scene(RoomWithStick());
  const FrameGroundTruth truth = scene.Render(RenderedWand::Wand({-0.2, 0.1, 1.6}, {1, 0.2, 0.1}));
  const Eigen::Vector2d covered = truth.markers[1].centre_px;
  scene.Fill(static_cast<int>(covered.x()) - 12, static_cast<int>(covered.y()) - 20, 24, 40, 60, 40,
             30);
  const auto seen = Detected(scene);
  ASSERT_TRUE(seen);
  ExpectAt(seen->markers[0], truth.markers[0], 0.2);
  EXPECT_FALSE(seen->markers[1].visible);
  ExpectAt(seen->markers[2], truth.markers[2], 0.2);
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

// Of wands with a part of the third sphere whose others have less and less the same colour, the
// least confidence of those that were found. `bars`: of the wand's colour, elsewhere.
double LeastConfidence(int bars) {
  FrameRenderOptions room = RoomWithStick();
  room.rod_m = 0;
  RenderedWand scene(room);
  WandDetectorOptions options;
  options.min_confidence = 0.3;
  auto detector = WandDetector::Create(options, scene.target, scene.camera);
  EXPECT_TRUE(detector.ok()) << detector.status();
  double least = 1;
  for (double green = 1; green > 0.5; green -= 0.02) {
    const FrameGroundTruth truth = scene.Render(RenderedWand::Wand({-0.2, 0.3, 1.8}, {1, 0, 0.1}));
    const Eigen::Vector2d hidden = truth.markers[2].centre_px;
    scene.Fill(static_cast<int>(hidden.x()) - 3, static_cast<int>(hidden.y()) - 12, 24, 24, 30, 30,
               30);
    for (int i = 0; i < bars; ++i) scene.Fill(40 + 35 * i, 60, 4, 40, 40, 110, 190);
    scene.Dim(truth.markers[1].centre_px, 12, {1, green, 1});
    const auto detection = detector->Detect(scene.View(), 1, 0);
    EXPECT_TRUE(detection.ok()) << detection.status();
    if (detection->outcome == DetectionOutcome::kWand) {
      least = std::min(least, detection->confidence);
    }
  }
  return least;
}

// Where there is more than a wand, two things and a part of a third fit by chance.
TEST(PartialWand, TheMorePlacesWereTriedTheSurerItMustBe) {
  EXPECT_LT(LeastConfidence(0), 0.6);
  const double least = LeastConfidence(14);
  EXPECT_GT(least, 0.88);
  EXPECT_LT(least, 1);
}

// Of a wand of which the third sphere is hidden, but for its right half or for a smaller disc in
// its place.
bool FindsTwoAnd(bool half) {
  FrameRenderOptions room = RoomWithStick();
  room.rod_m = 0;
  RenderedWand scene(room);
  const FrameGroundTruth truth = scene.Render(RenderedWand::Wand({-0.2, 0.3, 1.2}, {1, 0, 0.1}));
  const Eigen::Vector2d& at = truth.markers[2].centre_px;
  const auto x0 = static_cast<int>(at.x()), y0 = static_cast<int>(at.y());
  const double radius_px = truth.markers[2].radius_px;
  for (int y = y0 - 20; y <= y0 + 20; ++y) {
    for (int x = x0 - 20; x <= x0 + 20; ++x) {
      const bool is_seen = half ? x > x0 : std::hypot(x - x0, y - y0) < 0.5 * radius_px;
      if (!is_seen) scene.Fill(x, y, 1, 1, 30, 30, 30);
    }
  }
  const auto seen = Detected(scene);
  return seen && seen->markers[0].visible && seen->markers[1].visible;
}

TEST(PartialWand, ASmallerDiscIsNoPartOfASphere) {
  EXPECT_TRUE(FindsTwoAnd(true));
  EXPECT_FALSE(FindsTwoAnd(false));
}

// In a lit room with other things of their colour two small spheres, or labels (`square`), and half
// of a third.
bool FindsTwoAndAHalf(bool square) {
  FrameRenderOptions room = RoomWithStick();
  room.rod_m = 0;
  RenderedWand scene(room);
  const FrameGroundTruth truth = scene.Render(RenderedWand::Wand({-0.2, 0.3, 3.8}, {1, 0, 0.1}));
  const auto fill = [&](size_t k, int right, int half, uint8_t b, uint8_t g, uint8_t r) {
    const Eigen::Vector2d& at = truth.markers[k].centre_px;
    scene.Fill(static_cast<int>(std::lround(at.x())) - half + right,
               static_cast<int>(std::lround(at.y())) - half, 2 * half + 1, 2 * half + 1, b, g, r);
  };
  if (square) fill(0, 0, 3, 40, 110, 190), fill(1, 0, 3, 40, 110, 190);
  fill(2, 12, 11, 30, 30, 30);
  for (int i = 0; i < 14; ++i) scene.Fill(40 + 35 * i, 60, 4, 40, 40, 110, 190);
  scene.Fill(0, 400, 640, 80, 120, 120, 120);
  const auto seen = Detected(scene);
  return seen && seen->markers[0].visible && seen->markers[1].visible;
}

TEST(PartialWand, TwoSmallSpheresAreKnownByTheirOutlines) {
  EXPECT_TRUE(FindsTwoAndAHalf(false));
  EXPECT_FALSE(FindsTwoAndAHalf(true));
}

// In a dark room two spheres, or squares of a chessboard, and the edge of something that has their
// colour.
bool FindsTwoInTheDark(bool square) {
  RenderedWand scene{FrameRenderOptions()};
  const FrameGroundTruth truth = scene.Render(RenderedWand::Wand({-0.2, 0.1, 1.7}, {1, 0.3, 0.1}));
  for (const size_t k : {size_t{1}, size_t{2}}) {
    if (!square) break;
    const Eigen::Vector2d& at = truth.markers[k].centre_px;
    const int half = static_cast<int>(std::lround(0.9 * truth.markers[k].radius_px));
    scene.Fill(static_cast<int>(std::lround(at.x())) - 2 * half,
               static_cast<int>(std::lround(at.y())) - 2 * half, 4 * half, 4 * half, 2, 2, 2);
    scene.Fill(static_cast<int>(std::lround(at.x())) - half,
               static_cast<int>(std::lround(at.y())) - half, 2 * half + 1, 2 * half + 1, 60, 120,
               200);
  }
  const Eigen::Vector2d& hidden = truth.markers[0].centre_px;
  scene.Fill(static_cast<int>(hidden.x()), static_cast<int>(hidden.y()) - 16, 20, 32, 2, 2, 2);
  const auto seen = Detected(scene);
  return seen && seen->markers[1].visible && seen->markers[2].visible;
}

TEST(PartialWand, SquaresInTheDarkAreNoSpheres) {
  EXPECT_TRUE(FindsTwoInTheDark(false));
  EXPECT_FALSE(FindsTwoInTheDark(true));
}

// Of two spheres and a part of a third in a lit room, among discs of their size and colour: a ring
// of them around the wand, each off its line.
bool FindsTwoAmong(int discs) {
  FrameRenderOptions room = RoomWithStick();
  room.rod_m = 0;
  RenderedWand scene(room);
  const FrameGroundTruth truth = scene.Render(RenderedWand::Wand({-0.2, 0.3, 2.6}, {1, 0, 0.1}));
  const Eigen::Vector2d& hidden = truth.markers[2].centre_px;
  scene.Fill(static_cast<int>(hidden.x()), static_cast<int>(hidden.y()) - 12, 12, 24, 30, 30, 30);
  const Eigen::Vector2d middle = 0.5 * (truth.markers[0].centre_px + hidden);
  const auto its = static_cast<size_t>(std::lround(truth.markers[0].centre_px.y()) * 640 +
                                       std::lround(truth.markers[0].centre_px.x()));
  const auto b = scene.pixels[3 * its], g = scene.pixels[3 * its + 1],
             r = scene.pixels[3 * its + 2];
  const double radius_px = truth.markers[0].radius_px;
  for (int i = 0; i < discs; ++i) {
    const double angle = 0.5 + i * 2 * std::numbers::pi / 6;
    const double x = middle.x() + 60 * std::cos(angle), y = middle.y() + 60 * std::sin(angle);
    for (int dy = -8; dy <= 8; ++dy) {
      for (int dx = -8; dx <= 8; ++dx) {
        if (std::hypot(dx, dy) > radius_px) continue;
        scene.Fill(static_cast<int>(x) + dx, static_cast<int>(y) + dy, 1, 1, b, g, r);
      }
    }
  }
  scene.Fill(0, 400, 640, 80, 120, 120, 120);
  const auto seen = Detected(scene);
  return seen && seen->markers[0].visible && seen->markers[1].visible;
}

TEST(PartialWand, AmongThingsLikeThemTwoSpheresAndAPartAreNone) {
  EXPECT_TRUE(FindsTwoAmong(0));
  EXPECT_TRUE(FindsTwoAmong(1));
  EXPECT_FALSE(FindsTwoAmong(6));
}

// Its brightness is not the wand's, but its colour and its outline are.
TEST(PartialWand, ASphereThatIsTooDarkToBeLookedForIsFoundByTheOthers) {
  RenderedWand scene;
  const FrameGroundTruth truth = scene.Render(RenderedWand::Wand({-0.3, 0.1, 2.2}, {1, 0.2, 0.3}));
  scene.Dim(truth.markers[2].centre_px, 14, {0.7, 0.7, 0.7});
  WandDetectorOptions options;
  options.colour.value_min = 140;
  const auto seen = Detected(scene, options);
  ASSERT_TRUE(seen);
  for (size_t k = 0; k < 3; ++k) ExpectAt(seen->markers[k], truth.markers[k], 0.2);
}

}  // namespace
}  // namespace rigcal::agent::partial_wand_test

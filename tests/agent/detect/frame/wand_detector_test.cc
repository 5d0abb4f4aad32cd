// SPDX-License-Identifier: Apache-2.0
#include "agent/detect/frame/wand_detector.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <random>
#include <vector>

#include "tests/agent/detect/frame/rendered_wand.h"
#include "tests/testing/status_matchers.h"

namespace rigcal::agent::wand_detector_test {
namespace {

using ::rigcal::testing::IsOk;
using ::rigcal::testing::StatusIs;
using ::testing::AllOf;
using ::testing::HasSubstr;

constexpr int64_t kPeriodNs = 20'000'000;

Detection MustDetect(WandDetector& detector, const ImageView& view, int64_t time_ns = 1) {
  auto detection = detector.Detect(view, time_ns, 0);
  EXPECT_THAT(detection, IsOk());
  return *std::move(detection);
}

WandMotion Standing() { return RenderedWand::Wand({-0.3, 0.1, 2.2}, {1, 0.2, 0.3}); }

TEST(WandDetector, FindsTheProjectionsOfTheSpheresCentres) {
  RenderedWand scene;
  const FrameGroundTruth ground_truth = scene.Render(Standing());
  ASSERT_OK_AND_ASSIGN(auto detector, WandDetector::Create({}, scene.target, scene.camera));
  const Detection detection = MustDetect(detector, scene.View(), 77);
  ASSERT_EQ(detection.outcome, DetectionOutcome::kWand);
  EXPECT_EQ(detection.observation.time_ns, 77);
  EXPECT_GT(detection.confidence, 0.9);
  for (size_t k = 0; k < 3; ++k) {
    const MarkerObservation& marker = detection.observation.markers[k];
    ASSERT_TRUE(marker.visible);
    EXPECT_EQ(marker.centre_kind, CentreKind::kSphereCentre);
    EXPECT_LT((marker.centre_px - ground_truth.markers[k].centre_px).norm(), 0.06) << k;
    EXPECT_GT(marker.label_confidence, 0.99f);
  }
}

TEST(WandDetector, LabelsFollowTheWandTurnedRound) {
  RenderedWand scene;
  ASSERT_OK_AND_ASSIGN(auto detector, WandDetector::Create({}, scene.target, scene.camera));
  const FrameGroundTruth ground_truth =
      scene.Render(RenderedWand::Wand({0.3, 0.1, 2.2}, {-1, -0.4, 0.2}));
  const Detection detection = MustDetect(detector, scene.View());
  ASSERT_EQ(detection.outcome, DetectionOutcome::kWand);
  for (size_t k = 0; k < 3; ++k) {
    EXPECT_LT(
        (detection.observation.markers[k].centre_px - ground_truth.markers[k].centre_px).norm(),
        0.1);
  }
}

TEST(WandDetector, SymmetricWandHasNoSureLabels) {
  RenderedWand scene;
  scene.target.marker_positions_m = {0, 0.2, 0.4};
  auto renderer = SceneRenderer::Create(*scene.camera.intrinsics, scene.camera.image_size_px,
                                        scene.target, RenderedWand::QuietRoom());
  ASSERT_THAT(renderer, IsOk());
  SceneFrame frame;
  frame.spheres = Standing().Spheres(scene.target);
  ASSERT_THAT(renderer->Render(frame, scene.pixels), IsOk());
  ASSERT_OK_AND_ASSIGN(auto detector, WandDetector::Create({}, scene.target, scene.camera));
  const Detection detection = MustDetect(detector, scene.View());
  ASSERT_EQ(detection.outcome, DetectionOutcome::kWand);
  EXPECT_LT(detection.observation.markers[0].label_confidence, 0.8f);
}

TEST(WandDetector, WithoutIntrinsicsTellsTheCentreOfTheImage) {
  RenderedWand scene;
  const FrameGroundTruth ground_truth = scene.Render(Standing());
  scene.camera.intrinsics.reset();
  ASSERT_OK_AND_ASSIGN(auto detector, WandDetector::Create({}, scene.target, scene.camera));
  const Detection detection = MustDetect(detector, scene.View());
  ASSERT_EQ(detection.outcome, DetectionOutcome::kWand);
  for (size_t k = 0; k < 3; ++k) {
    EXPECT_EQ(detection.observation.markers[k].centre_kind, CentreKind::kImageBlob);
    EXPECT_LT(
        (detection.observation.markers[k].centre_px - ground_truth.markers[k].centre_px).norm(),
        0.2);
  }
}

// A dark stick in front of a sphere's rim, and a white thing beside it.
TEST(WandDetector, ASphereBesideSomethingBrightIsFound) {
  RenderedWand scene;
  const FrameGroundTruth ground_truth = scene.Render(Standing());
  const Eigen::Vector2d at = ground_truth.markers[1].centre_px;
  const int x = static_cast<int>(at.x()), y = static_cast<int>(at.y());
  scene.Fill(x - 40, y + 8, 80, 12, 250, 250, 250);
  scene.Fill(x - 1, y - 12, 2, 6, 4, 4, 4);
  ASSERT_OK_AND_ASSIGN(auto detector, WandDetector::Create({}, scene.target, scene.camera));
  const Detection detection = MustDetect(detector, scene.View());
  ASSERT_EQ(detection.outcome, DetectionOutcome::kWand);
  for (size_t k = 0; k < 3; ++k) {
    const MarkerObservation& marker = detection.observation.markers[k];
    if (marker.visible) {
      EXPECT_LT((marker.centre_px - ground_truth.markers[k].centre_px).norm(), 0.5) << k;
    }
  }
}

TEST(WandDetector, TwoEquallyGoodWandsAreAmbiguous) {
  RenderedWand scene;
  scene.Render(RenderedWand::Wand({-0.3, 0.4, 2.2}, {1, 0, 0}));
  const std::vector<uint8_t> lower = scene.pixels;
  scene.Render(RenderedWand::Wand({-0.3, -0.4, 2.2}, {1, 0, 0}));
  std::transform(lower.begin(), lower.end(), scene.pixels.begin(), scene.pixels.begin(),
                 [](uint8_t a, uint8_t b) { return std::max(a, b); });
  ASSERT_OK_AND_ASSIGN(auto detector, WandDetector::Create({}, scene.target, scene.camera));
  const Detection detection = MustDetect(detector, scene.View());
  EXPECT_EQ(detection.outcome, DetectionOutcome::kAmbiguous);
  EXPECT_EQ(detection.observation.VisibleCount(), 0);
}

TEST(WandDetector, SaysWhyThereIsNoWand) {
  RenderedWand scene;
  ASSERT_OK_AND_ASSIGN(auto detector, WandDetector::Create({}, scene.target, scene.camera));
  scene.Fill(0, 0, 640, 480, 3, 2, 4);
  EXPECT_EQ(MustDetect(detector, scene.View()).outcome, DetectionOutcome::kBlack);
  scene.Fill(0, 0, 640, 480, 255, 255, 255);
  EXPECT_EQ(MustDetect(detector, scene.View()).outcome, DetectionOutcome::kSaturated);
  scene.Fill(0, 0, 640, 480, 60, 50, 40);
  EXPECT_EQ(MustDetect(detector, scene.View()).outcome, DetectionOutcome::kNoBlob);
  scene.Fill(100, 100, 12, 12, 30, 90, 200);
  EXPECT_EQ(MustDetect(detector, scene.View()).outcome, DetectionOutcome::kNoWand);
}

// Hundreds of warm spots of a sphere's size, in a random pattern.
TEST(WandDetector, HundredsOfWarmBlobsAreBounded) {
  RenderedWand scene;
  scene.Render(std::nullopt);
  uint32_t state = 7;
  const auto next = [&state](uint32_t n) {
    state = state * 1664525u + 1013904223u;
    return static_cast<int>((state >> 16) % n);
  };
  for (int i = 0; i < 700; ++i) scene.Fill(next(630), next(470), 6, 6, 30, 90, 200);
  WandDetectorOptions options;
  options.max_blobs = 300;
  ASSERT_OK_AND_ASSIGN(auto detector, WandDetector::Create(options, scene.target, scene.camera));
  const Detection detection = MustDetect(detector, scene.View());
  EXPECT_NE(detection.outcome, DetectionOutcome::kBlack);
  EXPECT_LE(detection.blob_count, 300);
}

TEST(WandDetector, TrackedAndFullSearchTellTheSame) {
  FrameRenderOptions room = RenderedWand::QuietRoom();
  room.clutter = 0.5;
  RenderedWand scene(room);
  WandDetectorOptions full;
  full.tracking = false;
  ASSERT_OK_AND_ASSIGN(auto tracking, WandDetector::Create({}, scene.target, scene.camera));
  ASSERT_OK_AND_ASSIGN(auto searching, WandDetector::Create(full, scene.target, scene.camera));
  int both = 0, tracked = 0;
  for (int i = 0; i < 60; ++i) {
    const double t = 0.02 * i;
    WandMotion wand = RenderedWand::Wand({-0.5 + 0.8 * t, 0.3 * std::sin(4 * t), 2.5},
                                         {std::cos(t), std::sin(t), 0.2});
    scene.Render(wand, static_cast<uint64_t>(i));
    const Detection a = MustDetect(tracking, scene.View(), i * kPeriodNs);
    const Detection b = MustDetect(searching, scene.View(), i * kPeriodNs);
    EXPECT_FALSE(b.tracked);
    tracked += a.tracked ? 1 : 0;
    if (a.outcome != DetectionOutcome::kWand || b.outcome != DetectionOutcome::kWand) continue;
    ++both;
    for (size_t k = 0; k < 3; ++k) {
      const MarkerObservation &m = a.observation.markers[k], &n = b.observation.markers[k];
      ASSERT_EQ(m.visible, n.visible) << i;
      EXPECT_EQ(m.centre_px, n.centre_px) << i;
      EXPECT_EQ(m.covariance_px2, n.covariance_px2) << i;
      EXPECT_EQ(m.label_confidence, n.label_confidence) << i;
    }
  }
  EXPECT_GE(both, 55);
  EXPECT_GE(tracked, 50);
}

TEST(WandDetector, FollowsNothingAcrossAStepOfTheClock) {
  RenderedWand scene;
  scene.Render(Standing());
  ASSERT_OK_AND_ASSIGN(auto detector, WandDetector::Create({}, scene.target, scene.camera));
  MustDetect(detector, scene.View(), kPeriodNs);
  EXPECT_TRUE(MustDetect(detector, scene.View(), 2 * kPeriodNs).tracked);
  const auto stepped = detector.Detect(scene.View(), 3 * kPeriodNs, 1);
  ASSERT_THAT(stepped, IsOk());
  EXPECT_EQ(stepped->outcome, DetectionOutcome::kWand);
  EXPECT_FALSE(stepped->tracked);
  EXPECT_EQ(stepped->observation.clock_epoch, 1u);
}

TEST(WandDetector, SinglePointIsFoundAndTwoAreAmbiguous) {
  RenderedWand scene;
  scene.target = Target();
  scene.target.kind = TargetKind::kPoint;
  scene.target.marker_positions_m = {0};
  scene.Render(std::nullopt);
  ASSERT_OK_AND_ASSIGN(auto detector, WandDetector::Create({}, scene.target, scene.camera));
  const auto disc = [&scene](int x0, int y0) {
    for (int y = -8; y <= 8; ++y) {
      for (int x = -8; x <= 8; ++x) {
        if (x * x + y * y < 60) scene.Fill(x0 + x, y0 + y, 1, 1, 30, 90, 200);
      }
    }
  };
  disc(200, 150);
  const Detection one = MustDetect(detector, scene.View());
  ASSERT_EQ(one.outcome, DetectionOutcome::kWand);
  EXPECT_LT((one.observation.markers[0].centre_px - Eigen::Vector2d(200, 150)).norm(), 0.1);
  EXPECT_EQ(one.observation.markers[0].centre_kind, CentreKind::kImageBlob);
  disc(400, 300);
  EXPECT_EQ(MustDetect(detector, scene.View()).outcome, DetectionOutcome::kAmbiguous);
}

TEST(WandDetector, RefusesPicturesOfAnotherSize) {
  RenderedWand scene;
  ASSERT_OK_AND_ASSIGN(auto detector, WandDetector::Create({}, scene.target, scene.camera));
  ImageView view = scene.View();
  view.height = 400;
  EXPECT_THAT(
      detector.Detect(view, 1, 0),
      StatusIs(absl::StatusCode::kInvalidArgument,
               AllOf(HasSubstr("camera test"), HasSubstr("640x400"), HasSubstr("640x480"))));
  view = scene.View();
  view.data = nullptr;
  EXPECT_THAT(detector.Detect(view, 1, 0),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("without data")));
}

TEST(WandDetector, IgnoredPixelsHoldNoMarker) {
  RenderedWand scene;
  scene.Render(Standing());
  ASSERT_OK_AND_ASSIGN(auto detector, WandDetector::Create({}, scene.target, scene.camera));
  PixelMask all(640, 480);
  for (int y = 0; y < 480; ++y) {
    for (int x = 0; x < 640; ++x) all.Set(x, y);
  }
  detector.SetIgnored(std::move(all));
  EXPECT_NE(MustDetect(detector, scene.View()).outcome, DetectionOutcome::kWand);
}

// Every pixel by its place; channels blue, green, red.
template <typename Colour>
std::vector<uint8_t> Picture(Colour colour) {
  std::vector<uint8_t> pixels(640 * 480 * 3);
  for (int y = 0; y < 480; ++y) {
    for (int x = 0; x < 640; ++x) {
      const std::array<int, 3> bgr = colour(x, y);
      for (size_t k = 0; k < 3; ++k) {
        pixels[static_cast<size_t>(y * 640 + x) * 3 + k] = static_cast<uint8_t>(bgr[k]);
      }
    }
  }
  return pixels;
}

TEST(WandDetector, SaysWhatItLeftOutOfPicturesOfTheWandsColour) {
  RenderedWand scene;
  ASSERT_OK_AND_ASSIGN(auto detector, WandDetector::Create({}, scene.target, scene.camera));
  using Bgr = std::array<int, 3>;
  const auto detect = [&](const std::vector<uint8_t>& pixels) {
    return MustDetect(detector, {pixels.data(), 640, 480, 640 * 3, PixelFormat::kBgr8});
  };
  const Detection orange = detect(Picture([](int, int) { return Bgr{30, 120, 230}; }));
  EXPECT_EQ(orange.outcome, DetectionOutcome::kNoWand);
  EXPECT_FALSE(orange.cut_short);
  std::mt19937 random(1);
  std::uniform_int_distribution<int> any(0, 255), low(0, 80);
  const Detection noise = detect(Picture([&](int, int) {
    return Bgr{low(random), low(random), any(random)};
  }));
  EXPECT_EQ(noise.outcome, DetectionOutcome::kTooManyBlobs);
  EXPECT_TRUE(noise.cut_short);
  EXPECT_DOUBLE_EQ(orange.passed_share, 1);
  EXPECT_EQ(orange.white_share, 0);
  const Detection white = detect(Picture([](int, int) { return Bgr{255, 255, 255}; }));
  EXPECT_EQ(white.outcome, DetectionOutcome::kSaturated);
  EXPECT_DOUBLE_EQ(white.white_share, 1);
  // Discs in rows and columns hold hundreds of wands.
  for (const int step : {15, 30, 60}) {
    const Detection discs = detect(Picture([&](int x, int y) {
      const double radius = std::hypot(x % step - step / 2, y % step - step / 2);
      return radius < 0.28 * step ? Bgr{20, 120, 230} : Bgr{20, 30, 30};
    }));
    EXPECT_NE(discs.outcome, DetectionOutcome::kWand) << step;
    EXPECT_EQ(discs.observation.VisibleCount(), 0) << step;
  }
}

TEST(WandDetector, APieceOfAPatchIsHeldToTheWandsColour) {
  RenderedWand scene;
  scene.Render(std::nullopt);
  ASSERT_OK_AND_ASSIGN(auto detector, WandDetector::Create({}, scene.target, scene.camera));
  // Discs that are brighter than the brown they lie on, spaced as on a wand.
  const auto draw = [&scene](uint8_t blue, uint8_t green, uint8_t red) {
    scene.Fill(150, 100, 300, 200, 40, 70, 110);
    for (const int x0 : {220, 259, 337}) {
      for (int y = -8; y <= 8; ++y) {
        for (int x = -8; x <= 8; ++x) {
          if (x * x + y * y < 60) scene.Fill(x0 + x, 200 + y, 1, 1, blue, green, red);
        }
      }
    }
  };
  draw(40, 130, 230);
  EXPECT_EQ(MustDetect(detector, scene.View(), 1).outcome, DetectionOutcome::kWand);
  draw(230, 120, 40);
  EXPECT_NE(MustDetect(detector, scene.View(), kPeriodNs).outcome, DetectionOutcome::kWand);
}

TEST(WandDetectorOptions, NamesEveryFault) {
  RenderedWand scene;
  WandDetectorOptions options;
  options.max_blobs = 1;
  options.min_distance_m = 5;
  options.max_distance_m = 4;
  options.min_confidence = std::nan("");
  options.exposure_s = -1;
  EXPECT_THAT(
      WandDetector::Create(options, scene.target, scene.camera),
      StatusIs(absl::StatusCode::kInvalidArgument,
               AllOf(HasSubstr("camera test"), HasSubstr("max_blobs"), HasSubstr("min_distance"),
                     HasSubstr("min_confidence"), HasSubstr("exposure"))));
}

}  // namespace
}  // namespace rigcal::agent::wand_detector_test

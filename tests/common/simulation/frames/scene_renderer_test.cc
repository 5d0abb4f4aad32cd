// SPDX-License-Identifier: Apache-2.0
#include "common/simulation/frames/scene_renderer.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "tests/testing/simulation_text.h"
#include "tests/testing/status_matchers.h"
#include "tests/testing/wand_motion.h"

namespace rigcal::scene_renderer_test {
namespace {

using ::rigcal::testing::OptionsFrom;
using ::rigcal::testing::StatusIs;
using ::rigcal::testing::VisibleShare;
using ::rigcal::testing::WandMotion;
using ::rigcal::testing::WandVisible;
using ::testing::HasSubstr;

using Image = std::vector<uint8_t>;
const ImageSize kSize{640, 512};

Intrinsics Lens() {
  return {DistortionModel::kBrownConrady, 625, 624, 318, 257, {-0.22, 0.2, 5e-4, -7e-4, -0.16}};
}

Target Wand() { return *ParseTarget("wand:0,0.13,0.39;diameter=0.04;hz=500"); }

// Two metres away, along the frame's rows.
WandMotion StandingWand() {
  WandMotion wand;
  wand.origin_m = {-0.2, 0.1, 2};
  return wand;
}

SceneFrame WandFrame(uint64_t seed = 1, const WandMotion& wand = StandingWand()) {
  SceneFrame frame;
  frame.spheres = wand.Spheres(Wand());
  frame.seed = seed;
  return frame;
}

double ShareOf(const WandPose& wand, size_t marker, const FrameGroundTruth& truth) {
  return VisibleShare(Lens(), kSize, Wand(), wand, marker, truth.bar ? &*truth.bar : nullptr);
}

SceneRenderer Make(std::string_view options) {
  return *SceneRenderer::Create(Lens(), kSize, Wand(), *OptionsFrom<FrameRenderOptions>(options));
}

Image Draw(SceneRenderer& renderer, const SceneFrame& frame, FrameGroundTruth* truth = nullptr) {
  Image image(renderer.buffer_size());
  const auto result = renderer.Render(frame, std::span<uint8_t>(image));
  EXPECT_TRUE(result.ok()) << result.status();
  if (truth != nullptr) *truth = *result;
  return image;
}

std::array<int, 3> PixelAt(const Image& image, const Eigen::Vector2d& pixel) {
  const auto x = static_cast<size_t>(std::lround(pixel.x()));
  const auto y = static_cast<size_t>(std::lround(pixel.y()));
  const uint8_t* p = &image[3 * (y * kSize.width + x)];
  return {p[0], p[1], p[2]};
}

constexpr char kNoNoise[] = "read_noise=0;electrons_per_grey=1e9;vignetting=0;limb=0;";

TEST(SceneRenderer, EqualArgumentsGiveEqualFrames) {
  constexpr char kAll[] =
      "clutter=1;lux=500;reflection=0.3;bloom=0.2;occlusion=0.5;rod=0.012;held=1;windows=1;"
      "shelves=1;people=1;screens=1;lights=2;line_delay=15;bayer=1;jpeg=80;led_gradient=0.3;"
      "led_uneven=0.3;overhead_lux=300";
  SceneRenderer a = Make(kAll), b = Make(kAll);
  const Image first = Draw(a, WandFrame(3));
  Draw(a, WandFrame(4));
  Draw(a, SceneFrame{});
  EXPECT_EQ(Draw(a, WandFrame(3)), first);
  EXPECT_EQ(Draw(b, WandFrame(3)), first);
  EXPECT_NE(Draw(b, WandFrame(4)), first);
}

TEST(SceneRenderer, TakesTheWandOutOfTheRoomAgain) {
  constexpr char kAll[] =
      "clutter=1;lux=500;reflection=0.5;bloom=0.5;occlusion=1;rod=0.012;held=1;line_delay=15";
  SceneRenderer used = Make(kAll), fresh = Make(kAll);
  for (uint64_t seed = 0; seed < 20; ++seed) Draw(used, WandFrame(seed));
  EXPECT_EQ(Draw(used, SceneFrame{}), Draw(fresh, SceneFrame{}));
}

TEST(SceneRenderer, SpheresShineWhereTheTruthSays) {
  SceneRenderer renderer =
      Make(std::string(kNoNoise) + "lux=0;black=0;blink_hz=0;exposure=0.004;led_grey=250");
  FrameGroundTruth truth;
  const Image image = Draw(renderer, WandFrame(), &truth);
  ASSERT_EQ(truth.markers.size(), 3u);
  EXPECT_TRUE(WandVisible(Lens(), kSize, Wand(), StandingWand()));
  for (const MarkerGroundTruth& marker : truth.markers) {
    EXPECT_TRUE(marker.inside);
    EXPECT_NEAR(marker.radius_px, 6.2, 0.3);
    const auto [blue, green, red] = PixelAt(image, marker.centre_px);
    EXPECT_NEAR(red, 100, 1);  // two blinks at the target's 500 Hz: half of the time
    EXPECT_LT(green, red);
    EXPECT_LT(blue, green);
    const Eigen::Vector2d beside = marker.centre_px + Eigen::Vector2d(0, 12);
    EXPECT_EQ(PixelAt(image, beside)[2], 0);
  }
}

TEST(SceneRenderer, LightFromAboveIsOnTheUpperHalfOfASphere) {
  SceneRenderer renderer = Make(std::string(kNoNoise) + "lux=0;black=0;overhead_lux=1500");
  FrameGroundTruth truth;
  const Image image = Draw(renderer, WandFrame(), &truth);
  for (const MarkerGroundTruth& marker : truth.markers) {
    const Eigen::Vector2d half(0, 0.5 * marker.radius_px);
    const auto above = PixelAt(image, marker.centre_px - half);
    const auto below = PixelAt(image, marker.centre_px + half);
    EXPECT_GT(above[0], below[0] + 20);
    EXPECT_GT(above[2], below[2] + 20);
  }
}

TEST(SceneRenderer, UnevenLightRisesAlongTheWand) {
  SceneRenderer renderer = Make(std::string(kNoNoise) + "lux=0;black=0;led_gradient=0.4");
  FrameGroundTruth truth;
  const Image image = Draw(renderer, WandFrame(), &truth);
  const Eigen::Vector2d along =
      (truth.markers.back().centre_px - truth.markers.front().centre_px).normalized();
  for (const MarkerGroundTruth& marker : truth.markers) {
    const Eigen::Vector2d half = 0.5 * marker.radius_px * along;
    EXPECT_GT(PixelAt(image, marker.centre_px + half)[2],
              1.2 * PixelAt(image, marker.centre_px - half)[2]);
  }
}

TEST(SceneRenderer, AStickJoinsTheSpheres) {
  SceneRenderer with = Make(std::string(kNoNoise) + "lux=1000;reflectance=0;rod=0.015");
  FrameGroundTruth truth;
  const Image image = Draw(with, WandFrame(), &truth);
  const Eigen::Vector2d between = 0.5 * (truth.markers[1].centre_px + truth.markers[2].centre_px);
  EXPECT_GT(PixelAt(image, between)[2], 8);
  EXPECT_LE(PixelAt(image, between + Eigen::Vector2d(0, 40))[2], 6);
}

TEST(SceneRenderer, TheLightIsThatOfTheTimeLit) {
  // Half a blink long: anything from dark to lit all the time.
  SceneRenderer renderer =
      Make(std::string(kNoNoise) + "lux=0;black=0;exposure=0.001;led_grey=500");
  double least = 1, most = 0;
  for (int step = 0; step < 40; ++step) {
    SceneFrame frame = WandFrame();
    frame.led_time_s = 5e-5 * step;
    // Lit during the first millisecond of every two.
    const double away_ms = std::abs(std::remainder(0.05 * step - 0.5, 2.0));
    const double lit_share = std::max(0.0, 1 - away_ms);
    FrameGroundTruth truth;
    const Image image = Draw(renderer, frame, &truth);
    // 500 grey in 5 ms at half duty: 200 in 1 ms lit throughout.
    EXPECT_NEAR(PixelAt(image, truth.markers[0].centre_px)[2], 200 * lit_share, 1.5);
    least = std::min(least, lit_share);
    most = std::max(most, lit_share);
  }
  EXPECT_LT(least, 0.1);
  EXPECT_GT(most, 0.9);
}

TEST(SceneRenderer, EveryLedHasAPhaseOfItsOwnByTheSeed) {
  SceneRenderer renderer =
      Make(std::string(kNoNoise) + "lux=0;black=0;exposure=0.001;led_grey=500");
  double least = 255, most = 0;
  for (uint64_t seed = 0; seed < 20; ++seed) {
    FrameGroundTruth truth;
    const Image image = Draw(renderer, WandFrame(seed), &truth);
    for (const MarkerGroundTruth& marker : truth.markers) {
      const double red = PixelAt(image, marker.centre_px)[2];
      least = std::min(least, red);
      most = std::max(most, red);
    }
  }
  EXPECT_LT(least, 20);
  EXPECT_GT(most, 180);
}

TEST(SceneRenderer, AmbientLightTakesColourAndContrast) {
  double colour = 2, contrast = 1e9;
  for (const char* lux : {"10", "300", "1000", "5000"}) {
    SceneRenderer renderer = Make(std::string(kNoNoise) + "auto_gain=1;lux=" + lux);
    FrameGroundTruth truth;
    const Image image = Draw(renderer, WandFrame(), &truth);
    const auto [blue, green, red] = PixelAt(image, truth.markers[1].centre_px);
    const double its_colour = static_cast<double>(red - blue) / red;
    const int wall = PixelAt(image, {20, 20})[2];
    const double its_contrast = static_cast<double>(red) / wall;
    EXPECT_LT(its_colour, colour) << lux;
    EXPECT_LT(its_contrast, contrast) << lux;
    EXPECT_LE(red, 250) << "gain is automatic";
    colour = its_colour;
    contrast = its_contrast;
  }
  SceneRenderer fixed = Make(std::string(kNoNoise) + "lux=5000");
  FrameGroundTruth truth;
  const Image image = Draw(fixed, WandFrame(), &truth);
  EXPECT_EQ(PixelAt(image, truth.markers[1].centre_px)[2], 255);
}

TEST(SceneRenderer, BarsCoverWhatTheTruthCallsHidden) {
  SceneRenderer renderer = Make(std::string(kNoNoise) + "occlusion=1;lux=0;black=0;defocus=0");
  SceneRenderer open = Make(std::string(kNoNoise) + "occlusion=0;lux=0;black=0;defocus=0");
  int partly = 0;
  for (uint64_t seed = 0; seed < 50; ++seed) {
    FrameGroundTruth truth, open_truth;
    const Image image = Draw(renderer, WandFrame(seed), &truth);
    const Image whole = Draw(open, WandFrame(seed), &open_truth);
    for (size_t m = 0; m < 3; ++m) {
      const MarkerGroundTruth& marker = truth.markers[m];
      double light = 0, all_light = 0;
      for (int y = -9; y <= 9; ++y) {
        for (int x = -9; x <= 9; ++x) {
          const Eigen::Vector2d at = marker.centre_px + Eigen::Vector2d(x, y);
          light += PixelAt(image, at)[2];
          all_light += PixelAt(whole, at)[2];
        }
      }
      EXPECT_EQ(ShareOf(StandingWand(), m, open_truth), 1);
      const double share = ShareOf(StandingWand(), m, truth);
      EXPECT_NEAR(light / all_light, share, 0.05) << "seed " << seed;
      if (share > 0.05 && share < 0.95) ++partly;
    }
  }
  EXPECT_GT(partly, 15);
}

TEST(SceneRenderer, ReflectionsAreDimmerThanTheWand) {
  SceneRenderer renderer = Make(std::string(kNoNoise) + "reflection=0.4;lux=0;black=0;blink_hz=0");
  SceneFrame frame = WandFrame();
  frame.floor = Eigen::Vector4d(0, 1, 0, 0.3);  // 0.2 m below the wand
  FrameGroundTruth truth;
  const Image image = Draw(renderer, frame, &truth);
  const int red = PixelAt(image, truth.markers[1].centre_px)[2];
  const Eigen::Vector2d mirrored = truth.markers[1].centre_px + Eigen::Vector2d(0, 0.4 / 2 * 624);
  const int mirrored_red = PixelAt(image, mirrored)[2];
  EXPECT_NEAR(mirrored_red, 0.4 * red, 0.05 * red);
}

TEST(SceneRenderer, BloomMakesAHalo) {
  SceneRenderer renderer = Make(std::string(kNoNoise) + "bloom=0.3;bloom_radius=6;lux=0;black=0");
  FrameGroundTruth truth;
  const Image image = Draw(renderer, WandFrame(), &truth);
  const Eigen::Vector2d centre = truth.markers[2].centre_px;
  const int near = PixelAt(image, centre + Eigen::Vector2d(10, 0))[2];
  const int far = PixelAt(image, centre + Eigen::Vector2d(20, 0))[2];
  EXPECT_GT(near, 15);
  EXPECT_GT(near, 3 * far);
  EXPECT_GT(far, 0);
}

TEST(SceneRenderer, TheNearerSphereHidesTheFarther) {
  SceneRenderer renderer = Make(std::string(kNoNoise) + "lux=0;black=0;blink_hz=0");
  WandMotion wand;
  wand.origin_m = {0, 0, 2};
  wand.direction = {0, 0, 1};
  Draw(renderer, WandFrame(1, wand));
  EXPECT_EQ(ShareOf(wand, 0, {}), 1);
  EXPECT_EQ(ShareOf(wand, 1, {}), 0);
  EXPECT_FALSE(WandVisible(Lens(), kSize, Wand(), wand));
}

TEST(SceneRenderer, WandOutsideTheFrameIsNotThere) {
  SceneRenderer renderer = Make("clutter=0");
  for (const Eigen::Vector3d& origin :
       {Eigen::Vector3d(0, 0, -3), Eigen::Vector3d(30, 0, 2), Eigen::Vector3d(0, 0, 0)}) {
    WandMotion wand = StandingWand();
    wand.origin_m = origin;
    FrameGroundTruth truth;
    Draw(renderer, WandFrame(1, wand), &truth);
    EXPECT_FALSE(truth.markers[0].inside);
    EXPECT_FALSE(WandVisible(Lens(), kSize, Wand(), wand));
    EXPECT_EQ(ShareOf(wand, 0, truth), 0);
  }
  FrameGroundTruth nothing;
  Draw(renderer, SceneFrame{}, &nothing);
  EXPECT_TRUE(nothing.markers.empty());
}

TEST(SceneRenderer, RefusesWhatCannotBeDrawn) {
  SceneRenderer renderer = Make("");
  Image small(renderer.buffer_size() - 1);
  const auto refused = renderer.Render(WandFrame(), std::span<uint8_t>(small));
  EXPECT_THAT(refused.status(), StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("bytes")));
  EXPECT_THAT(std::string(refused.status().message()), HasSubstr("983039 bytes"));

  Image image(renderer.buffer_size());
  SceneFrame frame = WandFrame();
  frame.spheres[1].velocity_m_s.x() = std::numeric_limits<double>::infinity();
  EXPECT_THAT(renderer.Render(frame, std::span<uint8_t>(image)).status(),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("not finite")));
  frame.spheres.resize(2);
  EXPECT_THAT(renderer.Render(frame, std::span<uint8_t>(image)).status(),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("2 spheres")));

  FrameRenderOptions options;
  options.lux = -1;
  EXPECT_THAT(SceneRenderer::Create(Lens(), kSize, Wand(), options).status(),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("lux=-1")));
  Intrinsics narrow = Lens();
  narrow.cx_px = 0;
  EXPECT_THAT(SceneRenderer::Create(narrow, {1, 512}, Wand(), {}).status(),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("1x512 px")));
  Intrinsics blind = Lens();
  blind.fx_px = 0;
  EXPECT_THAT(SceneRenderer::Create(blind, kSize, Wand(), {}).status(),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("")));
}

TEST(WandMotion, MarkersTurnAboutMarkerZero) {
  WandMotion wand;
  wand.origin_m = {0, 0, 2};
  wand.direction = {1, 0, 0};
  wand.velocity_m_s = {0, 0, 1};
  wand.angular_velocity_rad_s = {0, 0, 3};
  const SphereMotion marker = wand.Marker(0.5);
  EXPECT_TRUE(marker.centre_m.isApprox(Eigen::Vector3d(0.5, 0, 2)));
  EXPECT_TRUE(marker.velocity_m_s.isApprox(Eigen::Vector3d(0, 1.5, 1)));
  EXPECT_TRUE(marker.acceleration_m_s2.isApprox(Eigen::Vector3d(-4.5, 0, 0)));
}

}  // namespace
}  // namespace rigcal::scene_renderer_test

// SPDX-License-Identifier: Apache-2.0
#include "agent/detect/frame/colour_tuning.h"

#include <cmath>
#include <optional>
#include <string>

#include "tests/agent/detect/frame/rendered_wand.h"
#include "tests/testing/status_matchers.h"

namespace rigcal::agent::colour_tuning_test {
namespace {

using ::rigcal::testing::IsOk;
using ::rigcal::testing::StatusIs;
using ::testing::AllOf;
using ::testing::HasSubstr;

WandMotion WandAt(int i) {
  return RenderedWand::Wand({-0.5 + 0.07 * i, 0.1, 2.2}, {1, 0.1 * i - 0.3, 0.2});
}

TEST(ColourTuner, LearnsARangeThatFindsTheWand) {
  for (const double hue_deg : {24.0, 120.0, 355.0}) {
    FrameRenderOptions room = RenderedWand::QuietRoom();
    room.led_hue_deg = hue_deg;
    room.clutter = 0.3;
    RenderedWand scene(room);
    ASSERT_OK_AND_ASSIGN(auto tuner, ColourTuner::Create(scene.target, scene.camera));
    for (int i = 0; i < 6; ++i) {
      scene.Render(WandAt(i), static_cast<uint64_t>(i));
      ASSERT_THAT(tuner.Add(scene.View()), IsOk());
    }
    ASSERT_OK_AND_ASSIGN(const TunedColour tuned, tuner.Result());
    EXPECT_GE(tuned.wands, 5);
    EXPECT_NEAR(std::remainder(tuned.hue_deg - hue_deg, 360), 0, 8);
    EXPECT_THAT(tuned.colour.Validate(), IsOk());
    WandDetectorOptions options;
    options.colour = tuned.colour;
    ASSERT_OK_AND_ASSIGN(auto detector, WandDetector::Create(options, scene.target, scene.camera));
    for (int i = 6; i < 10; ++i) {
      scene.Render(WandAt(i), static_cast<uint64_t>(i));
      const auto detection = detector.Detect(scene.View(), i, 0);
      ASSERT_THAT(detection, IsOk());
      EXPECT_EQ(detection->outcome, DetectionOutcome::kWand) << hue_deg << " " << i;
    }
  }
}

TEST(ColourTuner, RefusesPicturesWithoutAWandAndSaysWhatToDo) {
  RenderedWand scene;
  ASSERT_OK_AND_ASSIGN(auto tuner, ColourTuner::Create(scene.target, scene.camera));
  EXPECT_THAT(tuner.Result(), StatusIs(absl::StatusCode::kFailedPrecondition, HasSubstr("0 of 0")));
  for (int i = 0; i < 4; ++i) {
    scene.Render(std::nullopt, static_cast<uint64_t>(i));
    ASSERT_THAT(tuner.Add(scene.View()), IsOk());
  }
  EXPECT_THAT(tuner.Result(), StatusIs(absl::StatusCode::kFailedPrecondition,
                                       AllOf(HasSubstr("4 of 4 frames"), HasSubstr("tune again"))));
}

TEST(ColourTuner, SaysWhatIsWrongWithTheFrames) {
  RenderedWand scene;
  const auto refusal = [&scene](int grey) {
    auto tuner = ColourTuner::Create(scene.target, scene.camera);
    EXPECT_THAT(tuner, IsOk());
    scene.Render(std::nullopt);
    scene.Fill(0, 0, 640, 480, static_cast<uint8_t>(grey), static_cast<uint8_t>(grey),
               static_cast<uint8_t>(grey));
    for (int i = 0; i < 3; ++i) EXPECT_THAT(tuner->Add(scene.View()), IsOk());
    return std::string(tuner->Result().status().message());
  };
  EXPECT_THAT(refusal(255), HasSubstr("3 of them are white for the most part: shorten"));
  EXPECT_THAT(refusal(2), HasSubstr("3 of them are black: switch the wand on"));
  EXPECT_THAT(refusal(100), HasSubstr("nothing of its shape stands out"));
}

TEST(ColourTuner, RefusesTwoMarkersAndPicturesOfAnotherSize) {
  RenderedWand scene;
  ASSERT_OK_AND_ASSIGN(auto tuner, ColourTuner::Create(scene.target, scene.camera));
  ImageView view = scene.View();
  view.width = 320;
  EXPECT_THAT(tuner.Add(view), StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("320x480")));
  scene.target.marker_positions_m = {0, 0.2};
  EXPECT_THAT(ColourTuner::Create(scene.target, scene.camera),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("three markers")));
}

}  // namespace
}  // namespace rigcal::agent::colour_tuning_test

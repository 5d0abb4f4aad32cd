// SPDX-License-Identifier: Apache-2.0
#include "agent/detect/frame/background_learner.h"

#include <algorithm>
#include <optional>
#include <vector>

#include "agent/detect/frame/wand_detector.h"
#include "tests/agent/detect/frame/rendered_wand.h"
#include "tests/testing/status_matchers.h"

namespace rigcal::agent::background_learner_test {
namespace {

constexpr int64_t kFrameNs = 100'000'000;
constexpr double kAfterS = 1;

// A camera's sequence: the detector with a background that is learnt, after each frame.
class Sequence {
 public:
  Sequence() {
    auto detector = WandDetector::Create({}, scene.target, scene.camera);
    EXPECT_THAT(detector, ::rigcal::testing::IsOk());
    detector_.emplace(*std::move(detector));
    auto learner = BackgroundLearner::Create({}, scene.camera.image_size_px, kAfterS);
    EXPECT_THAT(learner, ::rigcal::testing::IsOk());
    learner_.emplace(*std::move(learner));
    detector_->SetBackground(learner_->background());
  }

  // The wand beside lamps that stand like one.
  Detection Next(const std::optional<WandMotion>& wand, const std::optional<WandMotion>& lamps) {
    scene.Render(lamps, ++frame_);
    const std::vector<uint8_t> behind = scene.pixels;
    truth = scene.Render(wand, frame_);
    std::transform(behind.begin(), behind.end(), scene.pixels.begin(), scene.pixels.begin(),
                   [](uint8_t a, uint8_t b) { return std::max(a, b); });
    return NextOfScene();
  }
  Detection NextOfScene() {
    now_ns_ += kFrameNs;
    learner_->Look(scene.View());
    auto detection = detector_->Detect(scene.View(), now_ns_, 0);
    EXPECT_THAT(detection, ::rigcal::testing::IsOk());
    learner_->Learn(scene.View(), *detection);
    return *std::move(detection);
  }

  BackgroundLearner& learner() { return *learner_; }
  RenderedWand scene;
  FrameGroundTruth truth;

 private:
  std::optional<WandDetector> detector_;
  std::optional<BackgroundLearner> learner_;
  uint64_t frame_ = 0;
  int64_t now_ns_ = 0;
};

WandMotion Lamps() { return RenderedWand::Wand({-0.3, 0.4, 2.2}, {1, 0, 0}); }
WandMotion MovingWand(int i) { return RenderedWand::Wand({-0.6 + 0.02 * i, -0.4, 2.2}, {1, 0, 0}); }

bool IsWandAt(const Detection& detection, const FrameGroundTruth& truth) {
  if (detection.outcome != DetectionOutcome::kWand) return false;
  for (size_t k = 0; k < truth.markers.size(); ++k) {
    const MarkerObservation& marker = detection.observation.markers[k];
    if (!marker.visible || (marker.centre_px - truth.markers[k].centre_px).norm() > 0.3) {
      return false;
    }
  }
  return true;
}

TEST(BackgroundLearner, LampsThatStandLikeAWandAreIgnoredWithinSeconds) {
  Sequence sequence;
  EXPECT_EQ(sequence.Next(MovingWand(0), Lamps()).outcome, DetectionOutcome::kAmbiguous);
  for (int i = 1; i < 15; ++i) sequence.Next(MovingWand(i), Lamps());
  EXPECT_GT(sequence.learner().share(), 0);
  for (int i = 15; i < 30; ++i) {
    const Detection detection = sequence.Next(MovingWand(i), Lamps());
    EXPECT_TRUE(IsWandAt(detection, sequence.truth)) << i;
  }
  EXPECT_FALSE(sequence.learner().ignores_wand());
}

TEST(BackgroundLearner, LampsAreSearchedAgainOnceTheyHaveMoved) {
  Sequence sequence;
  for (int i = 0; i < 20; ++i) sequence.Next(MovingWand(i), Lamps());
  const auto elsewhere = RenderedWand::Wand({-0.3, 0.1, 2.2}, {1, 0, 0});
  EXPECT_EQ(sequence.Next(std::nullopt, elsewhere).outcome, DetectionOutcome::kWand);
  for (int i = 0; i < 30; ++i) sequence.Next(std::nullopt, std::nullopt);
  EXPECT_EQ(sequence.learner().share(), 0);
}

TEST(BackgroundLearner, AWandIsFoundInFrontOfWhatWasLearnt) {
  Sequence sequence;
  // Orange cloth, darker than the spheres.
  const auto hang = [&](const std::optional<WandMotion>& wand) {
    const FrameGroundTruth truth = sequence.scene.Render(wand);
    std::vector<uint8_t> spheres = sequence.scene.pixels;
    sequence.scene.Fill(0, 0, 640, 480, 10, 40, 80);
    for (size_t i = 0; i < spheres.size(); ++i) {
      sequence.scene.pixels[i] = std::max(sequence.scene.pixels[i], spheres[i]);
    }
    return truth;
  };
  // Of so much only a part is learnt from each frame.
  for (int i = 0; i < 80; ++i) {
    hang(std::nullopt);
    sequence.NextOfScene();
  }
  EXPECT_EQ(sequence.learner().share(), 1);
  for (int i = 0; i < 5; ++i) {
    const FrameGroundTruth truth = hang(MovingWand(4 * i));
    const Detection detection = sequence.NextOfScene();
    EXPECT_TRUE(IsWandAt(detection, truth)) << i;
    EXPECT_LT(detection.passed_share, 0.02);
  }
}

TEST(BackgroundLearner, AWandThatRestsIsIgnoredSaidSoAndFoundAsSoonAsItMoves) {
  Sequence sequence;
  for (int i = 0; i < 8; ++i) sequence.Next(MovingWand(i), std::nullopt);
  // Longer than a spot.
  for (int i = 0; i < 25; ++i) {
    EXPECT_TRUE(IsWandAt(sequence.Next(MovingWand(8), std::nullopt), sequence.truth)) << i;
    EXPECT_FALSE(sequence.learner().ignores_wand()) << i;
  }
  for (int i = 0; i < 15; ++i) sequence.Next(MovingWand(8), std::nullopt);
  EXPECT_NE(sequence.Next(MovingWand(8), std::nullopt).outcome, DetectionOutcome::kWand);
  EXPECT_TRUE(sequence.learner().ignores_wand());
  // By less than a sphere's radius.
  const auto beside = RenderedWand::Wand({-0.6 + 0.17, -0.4, 2.2}, {1, 0, 0});
  EXPECT_TRUE(IsWandAt(sequence.Next(beside, std::nullopt), sequence.truth));
  EXPECT_FALSE(sequence.learner().ignores_wand());
}

TEST(BackgroundLearner, TheSameFramesGiveTheSameResult) {
  Sequence a, b;
  for (int i = 0; i < 25; ++i) {
    const auto wand = i % 3 == 0 ? std::nullopt : std::optional(MovingWand(i));
    const Detection one = a.Next(wand, Lamps()), other = b.Next(wand, Lamps());
    ASSERT_EQ(one.outcome, other.outcome) << i;
    for (size_t k = 0; k < one.observation.markers.size(); ++k) {
      EXPECT_EQ(one.observation.markers[k].centre_px, other.observation.markers[k].centre_px) << i;
    }
    EXPECT_EQ(a.learner().share(), b.learner().share());
  }
}

}  // namespace
}  // namespace rigcal::agent::background_learner_test

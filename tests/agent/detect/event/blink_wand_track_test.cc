// SPDX-License-Identifier: Apache-2.0
#include "agent/detect/event/blink_wand_track.h"

#include <gtest/gtest.h>

namespace rigcal::agent::blink_wand_track_test {
namespace {

using Sightings = std::vector<BlinkWandTrack::Sighting>;

// Three markers on a line that moves to the right by 0.5 px per ms.
Sightings At(double time_us) {
  Sightings result;
  for (int k = 0; k < 3; ++k) {
    result.push_back({.seen = true,
                      .centre_px = {100 + 60.0 * k + 0.5e-3 * time_us, 200},
                      .radius_px = 8,
                      .time_us = time_us,
                      .frequency = 0});
  }
  return result;
}

TEST(BlinkWandTrack, PredictsUniformMotion) {
  BlinkWandTrack track;
  EXPECT_TRUE(track.empty());
  track.Add(At(0), 0.99);
  const double first_gate_px = track.Predict(0, 20'000).gate_px;
  EXPECT_FALSE(track.Velocity(0));
  track.Add(At(20'000), 0.99);
  ASSERT_FALSE(track.empty());
  EXPECT_EQ(track.label_confidence(), 0.99);
  for (size_t k = 0; k < 3; ++k) {
    const BlinkWandTrack::Prediction expected = track.Predict(k, 40'000);
    EXPECT_LT((expected.centre_px - At(40'000)[k].centre_px).norm(), 1e-9);
    EXPECT_EQ(expected.radius_px, 8);
    EXPECT_LT((*track.Velocity(k) - Eigen::Vector2d(0.5e-3, 0)).norm(), 1e-9);
    EXPECT_LT(expected.gate_px, first_gate_px);  // the velocity is known now
  }
}

TEST(BlinkWandTrack, BeginsWithAWholeWand) {
  BlinkWandTrack track;
  Sightings part = At(0);
  part[1].seen = false;
  track.Add(part, 0.99);
  EXPECT_TRUE(track.empty());
}

TEST(BlinkWandTrack, AHiddenMarkerMovesOnWithTheOthers) {
  BlinkWandTrack track;
  track.Add(At(0), 0.99);
  track.Add(At(10'000), 0.99);
  for (int i = 2; i < 12; ++i) {
    // The wand begins to sink, too, by 0.2 px per ms.
    Sightings part = At(10'000.0 * i);
    for (auto& sighting : part) sighting.centre_px.y() += 2.0 * (i - 1);
    part[2].seen = false;
    track.Add(part, 0.99);
  }
  const Eigen::Vector2d expected_px = track.Predict(2, 110'000).centre_px;
  EXPECT_LT((expected_px - Eigen::Vector2d(275, 220)).norm(), 0.01);
}

TEST(BlinkWandTrack, ForgetsAWandThatIsGone) {
  BlinkWandTrack track;
  track.Add(At(4'294'967'000), 0.99);  // the lower 32 bits begin anew 296 us later
  track.ForgetBefore(20'000);
  EXPECT_FALSE(track.empty());
  track.ForgetBefore(200'000);
  EXPECT_TRUE(track.empty());
}

}  // namespace
}  // namespace rigcal::agent::blink_wand_track_test

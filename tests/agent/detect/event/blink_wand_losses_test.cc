// SPDX-License-Identifier: Apache-2.0
// The wand detector where events are missing: gaps in the stream, a camera that drops a part of the
// events, pixels that are blind for long; and where lamps blink near the wand's frequency.
#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "agent/detect/event/band_advice.h"
#include "agent/detect/event/blink_wand_detector.h"
#include "agent/event/evt3_writer.h"
#include "common/simulation/events/event_renderer.h"
#include "tests/testing/event_disturbance.h"

namespace rigcal::agent::blink_wand_losses_test {
namespace {

using ::rigcal::testing::EventDisturbance;

CameraDescription Camera() {
  CameraDescription camera;
  camera.camera = "left";
  camera.sensor = SensorKind::kEvent;
  camera.image_size_px = {640, 480};
  Intrinsics intrinsics;
  intrinsics.fx_px = intrinsics.fy_px = 600;
  intrinsics.cx_px = 320;
  intrinsics.cy_px = 240;
  camera.intrinsics = intrinsics;
  return camera;
}

// To and fro before the camera, 1.6 m away.
WandPose WandAt(double time_s) {
  constexpr double kSwingM = 0.15, kSwingRadS = 5;  // 0.75 m/s at most: 280 px/s
  return {{-0.2 + kSwingM * std::sin(kSwingRadS * time_s), 0.05, 1.6},
          Eigen::Vector3d(1, 0.2, 0.3).normalized()};
}

struct Setting {
  EventDisturbance disturbance = {};
  double refractory_us = 500;
  double threshold = 0.25;
  double lamps = 0;
  double lamp_hz = 100;
  double band_rel = 0.15;
  int64_t duration_us = 600'000;
  int64_t from_us = 100'000;  // what is usual is known by then
};

struct Observed {
  BlinkWandCounts counts;
  int detections = 0, wands = 0;
  double nees = 0, sigma_px = 0;  // of a coordinate, in the mean
  double widest_px = 0;           // sigma
};

Observed Watch(const Setting& setting) {
  const CameraDescription camera = Camera();
  const Target target = *ParseTarget("wand:0,0.13,0.39;diameter=0.04;hz=500");
  EventRenderOptions sensor;
  sensor.bars = 0;
  sensor.lamps = setting.lamps;
  sensor.lamp_hz = setting.lamp_hz;
  sensor.refractory_us = setting.refractory_us;
  sensor.on_threshold = sensor.off_threshold = setting.threshold;
  auto renderer = *EventRenderer::Create(*camera.intrinsics, camera.image_size_px, target,
                                         FrameRenderOptions(), sensor);
  BlinkWandDetectorOptions options;
  options.band_rel = setting.band_rel;
  auto detector = *BlinkWandDetector::Create(options, target, camera, EventFormat::kEvt3, false);
  testing::EventDisturber disturber(setting.disturbance);
  Evt3Writer writer;
  std::vector<Detection> detections;
  std::vector<SimulatedEvent> events;
  std::vector<SimulatedTrigger> triggers;
  std::vector<uint8_t> bytes;
  for (int64_t end_us = 5000; end_us <= setting.duration_us; end_us += 5000) {
    events.clear();
    EXPECT_TRUE(renderer.Render(end_us, WandAt, &events, &triggers).ok());
    disturber.Apply(&events);
    std::vector<CdEvent> cd_events;
    for (const SimulatedEvent& event : events) {
      cd_events.push_back({event.time_us, event.x, event.y, event.on});
    }
    bytes.clear();
    writer.Write(cd_events, &bytes);
    writer.WriteTime(end_us, &bytes);
    detector.Take(bytes, &detections);
  }
  detector.Finish(&detections);
  Observed observed{.counts = detector.counts()};
  int centres = 0;
  for (const Detection& detection : detections) {
    const Observation& seen = detection.observation;
    if (seen.time_ns < 1000 * setting.from_us) continue;
    ++observed.detections;
    if (detection.outcome != DetectionOutcome::kWand) continue;
    ++observed.wands;
    for (size_t k = 0; k < seen.markers.size(); ++k) {
      const MarkerObservation& marker = seen.markers[k];
      if (!marker.visible) continue;
      const double at_s = 1e-9 * static_cast<double>(seen.time_ns + marker.time_delta_ns);
      const Eigen::Vector2d error_px =
          marker.centre_px - renderer.TruthOf(WandAt(at_s))[k].centre_px;
      observed.nees += 0.5 * error_px.dot(marker.covariance_px2.ldlt().solve(error_px));
      const double sigma_px = std::sqrt(0.5 * marker.covariance_px2.trace());
      observed.sigma_px += sigma_px;
      observed.widest_px = std::max(observed.widest_px, sigma_px);
      ++centres;
    }
  }
  if (centres > 0) observed.nees /= centres, observed.sigma_px /= centres;
  return observed;
}

TEST(BlinkWandLosses, NothingIsMissingInAStreamThatIsWhole) {
  const Observed observed = Watch({.lamps = 2});
  EXPECT_GE(observed.wands, 0.97 * observed.detections);
  EXPECT_EQ(observed.counts.gaps, 0u);
  EXPECT_EQ(observed.counts.beside_gap, 0u);
  EXPECT_EQ(observed.counts.thinned, 0u);
  EXPECT_EQ(observed.counts.banded, 0u);
  EXPECT_GE(observed.counts.answered_percent, 97 * observed.counts.judged);
  EXPECT_GT(observed.counts.events, 500'000u);
  EXPECT_NEAR(static_cast<double>(observed.counts.time_us), 600'000, 5000);
  EXPECT_LT(observed.sigma_px, 0.15);
  EXPECT_LT(observed.nees, 2);
}

// Each gap stops the count of periods of every pixel unless it is bridged: 63 % were found.
TEST(BlinkWandLosses, AWandIsFollowedThroughGapsAndTheyAreCounted) {
  const Observed observed = Watch({.disturbance = {.lost_ms_share = 0.1}});
  EXPECT_GE(observed.wands, 0.88 * observed.detections);
  // Of 600 ms a tenth; the first 64 ms say what is usual. Those side by side are one.
  EXPECT_GE(observed.counts.gaps, 30u);
  EXPECT_LE(observed.counts.gaps, 75u);
  EXPECT_NEAR(static_cast<double>(observed.counts.gap_us), 54'000, 18'000);
  EXPECT_GE(observed.counts.beside_gap, 10u);
  EXPECT_LT(observed.counts.beside_gap, observed.counts.by_outcome.Of(DetectionOutcome::kWand) / 2);
  EXPECT_GT(observed.widest_px, 0.25);
  EXPECT_LT(observed.nees, 2);
}

TEST(BlinkWandLosses, WhatADroppingCameraLeavesWidensTheCovariance) {
  struct Case {
    double threshold, refractory_us, kept_share;
  };
  // The second sensor answers each switch several times: a quarter of it is about one answer.
  for (const auto& [threshold, refractory_us, kept_share] :
       {Case{0.25, 500, 0.75}, Case{0.12, 30, 0.25}}) {
    const Observed observed = Watch({.disturbance = {.kept_share = kept_share},
                                     .refractory_us = refractory_us,
                                     .threshold = threshold});
    EXPECT_GE(observed.wands, 0.3 * observed.detections) << kept_share;
    EXPECT_GE(observed.counts.thinned, 0.8 * static_cast<double>(observed.counts.judged))
        << kept_share;
    EXPECT_LT(observed.counts.answered_percent, 90 * observed.counts.judged) << kept_share;
    EXPECT_LT(observed.nees, 2) << kept_share;
    EXPECT_GT(observed.sigma_px, 0.15) << kept_share;
  }
}

TEST(BlinkWandLosses, PixelsThatAreBlindForLongWidenTheCovariance) {
  for (const double refractory_us : {1000.0, 1200.0}) {
    const Observed observed =
        Watch({.refractory_us = refractory_us, .duration_us = 1'200'000, .from_us = 600'000});
    EXPECT_GE(observed.wands, 0.5 * observed.detections) << refractory_us;
    EXPECT_GE(observed.counts.thinned, 0.8 * static_cast<double>(observed.counts.judged))
        << refractory_us;
    EXPECT_LT(observed.nees, 2) << refractory_us;
  }
}

TEST(BlinkWandLosses, WhereTooFewEventsAreLeftForAWandTheShareIsTold) {
  for (const double share : {0.5, 0.25}) {
    const Observed observed =
        Watch({.disturbance = {.kept_share = share}, .duration_us = 1'200'000});
    EXPECT_EQ(observed.wands, 0) << share;
    ASSERT_GE(observed.counts.missed_looks, 3u) << share;
    const double answered = static_cast<double>(observed.counts.missed_answered_percent) /
                            static_cast<double>(observed.counts.missed_looks);
    EXPECT_NEAR(answered, 100 * share, 10);
  }
}

TEST(BlinkWandLosses, LampsNearTheFrequencyAreNoSecondWandAndTheBandIsNamed) {
  Setting setting{.lamps = 2, .lamp_hz = 480, .duration_us = 300'000};
  const Observed refused = Watch(setting);
  ASSERT_GT(refused.counts.by_outcome.Of(DetectionOutcome::kAmbiguous), 20u);
  ASSERT_GE(2 * refused.counts.banded, refused.counts.by_outcome.Of(DetectionOutcome::kAmbiguous));
  const double band_rel = 1e-4 * static_cast<double>(refused.counts.band_10000) /
                          static_cast<double>(refused.counts.banded);
  EXPECT_NEAR(band_rel, 0.02, 0.006);
  EXPECT_NEAR(
      static_cast<double>(refused.counts.other_hz) / static_cast<double>(refused.counts.banded),
      480, 5);
  // What is named does help.
  setting.band_rel = band_rel;
  const Observed found = Watch(setting);
  EXPECT_GE(found.wands, 0.95 * found.detections);
}

BlinkBlob LightOf(double hz) {
  BlinkBlob blob;
  blob.period_us = 1e6 / hz;
  return blob;
}

TEST(BlinkWandLosses, ABandIsNamedOnlyWhereItSeparates) {
  const std::vector<BlinkBlob> wand = {LightOf(500), LightOf(501), LightOf(499.5)};
  const auto beside = [&wand](std::vector<double> others_hz) {
    std::vector<BlinkBlob> blobs = wand;
    for (const double hz : others_hz) blobs.insert(blobs.begin(), LightOf(hz));
    return AdviseBand(blobs, 3, {500});
  };
  EXPECT_FALSE(beside({}).has_value());
  EXPECT_FALSE(beside({500, 500.5, 499}).has_value());  // another wand
  EXPECT_FALSE(beside({500.5, 480}).has_value());       // one of whose markers is seen, and a lamp
  EXPECT_FALSE(beside({495}).has_value());              // nearer than any band that is allowed
  const auto far = beside({440, 560});
  ASSERT_TRUE(far.has_value());
  EXPECT_NEAR(far->band_rel, 0.0545, 0.001);  // half way to 560 Hz
  EXPECT_FALSE(AdviseBand(wand, 4, {500}).has_value());
}

}  // namespace
}  // namespace rigcal::agent::blink_wand_losses_test

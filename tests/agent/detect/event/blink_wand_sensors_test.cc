// SPDX-License-Identifier: Apache-2.0
// The wand detector behind simulated sensors: several frequencies, LEDs that drift, two sensors on
// one clock.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <optional>
#include <string>
#include <vector>

#include "agent/detect/event/blink_wand_detector.h"
#include "agent/event/evt3_writer.h"
#include "common/simulation/events/event_renderer.h"
#include "tests/testing/status_matchers.h"

namespace rigcal::agent::blink_wand_sensors_test {
namespace {

using ::rigcal::testing::StatusIs;
using ::testing::AllOf;
using ::testing::HasSubstr;

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

// A wand that moves sideways, 1.6 m away and somewhat tilted.
WandPose WandAt(double time_s, double speed_m_s = 0.8) {
  return {{-0.25 + speed_m_s * time_s, 0.05, 1.6}, Eigen::Vector3d(1, 0.2, 0.3).normalized()};
}

struct Setting {
  std::string shown = "wand:0,0.2,0.4;diameter=0.04;hz=500";  // to the camera
  std::string asked;                                          // of the detector; empty: the same
  double drift_ppm = 0;
  double noise_hz = 2;
  uint32_t seed = 1;
  double rate_hz = 200;
  double duty = 0.5;
  double speed_m_s = 0.8;                           // 300 px/s
  int64_t duration_us = 120'000, from_us = 15'000;  // pixels need the first periods to be known
};

struct Observed {
  std::vector<Detection> detections;
  std::vector<double> errors_px;  // of all visible markers of wands
  double mean_ahead_px = 0;       // of theirs, along the motion
  BlinkWandCounts counts;
  int wands = 0, ambiguous = 0, without_wand = 0;
  double least_label_confidence = 1;
};

Observed Watch(const Setting& setting) {
  const CameraDescription camera = Camera();
  const Target shown = *ParseTarget(setting.shown);
  FrameRenderOptions scene;
  scene.blink_drift_ppm = setting.drift_ppm;
  scene.blink_duty = setting.duty;
  scene.seed = setting.seed;
  EventRenderOptions sensor;
  sensor.seed = setting.seed;
  sensor.background_hz = setting.noise_hz;
  sensor.bars = sensor.lamps = 0;
  auto renderer =
      *EventRenderer::Create(*camera.intrinsics, camera.image_size_px, shown, scene, sensor);
  std::vector<SimulatedEvent> events;
  std::vector<SimulatedTrigger> triggers;
  const auto path = [&setting](double time_s) { return WandAt(time_s, setting.speed_m_s); };
  EXPECT_TRUE(renderer.Render(setting.duration_us, path, &events, &triggers).ok());
  std::vector<CdEvent> cd_events;
  for (const SimulatedEvent& event : events) {
    cd_events.push_back({event.time_us, event.x, event.y, event.on});
  }
  std::vector<uint8_t> bytes;
  Evt3Writer().Write(cd_events, &bytes);
  BlinkWandDetectorOptions options;
  options.output.rate_hz = setting.rate_hz;
  auto detector = *BlinkWandDetector::Create(
      options, setting.asked.empty() ? shown : *ParseTarget(setting.asked), camera,
      EventFormat::kEvt3, false);
  Observed observed;
  detector.Take(bytes, &observed.detections);
  detector.Finish(&observed.detections);
  std::erase_if(observed.detections, [&setting](const Detection& detection) {
    return detection.observation.time_ns < 1000 * setting.from_us;
  });
  observed.counts = detector.counts();
  for (const Detection& detection : observed.detections) {
    observed.ambiguous += detection.outcome == DetectionOutcome::kAmbiguous ? 1 : 0;
    observed.without_wand += detection.outcome == DetectionOutcome::kNoWand ? 1 : 0;
    if (detection.outcome != DetectionOutcome::kWand) continue;
    ++observed.wands;
    const Observation& observation = detection.observation;
    for (size_t k = 0; k < observation.markers.size(); ++k) {
      const MarkerObservation& marker = observation.markers[k];
      observed.least_label_confidence =
          std::min(observed.least_label_confidence, static_cast<double>(marker.label_confidence));
      if (!marker.visible) continue;
      const double at_s = 1e-9 * static_cast<double>(observation.time_ns + marker.time_delta_ns);
      const Eigen::Vector2d error_px = marker.centre_px - renderer.TruthOf(path(at_s))[k].centre_px;
      observed.errors_px.push_back(error_px.norm());
      observed.mean_ahead_px += error_px.x();
    }
  }
  observed.mean_ahead_px /= static_cast<double>(observed.errors_px.size());
  return observed;
}

// The light is off for 400 us and on for 1600, or the other way round; pixels are in reset for 500.
TEST(BlinkWandSensors, AWandIsFoundByTheOneSwitchThatPixelsAnswer) {
  for (const double duty : {0.2, 0.8}) {
    Setting setting;
    setting.shown = "wand:0,0.13,0.39;diameter=0.04;hz=500";
    setting.duty = duty;
    setting.from_us = 400'000;
    setting.duration_us = 500'000;
    const Observed observed = Watch(setting);
    EXPECT_GE(observed.wands, 19) << duty;  // of 20
    EXPECT_EQ(observed.ambiguous, 0);
    for (const double error_px : observed.errors_px) EXPECT_LT(error_px, 0.6) << duty;
    if (duty == 0.8) {
      EXPECT_GE(observed.counts.by_fall, 20);
    }
  }
}

// Of one switch alone the pixels are behind the marker by up to 0.3 px, or ahead of it.
TEST(BlinkWandSensors, TheSwitchThatPixelsDoNotAnswerDoesNotMoveTheCentre) {
  for (const double duty : {0.2, 0.8}) {
    for (const double speed_m_s : {0.1, 0.2, 0.4, 0.8}) {
      Setting setting;
      setting.shown = "wand:0,0.13,0.39;diameter=0.04;hz=500";
      setting.duty = duty;
      setting.speed_m_s = speed_m_s;
      setting.from_us = 600'000;
      setting.duration_us = 750'000;
      const Observed observed = Watch(setting);
      EXPECT_GE(observed.wands, 29) << duty << " " << speed_m_s;  // of 30
      EXPECT_LT(std::abs(observed.mean_ahead_px), 0.06) << duty << " " << speed_m_s;
    }
  }
}

TEST(BlinkWandSensors, NoSwitchIsLeftOutWherePixelsAnswerBoth) {
  Setting setting;
  setting.duration_us = 500'000;
  const Observed observed = Watch(setting);
  EXPECT_GE(observed.wands, 95);  // of 97
  EXPECT_EQ(observed.counts.by_rise + observed.counts.by_fall, 0);
}

TEST(BlinkWandSensors, FrequenciesTellTheMarkersOfAnEvenWand) {
  Setting setting;
  setting.shown = "wand:0,0.2,0.4;diameter=0.04;hz=400,500,620";
  const Observed observed = Watch(setting);
  EXPECT_GE(observed.wands, 20);  // of 21
  EXPECT_EQ(observed.ambiguous, 0);
  EXPECT_GT(observed.least_label_confidence, 0.99);
  for (const double error_px : observed.errors_px) EXPECT_LT(error_px, 0.6);

  // Alike, either end may be the first.
  setting.shown = "wand:0,0.2,0.4;diameter=0.04;hz=500";
  EXPECT_LT(Watch(setting).least_label_confidence, 0.95);
}

TEST(BlinkWandSensors, AWandWithFrequenciesAtOtherPlacesIsAnother) {
  Setting setting;
  setting.asked = "wand:0,0.2,0.4;diameter=0.04;hz=400,500,620";
  for (const char* shown : {"400,620,500", "500,400,620", "500,500,620", "500"}) {
    setting.shown = std::string("wand:0,0.2,0.4;diameter=0.04;hz=") + shown;
    const Observed observed = Watch(setting);
    EXPECT_EQ(observed.wands, 0) << shown;
    EXPECT_GE(observed.without_wand, 20) << shown;
  }
}

TEST(BlinkWandSensors, EveryMarkerIsToldOncePerBurst) {
  Setting setting;
  setting.shown = "wand:0,0.13,0.39;diameter=0.04;hz=400,500,620";
  setting.rate_hz = 1000;
  const Observed observed = Watch(setting);
  EXPECT_GE(observed.wands, 28);  // 0.105 s; the slowest has 42 bursts
  EXPECT_LE(observed.wands, 42);
  const double periods_ns[] = {2.5e6, 2e6, 1e9 / 620};
  const Observation* before = nullptr;
  for (const Detection& detection : observed.detections) {
    if (detection.outcome != DetectionOutcome::kWand) continue;
    const Observation& now = detection.observation;
    for (size_t k = 0; before != nullptr && k < 3; ++k) {
      const auto since = static_cast<double>(now.time_ns + now.markers[k].time_delta_ns -
                                             before->time_ns - before->markers[k].time_delta_ns);
      EXPECT_GT(since, 0.9 * periods_ns[k]) << k;
    }
    before = &now;
  }
}

TEST(BlinkWandSensors, LedsMayDrift) {
  for (const double ppm : {-10'000.0, 200.0, 10'000.0}) {
    for (const char* hz : {"500", "400,500,620"}) {
      Setting setting;
      setting.shown = std::string("wand:0,0.13,0.39;diameter=0.04;hz=") + hz;
      setting.drift_ppm = ppm;
      const Observed observed = Watch(setting);
      EXPECT_GE(observed.wands, 20) << ppm << " " << hz;
      for (const double error_px : observed.errors_px) EXPECT_LT(error_px, 0.6) << ppm << " " << hz;
    }
  }
}

TEST(BlinkWandSensors, TwoSensorsOnOneClockTellTheSameBursts) {
  // A primary and a secondary: equal times, each with pixels and noise of its own.
  Setting setting;
  setting.shown = "wand:0,0.13,0.39;diameter=0.04;hz=500";
  const Observed primary = Watch(setting);
  setting.seed = 2;
  setting.noise_hz = 5;
  const Observed secondary = Watch(setting);
  ASSERT_EQ(primary.detections.size(), secondary.detections.size());
  int both = 0;
  for (size_t i = 0; i < primary.detections.size(); ++i) {
    const Detection &a = primary.detections[i], &b = secondary.detections[i];
    if (a.outcome != DetectionOutcome::kWand || b.outcome != DetectionOutcome::kWand) continue;
    ++both;
    EXPECT_NEAR(static_cast<double>(a.observation.time_ns - b.observation.time_ns), 0, 20'000);
  }
  EXPECT_GE(both, 20);
}

TEST(BlinkWandSensors, RefusesFrequenciesThatAreTooClose) {
  const auto create = [](const char* hz) {
    return BlinkWandDetector::Create({}, *ParseTarget(std::string("wand:0,0.2,0.4;hz=") + hz),
                                     Camera(), EventFormat::kEvt3, false)
        .status();
  };
  EXPECT_THAT(create("500,520,640"),
              StatusIs(absl::StatusCode::kInvalidArgument,
                       AllOf(HasSubstr("camera left"), HasSubstr("500 and 520 Hz are too close"))));
  EXPECT_THAT(create("300,400,620"), StatusIs(absl::StatusCode::kInvalidArgument,
                                              HasSubstr("300 and 620 Hz are too far apart")));
  EXPECT_TRUE(create("500,501,500").ok());
}

}  // namespace
}  // namespace rigcal::agent::blink_wand_sensors_test

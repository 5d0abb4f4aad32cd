// SPDX-License-Identifier: Apache-2.0
// The wand detector where not all of a wand is seen, and where two wands are.
#include <gtest/gtest.h>

#include <algorithm>
#include <functional>
#include <optional>
#include <vector>

#include "agent/detect/event/blink_wand_detector.h"
#include "agent/event/evt3_writer.h"
#include "common/simulation/events/event_renderer.h"

namespace rigcal::agent::blink_wand_partial_test {
namespace {

constexpr int64_t kEndUs = 160'000;
constexpr int64_t kWholeUntilUs = 80'000;
constexpr double kFoundPx = 1.5;

CameraDescription EventCamera() {
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

Target ThreeMarkers() { return *ParseTarget("wand:0,0.13,0.39;diameter=0.04;hz=500"); }

struct Scene {
  WandPath path;
  double led_phase = 0;
};

EventRenderer RendererOf(const Scene& scene, uint32_t seed) {
  const CameraDescription camera = EventCamera();
  EventRenderOptions sensor;
  sensor.seed = seed;
  sensor.background_hz = 1;
  sensor.bars = sensor.lamps = sensor.hot_pixels = 0;
  sensor.led_phase = scene.led_phase;
  return *EventRenderer::Create(*camera.intrinsics, camera.image_size_px, ThreeMarkers(), {},
                                sensor);
}

std::vector<CdEvent> Render(const Scene& scene, uint32_t seed = 1) {
  EventRenderer renderer = RendererOf(scene, seed);
  std::vector<SimulatedEvent> events;
  std::vector<SimulatedTrigger> triggers;
  EXPECT_TRUE(renderer.Render(kEndUs, scene.path, &events, &triggers).ok());
  std::vector<CdEvent> result;
  for (const SimulatedEvent& event : events) {
    result.push_back({event.time_us, event.x, event.y, event.on});
  }
  return result;
}

std::vector<Detection> Detect(const std::vector<CdEvent>& events, double rate_hz = 200) {
  std::vector<uint8_t> bytes;
  Evt3Writer().Write(events, &bytes);
  BlinkWandDetectorOptions options;
  options.output.rate_hz = rate_hz;
  auto detector =
      *BlinkWandDetector::Create(options, ThreeMarkers(), EventCamera(), EventFormat::kEvt3, false);
  std::vector<Detection> found;
  detector.Take(bytes, &found);
  detector.Finish(&found);
  std::erase_if(
      found, [](const Detection& detection) { return detection.observation.time_ns < 20'000'000; });
  return found;
}

// The largest distance of a marker from where it is; none: not one is visible.
std::optional<double> WorstPx(const Observation& seen, const Scene& scene) {
  static const EventRenderer renderer = RendererOf({}, 1);
  std::optional<double> worst;
  for (size_t k = 0; k < seen.markers.size(); ++k) {
    if (!seen.markers[k].visible) continue;
    const double at_s = 1e-9 * static_cast<double>(seen.time_ns + seen.markers[k].time_delta_ns);
    const Eigen::Vector2d there_px = renderer.TruthOf(*scene.path(at_s))[k].centre_px;
    worst = std::max(worst.value_or(0), (seen.markers[k].centre_px - there_px).norm());
  }
  return worst;
}

Scene Sideways() {
  return {[](double time_s) {
    return WandPose{{-0.25 + 0.8 * time_s, 0.05, 1.6}, Eigen::Vector3d(1, 0.2, 0.3).normalized()};
  }};
}

// From then on a marker cannot be seen.
std::vector<CdEvent> Hide(std::vector<CdEvent> events, const Scene& scene, size_t marker,
                          int64_t from_us) {
  const EventRenderer renderer = RendererOf(scene, 1);
  std::erase_if(events, [&](const CdEvent& event) {
    if (event.time_us < from_us) return false;
    const auto truth = renderer.TruthOf(*scene.path(1e-6 * static_cast<double>(event.time_us)));
    const double away_px = (Eigen::Vector2d(event.x, event.y) - truth[marker].centre_px).norm();
    return away_px < truth[marker].radius_px + 4;
  });
  return events;
}

TEST(BlinkWandPartial, OneSphereIsHidden) {
  const Scene scene = Sideways();
  const std::vector<CdEvent> events = Render(scene);
  for (size_t hidden = 0; hidden < 3; ++hidden) {
    int partial = 0;
    for (const Detection& detection : Detect(Hide(events, scene, hidden, kWholeUntilUs))) {
      if (detection.observation.time_ns < 1000 * kWholeUntilUs + 5'000'000) continue;
      ASSERT_EQ(detection.outcome, DetectionOutcome::kWand) << hidden;
      const Observation& seen = detection.observation;
      EXPECT_FALSE(seen.markers[hidden].visible);
      EXPECT_EQ(seen.VisibleCount(), 2);
      EXPECT_EQ(detection.occluded_markers, 1);
      EXPECT_LT(*WorstPx(seen, scene), kFoundPx) << hidden;
      ++partial;
    }
    EXPECT_GE(partial, 12) << hidden;
  }
}

TEST(BlinkWandPartial, TwoSpheresThatWereNeverSeenWithTheThirdAreNoWand) {
  const Scene scene = Sideways();
  for (const Detection& detection : Detect(Hide(Render(scene), scene, 2, 0))) {
    EXPECT_EQ(detection.outcome, DetectionOutcome::kNoWand);
  }
}

TEST(BlinkWandPartial, OneSphereLeavesTheImage) {
  // Marker 2 is at the right border after 80 ms and 50 px beyond it at the end.
  const Scene scene{[](double time_s) {
    return WandPose{{0.42 + 1.5 * time_s, 0.05, 1.6}, Eigen::Vector3d(0.9, 0.3, 0.2).normalized()};
  }};
  int whole = 0, partial = 0;
  for (const Detection& detection : Detect(Render(scene))) {
    ASSERT_EQ(detection.outcome, DetectionOutcome::kWand);
    const Observation& seen = detection.observation;
    EXPECT_LT(*WorstPx(seen, scene), kFoundPx);
    whole += seen.VisibleCount() == 3 ? 1 : 0;
    partial += seen.VisibleCount() == 2 && !seen.markers[2].visible ? 1 : 0;
  }
  EXPECT_GE(whole, 5);
  EXPECT_GE(partial, 10);
}

// Two spheres of a wand that was not seen whole yet, of which the third one can only be outside.
TEST(BlinkWandPartial, OneSphereComesIntoTheImage) {
  const Scene scene{[](double time_s) {
    return WandPose{{0.66 - 1.5 * time_s, 0.05, 1.6}, Eigen::Vector3d(0.9, 0.3, 0.2).normalized()};
  }};
  int whole = 0, partial = 0;
  for (const Detection& detection : Detect(Render(scene))) {
    ASSERT_EQ(detection.outcome, DetectionOutcome::kWand) << detection.observation.time_ns;
    const Observation& seen = detection.observation;
    EXPECT_LT(*WorstPx(seen, scene), kFoundPx);
    whole += seen.VisibleCount() == 3 ? 1 : 0;
    partial += seen.VisibleCount() == 2 && !seen.markers[2].visible ? 1 : 0;
  }
  EXPECT_GE(whole, 5);
  EXPECT_GE(partial, 10);
}

// Marker 2 moves along the right border, this far within it; its radius is 7.5 px.
Scene AlongBorder(double inside_px) {
  return {[inside_px](double time_s) {
    const double x_m = (639.5 - inside_px - 320) * 1.6 / 600;
    return WandPose{{x_m - 0.39, -0.1 + 0.8 * time_s, 1.6}, Eigen::Vector3d::UnitX()};
  }};
}

// Its rim reaches the border, as pixels answer up to two pixels outside a sphere.
TEST(BlinkWandPartial, ASphereRightBesideTheBorderIsWhole) {
  const Scene scene = AlongBorder(7.5 + 2);
  int detections = 0, whole = 0;
  for (const Detection& detection : Detect(Render(scene))) {
    ++detections;
    ASSERT_EQ(detection.outcome, DetectionOutcome::kWand);
    EXPECT_LT(*WorstPx(detection.observation, scene), 0.5);
    whole += detection.observation.VisibleCount() == 3 ? 1 : 0;
  }
  EXPECT_GE(detections, 25);
  EXPECT_GE(whole, detections - 2);
}

TEST(BlinkWandPartial, ASphereThatTheBorderCutsIsLeftOut) {
  const Scene scene = AlongBorder(7.5 - 1.5);
  int partial = 0;
  for (const Detection& detection : Detect(Render(scene))) {
    if (detection.outcome != DetectionOutcome::kWand) continue;
    EXPECT_FALSE(detection.observation.markers[2].visible);
    EXPECT_LT(*WorstPx(detection.observation, scene), 0.5);
    partial += detection.observation.VisibleCount() == 2 ? 1 : 0;
  }
  EXPECT_GE(partial, 25);
}

// Of two wands that can both be seen there is no way to say which one is meant.
TEST(BlinkWandPartial, TwoWandsAreRefusedAndNeverMixed) {
  const Scene first = Sideways();
  const Scene second{[](double time_s) {
                       return WandPose{{0.15 - 0.8 * time_s, -0.12 + 1.5 * time_s, 1.7},
                                       Eigen::Vector3d(-1, 0.25, 0.1).normalized()};
                     },
                     0.3};
  std::vector<CdEvent> events = Render(first);
  const std::vector<CdEvent> others = Render(second, 2);
  events.insert(events.end(), others.begin(), others.end());
  std::stable_sort(events.begin(), events.end(),
                   [](const CdEvent& a, const CdEvent& b) { return a.time_us < b.time_us; });
  int ambiguous = 0, detections = 0;
  for (const Detection& detection : Detect(events)) {
    ++detections;
    ambiguous += detection.outcome == DetectionOutcome::kAmbiguous ? 1 : 0;
    if (detection.outcome != DetectionOutcome::kWand) continue;
    const double nearest =
        std::min(*WorstPx(detection.observation, first), *WorstPx(detection.observation, second));
    EXPECT_LT(nearest, kFoundPx) << detection.observation.time_ns;
  }
  EXPECT_GE(detections, 25);
  EXPECT_GE(ambiguous, detections - 3);
}

// What is left of a wand is not given away while another one is in view.
TEST(BlinkWandPartial, AWandIsNotFollowedBesideAnother) {
  const Scene first = Sideways();
  const Scene second{[](double time_s) {
                       return WandPose{{-0.2 + 0.8 * time_s, -0.25, 1.7},
                                       Eigen::Vector3d(1, 0.1, 0.1).normalized()};
                     },
                     0.3};
  std::vector<CdEvent> events = Hide(Render(first), first, 1, kWholeUntilUs);
  // The other one comes when a sphere of the first can no longer be seen; one of its own is hidden.
  std::vector<CdEvent> others = Hide(Render(second, 2), second, 1, 0);
  std::erase_if(others, [](const CdEvent& event) { return event.time_us < kWholeUntilUs; });
  events.insert(events.end(), others.begin(), others.end());
  std::stable_sort(events.begin(), events.end(),
                   [](const CdEvent& a, const CdEvent& b) { return a.time_us < b.time_us; });
  int late = 0;
  for (const Detection& detection : Detect(events)) {
    if (detection.observation.time_ns < 1000 * kWholeUntilUs + 15'000'000) continue;
    EXPECT_NE(detection.outcome, DetectionOutcome::kWand);
    ++late;
  }
  EXPECT_GE(late, 10);
}

}  // namespace
}  // namespace rigcal::agent::blink_wand_partial_test

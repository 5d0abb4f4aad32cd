// SPDX-License-Identifier: Apache-2.0
// Events reach the filter in batches; detections due in the middle of one must be as if they
// came one by one.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <span>
#include <tuple>
#include <vector>

#include "agent/detect/event/blink_wand_detector.h"
#include "tests/testing/blinking_wand.h"
#include "tests/testing/status_matchers.h"

namespace rigcal::agent::blink_wand_chunks_test {
namespace {

using Summary = std::tuple<DetectionOutcome, int64_t, double, int>;
using Marker = std::tuple<bool, double, double, int64_t>;

struct Detected {
  std::vector<Summary> detections;
  std::vector<Marker> markers;
  uint64_t same_burst = 0;
};

absl::StatusOr<Detected> Feed(std::span<const uint8_t> bytes, size_t chunk_bytes) {
  CameraDescription camera;
  camera.camera = "left";
  camera.image_size_px = {640, 480};
  BlinkWandDetectorOptions options;
  options.output.rate_hz = 333;
  options.output.trigger = TriggerInstant::kMiddle;
  auto detector = BlinkWandDetector::Create(options, *ParseTarget("wand:0,0.13,0.39;hz=500"),
                                            camera, EventFormat::kEvt3, false);
  if (!detector.ok()) return detector.status();
  std::vector<Detection> found;
  while (!bytes.empty()) {
    const size_t size = std::min(bytes.size(), chunk_bytes);
    detector->Take(bytes.first(size), &found);
    bytes = bytes.subspan(size);
  }
  detector->Finish(&found);
  Detected detected;
  detected.same_burst = detector->counts().same_burst;
  for (const Detection& detection : found) {
    detected.detections.emplace_back(detection.outcome, detection.observation.time_ns,
                                     detection.confidence, detection.blob_count);
    for (const MarkerObservation& marker : detection.observation.markers) {
      detected.markers.emplace_back(marker.visible, marker.centre_px.x(), marker.centre_px.y(),
                                    marker.time_delta_ns);
    }
  }
  return detected;
}

TEST(BlinkWandChunks, DetectionsDoNotDependOnHowTheStreamIsCut) {
  testing::BlinkingWand wand;
  wand.duration_s = 0.12;
  wand.noise_per_s = 500'000;
  for (int64_t t = 10'003; t < 110'000; t += 7'000) {
    wand.triggers.push_back({.time_us = t, .channel = 0, .rising = true});
    wand.triggers.push_back({.time_us = t + 1'500, .channel = 0, .rising = false});
  }
  const std::vector<uint8_t> file = wand.RawFile();
  const size_t header = Evt3Header(wand.geometry, "1").size();
  const std::span<const uint8_t> bytes = std::span(file).subspan(header);

  ASSERT_OK_AND_ASSIGN(const Detected one_by_one, Feed(bytes, 2));
  EXPECT_GT(one_by_one.detections.size(), 40u);
  EXPECT_GT(
      std::count_if(one_by_one.detections.begin(), one_by_one.detections.end(),
                    [](const Summary& a) { return std::get<0>(a) == DetectionOutcome::kWand; }),
      30);
  for (const size_t chunk_bytes : {size_t{66}, size_t{4096}, size_t{65536}, bytes.size()}) {
    ASSERT_OK_AND_ASSIGN(const Detected detected, Feed(bytes, chunk_bytes));
    EXPECT_EQ(detected.detections, one_by_one.detections) << chunk_bytes;
    EXPECT_EQ(detected.markers, one_by_one.markers) << chunk_bytes;
    EXPECT_EQ(detected.same_burst, one_by_one.same_burst) << chunk_bytes;
  }
}

}  // namespace
}  // namespace rigcal::agent::blink_wand_chunks_test

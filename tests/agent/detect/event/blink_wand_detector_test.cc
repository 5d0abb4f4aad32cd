// SPDX-License-Identifier: Apache-2.0
// Streams that no camera sends; see event_observation_source_test.cc for wands.
#include "agent/detect/event/blink_wand_detector.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <random>
#include <span>
#include <string>
#include <vector>

#include "agent/event/evt3_writer.h"
#include "tests/testing/status_matchers.h"

namespace rigcal::agent::blink_wand_detector_test {
namespace {

using ::rigcal::testing::StatusIs;
using ::testing::AllOf;
using ::testing::HasSubstr;

CameraDescription Camera() {
  CameraDescription camera;
  camera.camera = "left";
  camera.image_size_px = {640, 480};
  return camera;
}

absl::StatusOr<BlinkWandDetector> Create(const BlinkWandDetectorOptions& options,
                                         EventFormat format = EventFormat::kEvt3) {
  return BlinkWandDetector::Create(options, *ParseTarget("wand:0,0.13,0.39;hz=500"), Camera(),
                                   format, false);
}

void ExpectTimesGrow(const std::vector<Detection>& found) {
  for (size_t i = 1; i < found.size(); ++i) {
    const Observation &before = found[i - 1].observation, &now = found[i].observation;
    ASSERT_GE(now.clock_epoch, before.clock_epoch);
    if (now.clock_epoch == before.clock_epoch) {
      ASSERT_GT(now.time_ns, before.time_ns);
    }
  }
}

class BlinkWandDetectorGarbage : public ::testing::TestWithParam<EventFormat> {};

TEST_P(BlinkWandDetectorGarbage, EndsAndKeepsTheOrderOfTimes) {
  std::mt19937 random(11);
  std::vector<uint8_t> bytes(size_t{96} << 10);
  for (uint8_t& byte : bytes) byte = static_cast<uint8_t>(random());
  BlinkWandDetectorOptions options;
  options.output.rate_hz = 1000;
  options.output.trigger = TriggerInstant::kMiddle;
  ASSERT_OK_AND_ASSIGN(BlinkWandDetector detector, Create(options, GetParam()));
  std::vector<Detection> found;
  for (size_t at = 0; at < bytes.size(); at += 4096) {
    detector.Take(std::span(bytes).subspan(at, 4096), &found);
  }
  detector.Finish(&found);
  EXPECT_LT(found.size(), bytes.size());
  ExpectTimesGrow(found);
  EXPECT_GT(detector.faults().unknown_words, 0u);
}

INSTANTIATE_TEST_SUITE_P(Formats, BlinkWandDetectorGarbage,
                         ::testing::Values(EventFormat::kEvt2, EventFormat::kEvt21,
                                           EventFormat::kEvt3));

TEST(BlinkWandDetector, ALongSilenceIsNotFilledWithAnswers) {
  std::vector<uint8_t> bytes;
  Evt3Writer writer;
  const std::vector<CdEvent> first = {{1'000'000, 10, 10, true}, {1'050'000, 10, 10, false}};
  const std::vector<CdEvent> second = {{9'000'000, 10, 10, true}, {9'050'000, 10, 10, false}};
  writer.Write(first, &bytes);
  writer.Write(TriggerEvent{.time_us = 1'050'000, .channel = 0, .rising = true}, &bytes);
  writer.Write(second, &bytes);
  BlinkWandDetectorOptions options;
  options.output = {.rate_hz = 100, .trigger = TriggerInstant::kRising};
  ASSERT_OK_AND_ASSIGN(BlinkWandDetector detector, Create(options));
  std::vector<Detection> found;
  detector.Take(bytes, &found);
  detector.Finish(&found);
  // Six before and six after, and what was asked when the silence began.
  EXPECT_GE(found.size(), 11u);
  EXPECT_LE(found.size(), 14u);
  ExpectTimesGrow(found);
  const auto asked = std::count_if(found.begin(), found.end(), [](const Detection& detection) {
    return detection.observation.time_ns == 1'050'000'000;
  });
  EXPECT_EQ(asked, 1);
  for (const Detection& detection : found) {
    EXPECT_EQ(detection.outcome, DetectionOutcome::kNoBlob);
    EXPECT_EQ(detection.observation.markers.size(), 3u);
  }
}

TEST(BlinkWandDetector, TimesBeyond31BitsBeginToo) {
  // EVT 2.0 has 34 bits of time.
  const int64_t first_us = 3'000'000'000;
  std::vector<uint8_t> bytes;
  const auto put = [&](uint32_t word) {
    for (int i = 0; i < 4; ++i) bytes.push_back(static_cast<uint8_t>(word >> (8 * i)));
  };
  for (int64_t t = first_us; t < first_us + 200'000; t += 64) {
    put(0x80000000u | static_cast<uint32_t>(t >> 6));
    put(0x10000000u | 5u << 11 | 7u);
  }
  ASSERT_OK_AND_ASSIGN(BlinkWandDetector detector, Create({}, EventFormat::kEvt2));
  std::vector<Detection> found;
  detector.Take(bytes, &found);
  detector.Finish(&found);
  ASSERT_NEAR(static_cast<double>(found.size()), 40, 1);
  EXPECT_EQ(found.front().observation.time_ns, first_us * 1000);
}

TEST(BlinkWandDetector, SaysEveryFaultOfItsOptions) {
  BlinkWandDetectorOptions options;
  options.output.rate_hz = 3;
  options.band_rel = 2;
  options.min_confidence = -1;
  EXPECT_THAT(Create(options), StatusIs(absl::StatusCode::kInvalidArgument,
                                        AllOf(HasSubstr("camera left"), HasSubstr("rate is 3"),
                                              HasSubstr("band"), HasSubstr("min_confidence"))));
}

}  // namespace
}  // namespace rigcal::agent::blink_wand_detector_test

// SPDX-License-Identifier: Apache-2.0
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fstream>
#include <string>

#include "tests/accuracy/detection/blink_frequency_experiment.h"
#include "tests/accuracy/detection/blink_frequency_plot.h"
#include "tests/testing/status_matchers.h"
#include "tests/testing/temporary_directory.h"

namespace rigcal::accuracy::blink_frequency_test {
namespace {

using ::testing::HasSubstr;
using ::testing::StartsWith;

// A small part of `rigcal-accuracy blink_frequency`: both ends and the wand's own frequency.
TEST(BlinkFrequency, FindsFiveHundredHertzButNotTwelveHundred) {
  BlinkFrequencyOptions options = PaperBlinkFrequency();
  EXPECT_LE(options.detection.sensor.refractory_us, 700);
  options.detection.streams = 2;
  options.detection.outputs = 4;
  options.detection.threads = 1;
  options.detection.sensor.bars = options.detection.sensor.lamps = 0;
  options.blink_hz = {500, 1200};
  const auto points = RunBlinkFrequency(options);
  ASSERT_EQ(points.size(), 2u);
  for (const BlinkFrequencyPoint& point : points) {
    EXPECT_EQ(point.summary.failures, 0);
    EXPECT_GT(point.summary.wands_shown, 2);
    EXPECT_EQ(point.summary.false_wands, 0);
  }
  EXPECT_EQ(points[0].WandRate(), 1);
  EXPECT_GT(points[0].TextbookRate(), 0.8);
  EXPECT_EQ(points[1].WandRate(), 0);
  EXPECT_EQ(points[1].TextbookRate(), 0);
}

BlinkFrequencyPoint Measured(double hz, int shown, int found) {
  BlinkFrequencyPoint point;
  point.blink_hz = hz;
  point.summary.wands_shown = shown;
  point.summary.wands_found = found;
  point.summary.shown = shown;
  point.summary.textbook_found = found / 2;
  return point;
}

TEST(BlinkFrequency, WritesOneLineForEachPoint) {
  const std::string csv =
      BlinkFrequencyCsv(PaperBlinkFrequency(), {Measured(500, 8, 6), Measured(900, 0, 0)});
  EXPECT_THAT(csv, StartsWith("blink_hz,refractory_us,"));
  EXPECT_THAT(csv, HasSubstr("\n500,700,0.10,50,8,0.7500,0,0.0000,8,0.3750,0\n"));
  EXPECT_THAT(csv, HasSubstr("\n900,700,0.10,50,0,nan,0,0.0000,0,nan,0\n"));
}

TEST(BlinkFrequency, DrawsPointsWithoutARateAndNamesAFileItCannotWrite) {
  const testing::TemporaryDirectory directory;
  const std::string path = directory.path() / "figure.png";
  const std::vector<BlinkFrequencyPoint> points = {Measured(500, 8, 6), Measured(900, 0, 0)};
  ASSERT_THAT(DrawBlinkFrequency(PaperBlinkFrequency(), points, path), testing::IsOk());
  std::ifstream file(path, std::ios::binary);
  std::string head(8, '\0');
  file.read(head.data(), 8);
  EXPECT_EQ(head, "\x89PNG\r\n\x1a\n");
  const std::string missing = directory.path() / "missing" / "figure.png";
  const absl::Status status = DrawBlinkFrequency(PaperBlinkFrequency(), points, missing);
  EXPECT_EQ(status.code(), absl::StatusCode::kUnavailable);
  EXPECT_THAT(std::string(status.message()), HasSubstr(missing));
}

}  // namespace
}  // namespace rigcal::accuracy::blink_frequency_test

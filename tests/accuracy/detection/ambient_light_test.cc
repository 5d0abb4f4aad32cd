// SPDX-License-Identifier: Apache-2.0
// A small part of `rigcal-accuracy ambient_light`.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <fstream>
#include <string>

#include "tests/accuracy/detection/ambient_light_experiment.h"
#include "tests/accuracy/detection/ambient_light_plot.h"
#include "tests/testing/status_matchers.h"
#include "tests/testing/temporary_directory.h"

namespace rigcal::accuracy::ambient_light_test {
namespace {

using ::testing::HasSubstr;
using ::testing::StartsWith;

AmbientLightOptions Some(int frames, double clutter, std::vector<double> lux) {
  AmbientLightOptions options = PaperAmbientLight();
  options.detection.frames_per_room = 5;
  options.frames = options.empty_frames = frames;
  options.cases = {{"reduced gain", clutter, true}};
  options.lux = std::move(lux);
  return options;
}

TEST(AmbientLight, FindsWandsInALitRoom) {
  for (const AmbientLightPoint& point : RunAmbientLight(Some(20, 0, {10, 1000}))) {
    EXPECT_GE(point.shown.shown, 18) << point.lux;
    EXPECT_EQ(point.shown.found, point.shown.shown) << point.lux;
    EXPECT_EQ(point.FalseWands(), 0) << point.lux;
  }
}

TEST(AmbientLight, LosesTheLedsColourInDaylight) {
  const auto points = RunAmbientLight(Some(10, 0, {200, 60000}));
  ASSERT_EQ(points.size(), 2u);
  EXPECT_GT(points[0].Rate(), 0.9);
  EXPECT_LT(points[1].Rate(), 0.1);
  EXPECT_EQ(points[1].FalseWands(), 0);
  // Hundreds of times the light on the shells, so the gain was reduced.
  EXPECT_LT(points[1].grey_per_cd_m2, 0.5 * points[0].grey_per_cd_m2);
}

TEST(AmbientLight, CountsEveryFrame) {
  const auto points = RunAmbientLight(Some(10, 0.5, {300}));
  ASSERT_EQ(points.size(), 1u);
  EXPECT_EQ(points[0].shown.frames, 10);
  EXPECT_EQ(points[0].empty.frames, 10);
  EXPECT_EQ(points[0].empty.shown, 0);
  EXPECT_EQ(points[0].shown.failures + points[0].empty.failures, 0);
}

AmbientLightPoint Measured(double lux, int shown, int found, int false_wands) {
  AmbientLightPoint point;
  point.setting = {"a room", 0.5, true};
  point.lux = lux;
  point.grey_per_cd_m2 = 0.25;
  point.shown.shown = point.shown.frames = shown;
  point.shown.found = found;
  point.shown.false_wands = false_wands;
  point.empty.false_wands = 1;
  point.empty.frames = 7;
  return point;
}

TEST(AmbientLight, WritesOneLineForEachPoint) {
  const std::string csv = AmbientLightCsv({Measured(10, 8, 6, 2), Measured(500, 0, 0, 0)});
  EXPECT_THAT(csv, StartsWith("case,clutter,auto_gain,lux,"));
  EXPECT_THAT(csv, HasSubstr("\n\"a room\",0.5,1,10.0,0.25000,8,6,0.7500,0.0000,7,3,0\n"));
  EXPECT_THAT(csv, HasSubstr("\n\"a room\",0.5,1,500.0,0.25000,0,0,nan,0.0000,7,1,0\n"));
}

TEST(AmbientLight, DrawsPointsWithoutARate) {
  const testing::TemporaryDirectory directory;
  const std::string path = directory.path() / "figure.png";
  ASSERT_THAT(DrawAmbientLight({Measured(10, 8, 8, 0), Measured(100, 0, 0, 0)}, path),
              testing::IsOk());
  std::ifstream file(path, std::ios::binary);
  std::string head(8, '\0');
  file.read(head.data(), 8);
  EXPECT_EQ(head, "\x89PNG\r\n\x1a\n");
}

TEST(AmbientLight, NamesTheFigureItCannotWrite) {
  const testing::TemporaryDirectory directory;
  const std::string path = directory.path() / "missing" / "figure.png";
  const absl::Status status = DrawAmbientLight({Measured(10, 8, 8, 0)}, path);
  EXPECT_EQ(status.code(), absl::StatusCode::kUnavailable);
  EXPECT_THAT(std::string(status.message()), HasSubstr(path));
}

}  // namespace
}  // namespace rigcal::accuracy::ambient_light_test

// SPDX-License-Identifier: Apache-2.0
#include "agent/command/detection_report.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>
#include <string>

namespace rigcal::agent::detection_report_test {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::Not;

DetectionReport SomeReport() {
  DetectionReport report;
  report.frames = {.received = 12, .damaged = 3, .lost = 1};
  report.detections.Add(DetectionOutcome::kWand, 6);
  report.detections.Add(DetectionOutcome::kNoBlob, 2);
  report.learning = 4;
  report.tracked = 5;
  report.refused = {
      {.camera = "", .reason = RefusalReason::kFrameUnreadable, .count = 3, .example = "a\xff"}};
  for (const double ms : {1.0, 2.0, 3.0, 10.0}) report.detecting.Add(ms * 1e-3);
  report.wall_s = 2;
  return report;
}

TEST(Durations, AreZeroWithoutAny) {
  const Durations none;
  EXPECT_EQ(none.MeanMs(), 0);
  EXPECT_EQ(none.QuantileMs(0.5), 0);
}

TEST(Durations, AreInMilliseconds) {
  const DetectionReport report = SomeReport();
  EXPECT_NEAR(report.detecting.MeanMs(), 4, 1e-9);
  EXPECT_NEAR(report.detecting.QuantileMs(1), 10, 1e-9);
  EXPECT_NEAR(report.detecting.QuantileMs(0), 1, 1e-9);
}

TEST(DetectionReport, CountsWhatWasLookedAt) {
  EXPECT_EQ(SomeReport().looked_at(), 8u);
  EXPECT_EQ(SomeReport().detection_rate(), 0.75);
  EXPECT_EQ(SomeReport().frames_per_s(), 6);
  EXPECT_EQ(DetectionReport{}.detection_rate(), 0);
}

TEST(FormatReport, NamesWhatThereIs) {
  EXPECT_THAT(FormatReport(SomeReport()),
              AllOf(HasSubstr("75.00 %"), HasSubstr("no blob"), HasSubstr("frame_unreadable x 3"),
                    HasSubstr("mask only"), Not(HasSubstr("saturated"))));
}

TEST(FormatReport, SaysWhatFillsThePictureAndWhatToDo) {
  DetectionReport report = SomeReport();
  EXPECT_THAT(FormatReport(report), Not(HasSubstr("colour test")));
  report.passed_share = 0.38;
  report.white_share = 0.3;
  EXPECT_THAT(FormatReport(report),
              AllOf(HasSubstr("38 % of the picture passes the colour test, 30 % are white"),
                    HasSubstr("windows"), HasSubstr("what stands still is ignored"), HasSubstr("exposure")));
  report.white_share = 0;
  report.cut_short = 2;
  EXPECT_THAT(FormatReport(report), AllOf(HasSubstr("of the wand's colour"), HasSubstr("tune"),
                                          HasSubstr("search cut short")));
}

TEST(ReportJson, IsAContract) {
  const nlohmann::json json = nlohmann::json::parse(ReportJson(SomeReport()));
  EXPECT_EQ(json["pictures"], 8);
  EXPECT_EQ(json["damaged"], 3);
  EXPECT_EQ(json["lost"], 1);
  EXPECT_EQ(json["learning"], 4);
  EXPECT_EQ(json["outcomes"]["wand"], 6);
  EXPECT_EQ(json["outcomes"]["too_many_blobs"], 0);
  EXPECT_EQ(json["detection_rate"], 0.75);
  EXPECT_EQ(json["tracked"], 5);
  EXPECT_EQ(json["refused"][0]["reason"], "frame_unreadable");
  EXPECT_NEAR(json["detecting_ms"]["mean"].get<double>(), 4, 1e-9);
  EXPECT_EQ(json["pictures_per_s"], 6);
  EXPECT_EQ(json["cut_short"], 0);
  EXPECT_EQ(json["passed_share"], 0);
  EXPECT_EQ(json["white_share"], 0);
}

}  // namespace
}  // namespace rigcal::agent::detection_report_test

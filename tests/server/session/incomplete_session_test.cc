// SPDX-License-Identifier: Apache-2.0
#include "server/session/incomplete_session.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "tests/server/store/store_fixture.h"

namespace rigcal::testing::incomplete_session_test {
namespace {

using server::RowShare;
using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::SizeIs;

StreamStatus Stream(uint32_t durable_seq, std::optional<uint32_t> last_seq,
                    uint32_t reported_seq = 0) {
  StreamStatus status;
  status.stream_epoch = 1;
  status.durable_seq = durable_seq;
  status.last_seq = last_seq;
  status.reported_seq = reported_seq;
  return status;
}

server::StoredBatch Rows(uint32_t first_seq, uint32_t last_seq) {
  server::StoredBatch stored;
  stored.batch = MakeBatch(KeyOf("left"), first_seq, last_seq);
  return stored;
}

// 100 detected; `read` of them were read.
RowShare Share(const std::string& camera, uint32_t read) {
  SessionCameraCounts counts;
  counts.streams = {Stream(read, 100, 100)};
  counts.streams[0].durable_seq = 100;
  RowShare share("wave", camera, &counts);
  if (read > 0) share.Add(Rows(1, read));
  return share;
}

// Its stream has no end.
RowShare OpenShare(const std::string& camera, uint32_t read, uint32_t reported_seq) {
  SessionCameraCounts counts;
  counts.streams = {Stream(read, std::nullopt, reported_seq)};
  RowShare share("wave", camera, &counts);
  share.Add(Rows(1, read));
  return share;
}

CalibrationResult GoodResult() {
  CalibrationResult result;
  for (const char* camera : {"left", "right"}) result.cameras.emplace_back().camera = camera;
  result.quality = {QualityGrade::kGood, {"every error is small"}};
  return result;
}

CalibrationResult Noted(const std::vector<RowShare>& shares, CalibrationOptions options = {},
                        CalibrationResult result = GoodResult()) {
  server::NoteIncompleteSessions(shares, options, &result);
  return result;
}

TEST(IncompleteSession, AWholeSessionIsNotMentioned) {
  const CalibrationResult result = Noted({Share("left", 100), Share("right", 100)});
  EXPECT_THAT(result.findings, IsEmpty());
  EXPECT_EQ(result.quality.grade, QualityGrade::kGood);
}

TEST(IncompleteSession, CapsTheGradeByTheShareThatIsMissing) {
  const std::tuple<uint32_t, FindingSeverity, QualityGrade> cases[] = {
      {99, FindingSeverity::kInfo, QualityGrade::kGood},
      {90, FindingSeverity::kInfo, QualityGrade::kGood},
      {89, FindingSeverity::kWarning, QualityGrade::kUsable},
      {60, FindingSeverity::kWarning, QualityGrade::kUsable},
      {59, FindingSeverity::kError, QualityGrade::kBad},
      {1, FindingSeverity::kError, QualityGrade::kBad}};
  for (const auto& [read, severity, grade] : cases) {
    SCOPED_TRACE(read);
    const CalibrationResult result = Noted({Share("left", read), Share("right", 100)});
    ASSERT_THAT(result.findings, SizeIs(1));
    const Finding& finding = result.findings[0];
    EXPECT_EQ(finding.kind, FindingKind::kIncompleteSession);
    EXPECT_EQ(finding.camera, "left");
    EXPECT_NEAR(finding.value, 100 - read, 1e-9);
    EXPECT_EQ(finding.unit, "%");
    EXPECT_EQ(finding.severity, severity);
    EXPECT_EQ(result.quality.grade, grade);
    if (grade == QualityGrade::kGood) continue;
    EXPECT_THAT(result.quality.reasons, ElementsAre(HasSubstr("camera left: ")));
  }
}

TEST(IncompleteSession, SaysWhatIsMissingAndWhy) {
  RowShare share = Share("left", 50);
  server::StoredBatch damaged = Rows(51, 51);
  damaged.batch = {};
  damaged.batch.stream = KeyOf("left");
  damaged.batch.first_seq = 51;
  damaged.damaged_rows = 20;
  share.Add(damaged);
  server::StoredBatch late = Rows(71, 80);
  late.late = true;
  share.Add(late);
  const CalibrationResult result = Noted({share});
  ASSERT_THAT(result.findings, SizeIs(1));
  EXPECT_THAT(result.findings[0].advice,
              AllOf(HasSubstr("50 of its 100 observations"), HasSubstr("20 are damaged"),
                    HasSubstr("10 came after the session had finished"),
                    HasSubstr("20 were dropped or not delivered"),
                    HasSubstr("rigcal session verify wave")));
}

TEST(IncompleteSession, AStreamWithoutAnEndIsUsableAtMost) {
  CalibrationResult result = Noted({OpenShare("left", 100, 100), Share("right", 100)});
  ASSERT_THAT(result.findings, SizeIs(1));
  EXPECT_EQ(result.findings[0].severity, FindingSeverity::kWarning);
  EXPECT_EQ(result.quality.grade, QualityGrade::kUsable);
  EXPECT_THAT(result.quality.reasons, ElementsAre(HasSubstr("nothing tells where its stream ended")));
  // It has ended, but its agent does not know where.
  SessionCameraCounts counts;
  counts.streams = {Stream(100, 100, 100)};
  counts.streams[0].durable_seq = 100;
  counts.streams[0].end_is_unknown = true;
  RowShare unknown("wave", "left", &counts);
  unknown.Add(Rows(1, 100));
  EXPECT_EQ(Noted({unknown, Share("right", 100)}).quality.grade, QualityGrade::kUsable);
  // The other camera went on for longer, whatever the agent had said.
  result = Noted({OpenShare("left", 30, 30), Share("right", 100)});
  EXPECT_EQ(result.findings[0].severity, FindingSeverity::kError);
  EXPECT_EQ(result.quality.grade, QualityGrade::kBad);
  EXPECT_NEAR(result.findings[0].value, 70, 2);
  EXPECT_THAT(result.quality.reasons, ElementsAre(HasSubstr("at least")));
  // The agent had told of more.
  result = Noted({OpenShare("left", 50, 200), OpenShare("right", 50, 50)});
  EXPECT_NEAR(result.findings[0].value, 75, 1e-9);
}

TEST(IncompleteSession, AWorseGradeStaysWithItsReasons) {
  CalibrationResult bad = GoodResult();
  bad.quality = {QualityGrade::kBad, {"everything is wrong"}};
  bad = Noted({Share("left", 80)}, {}, bad);
  EXPECT_EQ(bad.quality.grade, QualityGrade::kBad);
  EXPECT_THAT(bad.quality.reasons, ElementsAre("everything is wrong"));
  CalibrationResult usable = GoodResult();
  usable.quality = {QualityGrade::kUsable, {"a weak link"}};
  usable = Noted({Share("left", 80)}, {}, usable);
  EXPECT_THAT(usable.quality.reasons, ElementsAre("a weak link", HasSubstr("camera left")));
}

TEST(IncompleteSession, WhatIsLeftOutOnPurposeIsNotMissing) {
  CalibrationOptions options;
  options.without_cameras = {"left"};
  EXPECT_THAT(Noted({Share("left", 10), Share("right", 100)}, options).findings, IsEmpty());
  options.without_cameras.clear();
  options.without_sessions = {"wave"};
  EXPECT_THAT(Noted({Share("left", 10)}, options).findings, IsEmpty());
  // Where nothing is solved it is for information.
  options = {};
  options.kind = SolveKind::kOrigin;
  const CalibrationResult result = Noted({Share("left", 10)}, options);
  ASSERT_THAT(result.findings, SizeIs(1));
  EXPECT_EQ(result.findings[0].severity, FindingSeverity::kInfo);
  EXPECT_EQ(result.quality.grade, QualityGrade::kGood);
}

TEST(IncompleteSession, AddsUpTheSessionsOfACamera) {
  SessionCameraCounts counts;
  counts.streams = {Stream(300, 300)};
  RowShare whole("before", "left", &counts);
  whole.Add(Rows(1, 300));
  const CalibrationResult result = Noted({whole, Share("left", 80)});
  ASSERT_THAT(result.findings, SizeIs(1));
  EXPECT_NEAR(result.findings[0].value, 5, 1e-9);
  EXPECT_EQ(result.findings[0].advice.find("verify before"), std::string::npos);
}

}  // namespace
}  // namespace rigcal::testing::incomplete_session_test

// SPDX-License-Identifier: Apache-2.0
#include "common/target/target_file.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <string>

#include "absl/strings/str_cat.h"
#include "tests/testing/status_matchers.h"
#include "tests/testing/temporary_directory.h"

namespace rigcal::target_file_test {
namespace {

using ::rigcal::testing::StatusIs;
using ::rigcal::testing::TemporaryDirectory;
using ::testing::AllOf;
using ::testing::HasSubstr;

constexpr char kGood[] =
    "# frame with five balls\n"
    "A 0 0 0 0.0002\r\n"
    "\n"
    "B,0.3,0,0.01,0  # exact\n"
    "C 0.3 0.2 0\n"
    "D, 0, 0.2, 0.1\n";

class TargetFile : public ::testing::Test {
 protected:
  std::string Write(const std::string& text) { return folder_.WriteFile("target.txt", text); }
  // Of `--target rigid:FILE`.
  absl::StatusOr<Target> Parse(const std::string& text) {
    return ParseTarget("rigid:" + Write(text));
  }
  TemporaryDirectory folder_;
};

TEST_F(TargetFile, ReadsPointsInTheOrderOfTheirLines) {
  ASSERT_OK_AND_ASSIGN(const Target target, Parse(kGood));
  EXPECT_EQ(target.kind, TargetKind::kRigid);
  ASSERT_EQ(target.marker_count(), 4);
  EXPECT_EQ(target.points[0], (TargetPoint{"A", 0, 0, 0, 0.0002}));
  EXPECT_EQ(target.points[1], (TargetPoint{"B", 0.3, 0, 0.01, 0}));
  EXPECT_EQ(target.points[2], (TargetPoint{"C", 0.3, 0.2, 0, kDefaultPointSigmaM}));
  EXPECT_TRUE(target.marker_positions_m.empty());
}

TEST_F(TargetFile, TakesOptionsAndIsReadBackFromItsText) {
  ASSERT_OK_AND_ASSIGN(const Target target,
                       ParseTarget(absl::StrCat("rigid:", Write(kGood), ";diameter=0.016")));
  EXPECT_EQ(target.diameter_m, 0.016);
  ASSERT_OK_AND_ASSIGN(const Target again, ParseTarget(FormatTarget(target)));
  EXPECT_EQ(again, target);
}

TEST_F(TargetFile, StaticPointsAreLabelsAlone) {
  ASSERT_OK_AND_ASSIGN(const Target target,
                       ParseTarget("static:" + Write("door # by the window\nshelf\n")));
  EXPECT_TRUE(target.IsStatic());
  EXPECT_FALSE(target.is_surveyed);
  EXPECT_FALSE(target.HasLengths());
  ASSERT_EQ(target.marker_count(), 2);
  EXPECT_EQ(target.points[1], (TargetPoint{"shelf", 0, 0, 0, 0}));
  EXPECT_EQ(FormatTarget(target), "static:{door|shelf}");
  ASSERT_OK_AND_ASSIGN(const Target again, ParseTarget(FormatTarget(target)));
  EXPECT_EQ(again, target);
}

TEST_F(TargetFile, OrTheyAreSurveyed) {
  ASSERT_OK_AND_ASSIGN(const Target target, ParseTarget("static:" + Write(kGood)));
  EXPECT_TRUE(target.is_surveyed);
  EXPECT_TRUE(target.HasLengths());
  EXPECT_EQ(target.points[1], (TargetPoint{"B", 0.3, 0, 0.01, 0}));
  ASSERT_OK_AND_ASSIGN(const Target again, ParseTarget(FormatTarget(target)));
  EXPECT_EQ(again, target);
}

TEST_F(TargetFile, RefusesHalfASurvey) {
  const struct {
    const char* text;
    const char* why;
  } cases[] = {
      {"A 0 0 0\nB\n", "1 of 2 static points have a position"},
      {"A\nA\n", "label A is in line 1 too"},
      {"A 0 0\n", "or a label alone"},
      {"A 0 0 0\nB 1 0 0\nC 0 1 0\n", "4 to 200 points, not 3"},
      {"A 0 0 0\nB 1 0 0\nC 2 0 0\nD 3 0 0\n", "on one line"},
      {"", "static points are 1 to 200 points, not 0"},
  };
  for (const auto& [text, why] : cases) {
    EXPECT_THAT(ParseTarget("static:" + Write(text)),
                StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr(why)))
        << text;
  }
  EXPECT_THAT(ParseTarget("rigid:" + Write("A\nB\n")),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("4 or 5 are needed")));
}

TEST_F(TargetFile, NamesFileAndLineOfAFault) {
  const struct {
    const char* line;
    const char* why;
  } kFaults[] = {
      {"E 0.1 0.2", "3 values, 4 or 5"},
      {"E 0.1 0.2 0.3 0.001 7", "6 values"},
      {"E 0.1 0.2 abc", "\"abc\""},
      {"E 0.1 0.2 nan", "not a finite number"},
      {"E 100 0.2 0.1", "points are in metres"},
      {"E 0.1 0.2 0.1 -0.001", "sigma"},
      {"A 0.1 0.2 0.1", "label A is in line 2 too"},
      {"E| 0.1 0.2 0.1", "a label is"},
  };
  for (const auto& fault : kFaults) {
    EXPECT_THAT(Parse(absl::StrCat(kGood, fault.line, "\n")),
                StatusIs(absl::StatusCode::kInvalidArgument,
                         AllOf(HasSubstr("target.txt, line 7: "), HasSubstr(fault.why))))
        << fault.line;
  }
  std::string many;
  for (int i = 0; i < 201; ++i) absl::StrAppend(&many, "p", i, " ", 0.01 * i, " ", i % 2, " 0\n");
  EXPECT_THAT(Parse(many), StatusIs(absl::StatusCode::kInvalidArgument,
                                    AllOf(HasSubstr("line 201"), HasSubstr("at most 200"))));
}

TEST_F(TargetFile, RefusesWhatHasNoPose) {
  EXPECT_THAT(Parse("A 0 0 0\nB 1 0 0\nC 0 1 0\n"),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("4 to 200 points, not 3")));
  EXPECT_THAT(Parse("A 0 0 0\nB 0.1 0.1 0\nC 0.2 0.2 0\nD 0.39 0.39 0.001\n"),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("on one line")));
  EXPECT_THAT(Parse("A 0 0 0\nB 1 0 0\nC 0 1 0\nD 1 0 0\n"),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("B and D are at the same")));
  EXPECT_THAT(Parse(""), StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("not 0")));
}

TEST_F(TargetFile, RefusesWhatIsNoFile) {
  EXPECT_THAT(ParseTarget("rigid:"), StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("")));
  EXPECT_THAT(ParseTarget("rigid:/nowhere/board.txt"),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("/nowhere/board.txt")));
  EXPECT_THAT(ParseTarget("rigid:" + folder_.path().string()),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("regular file")));
}

}  // namespace
}  // namespace rigcal::target_file_test

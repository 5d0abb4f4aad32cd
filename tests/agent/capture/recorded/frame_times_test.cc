// SPDX-License-Identifier: Apache-2.0
#include "agent/capture/recorded/frame_times.h"

#include <algorithm>
#include <string>
#include <vector>

#include "tests/testing/status_matchers.h"
#include "tests/testing/temporary_directory.h"

namespace rigcal::agent::frame_times_test {
namespace {

using ::rigcal::testing::IsOk;
using ::rigcal::testing::StatusIs;
using ::rigcal::testing::TemporaryDirectory;
using ::testing::ElementsAre;
using ::testing::Eq;
using ::testing::HasSubstr;
using ::testing::Optional;

TEST(NaturallyBefore, CountsAsPeopleDo) {
  std::vector<std::string> names = {"f10.png",
                                    "f9.png",
                                    "f010.png",
                                    "f1.png",
                                    "e99.png",
                                    "f1a.png",
                                    "f.png",
                                    "f00000000000000000000009.png",
                                    "f123456789012345678901234567890.png"};
  std::sort(names.begin(), names.end(), NaturallyBefore);
  EXPECT_THAT(names,
              ElementsAre("e99.png", "f.png", "f1.png", "f1a.png", "f00000000000000000000009.png",
                          "f9.png", "f010.png", "f10.png", "f123456789012345678901234567890.png"));
}

TEST(NaturallyBefore, IsAStrictOrder) {
  const std::vector<std::string> names = {"", "1", "01", "a", "a1", "a01", "a1b", "1a", "01a"};
  for (const std::string& a : names) {
    EXPECT_FALSE(NaturallyBefore(a, a)) << a;
    for (const std::string& b : names) {
      if (a == b) continue;
      EXPECT_NE(NaturallyBefore(a, b), NaturallyBefore(b, a)) << a << " " << b;
    }
  }
}

TEST(TimeFromName, TakesTheLastLongNumber) {
  EXPECT_THAT(TimeFromName("frame_000123_1699999999123456789.png"), Optional(1699999999123456789));
  EXPECT_THAT(TimeFromName("0000000040000000.png"), Optional(40000000));
  EXPECT_THAT(TimeFromName("1699999999123456789_000123.jpg"), Optional(1699999999123456789));
  EXPECT_THAT(TimeFromName("1000000000_2000000000.png"), Optional(2000000000));
  EXPECT_THAT(TimeFromName("000123.png"), Eq(std::nullopt)) << "counts frames";
  EXPECT_THAT(TimeFromName("left.png"), Eq(std::nullopt));
  EXPECT_THAT(TimeFromName("99999999999999999999.png"), Eq(std::nullopt)) << "beyond 64 bits";
}

class ReadImageTimesTest : public ::testing::Test {
 protected:
  absl::StatusOr<FrameTimes> Read(const std::string& text) {
    return ReadImageTimes(directory_.WriteFile("timestamps.csv", text).string());
  }
  TemporaryDirectory directory_;
};

TEST_F(ReadImageTimesTest, ReadsNamesWithAHeading) {
  ASSERT_OK_AND_ASSIGN(const FrameTimes times,
                       Read("name;timestamp_ns\r\na.png;100\r\n\n# nothing\n b;c.png ; 200 \n"));
  EXPECT_EQ(times.by_name.size(), 2u);
  EXPECT_EQ(times.by_name.at("a.png"), 100);
  EXPECT_EQ(times.by_name.at("b;c.png"), 200);
  EXPECT_TRUE(times.refused.empty());
}

TEST_F(ReadImageTimesTest, KeepsThePlaceOfALineItCannotRead) {
  ASSERT_OK_AND_ASSIGN(const FrameTimes times, Read("12x\n200\n\nmany\n400\n"));
  EXPECT_THAT(times.by_number, ElementsAre(std::nullopt, 200, std::nullopt, 400));
  const std::vector<Refusal> refused = times.refused.List();
  ASSERT_EQ(refused.size(), 1u);
  EXPECT_EQ(refused[0].reason, RefusalReason::kTimestampBadLine);
  EXPECT_EQ(refused[0].count, 2u);
  EXPECT_THAT(refused[0].example, HasSubstr("timestamps.csv:1"));
}

TEST_F(ReadImageTimesTest, CountsANameThatIsThereAgain) {
  ASSERT_OK_AND_ASSIGN(const FrameTimes times, Read("a.png;1\na.png;2\n"));
  EXPECT_EQ(times.by_name.at("a.png"), 1);
  EXPECT_EQ(times.refused.List().at(0).reason, RefusalReason::kTimestampDuplicate);
}

TEST_F(ReadImageTimesTest, NamesAMissingFile) {
  EXPECT_THAT(ReadImageTimes("/nowhere/t.csv"),
              StatusIs(absl::StatusCode::kNotFound, HasSubstr("/nowhere/t.csv")));
}

TEST(MedianStepNs, IsRobust) {
  EXPECT_EQ(MedianStepNs({}), 0);
  EXPECT_EQ(MedianStepNs({5}), 0);
  EXPECT_EQ(MedianStepNs({0, 40, 80, 1000000, 1000040, 1000080}), 40);
  EXPECT_EQ(MedianStepNs({INT64_MIN, INT64_MAX, INT64_MIN}), 1) << "no overflow";
}

}  // namespace
}  // namespace rigcal::agent::frame_times_test

// SPDX-License-Identifier: Apache-2.0
#include "common/target/csv_layout.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "common/target/csv_line.h"
#include "tests/testing/status_matchers.h"
#include "tests/testing/temporary_directory.h"

namespace rigcal::csv_layout_test {
namespace {

using ::rigcal::testing::StatusIs;
using ::rigcal::testing::TemporaryDirectory;
using ::testing::AllOf;
using ::testing::HasSubstr;

// The rows of a file, read by the layout that was found for it.
std::vector<Observation> Read(const std::vector<std::string>& lines) {
  const absl::StatusOr<CsvLayout> layout = FindCsvLayout(lines);
  std::vector<Observation> rows;
  if (!layout.ok()) return rows;
  for (size_t i = layout->has_header ? 1 : 0; i < lines.size(); ++i) {
    Observation row;
    if (!ParseCsvLine(lines[i], *layout, 0.5, &row)) rows.push_back(row);
  }
  return rows;
}

TEST(FindCsvLayout, ReadsTheTablesOfOtherPrograms) {
  const std::vector<std::string> files[] = {
      {"5000000000;1;2;3;4", "5040000000;1;2;3;4"},
      {"5000000000,1,2,3,4", "5040000000,1,2,3,4"},
      {"5000000000\t1\t2\t3\t4", "5040000000\t1\t2\t3\t4\r"},
      {"5000000000;1;2;3;4;", "5040000000;1;2;3;4;"},
      {"timestamp_ns,x0,y0,x1,y1", "5000000000,1,2,3,4", "5040000000,1,2,3,4"},
      {"time_s;x0;y0;x1;y1", "5.0;1;2;3;4", "5.04;1;2;3;4"},
      {"t (ms)\tleft_x\tleft_y\tright_x\tright_y", "5000\t1\t2\t3\t4", "5040\t1\t2\t3\t4"},
      {"frame,time_us,x0,y0,likelihood0,x1,y1,likelihood1", "7,5000000,1,2,0.9,3,4,0.8",
       "8,5040000,1,2,0.9,3,4,0.8"},
      {"\"timestamp\",\"m0.x\",\"m0.y\",\"m1.x\",\"m1.y\"", "5000000000,1,2,3,4",
       "5040000000,1,2,3,4"}};
  for (const std::vector<std::string>& lines : files) {
    const std::vector<Observation> rows = Read(lines);
    ASSERT_EQ(rows.size(), 2u) << lines.front();
    EXPECT_EQ(rows[0].time_ns, 5'000'000'000) << lines.front();
    EXPECT_EQ(rows[1].time_ns, 5'040'000'000) << lines.front();
    ASSERT_EQ(rows[1].markers.size(), 2u) << lines.front();
    EXPECT_EQ(rows[1].markers[1].centre_px, Eigen::Vector2d(3, 4)) << lines.front();
  }
}

TEST(FindCsvLayout, ADamagedLineIsNoHeaderAndNoLayout) {
  EXPECT_EQ(Read({"\xff\x00garbage", "5;1;2", "6;1;2"}).size(), 2u);
  EXPECT_EQ(Read({"5;1;2;3", "6;1;2", "7;1;2", "8,1,2"}).size(), 2u);
}

TEST(FindCsvLayout, SaysWhatAHeaderLacks) {
  EXPECT_THAT(
      FindCsvLayout({"when,x0,y0", "5,1,2"}),
      StatusIs(absl::StatusCode::kInvalidArgument, AllOf(HasSubstr("no time"), HasSubstr("when"))));
  EXPECT_THAT(FindCsvLayout({"time,x0,q0", "5,1,2"}),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("1 columns of x and 0 of y")));
  const TemporaryDirectory directory;
  const auto path = directory.WriteFile("a.csv", "\xef\xbb\xbftime,x0,q0\n5,1,2\n");
  EXPECT_THAT(FindCsvLayoutOfFile(path.string()),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("a.csv")));
}

}  // namespace
}  // namespace rigcal::csv_layout_test

// SPDX-License-Identifier: Apache-2.0
#include "common/target/csv_plausible.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/strings/str_replace.h"
#include "tests/testing/status_matchers.h"
#include "tests/testing/temporary_directory.h"

namespace rigcal::csv_plausible_test {
namespace {

using ::rigcal::testing::StatusIs;
using ::rigcal::testing::TemporaryDirectory;
using ::testing::AllOf;
using ::testing::HasSubstr;

// A waved wand of three markers: `format` takes the time and x0 y0 x1 y1 x2 y2.
template <typename Format>
std::vector<std::string> Wave(const Format& format) {
  std::vector<std::string> lines;
  for (int i = 0; i < 60; ++i) {
    const double t = 0.1 * i, x = 640 + 200 * std::sin(t), y = 400 + 150 * std::cos(1.3 * t);
    const double along_x = 90 * std::cos(t), along_y = 90 * std::sin(t);
    lines.push_back(format(5'000'000'000 + 20'000'000LL * i, x, y, x + along_x / 3, y + along_y / 3,
                           x + along_x, y + along_y));
  }
  return lines;
}

std::string Usual(int64_t time_ns, double x0, double y0, double x1, double y1, double x2,
                  double y2) {
  return absl::StrFormat("%d;%.2f;%.2f;%.2f;%.2f;%.2f;%.2f", time_ns, x0, y0, x1, y1, x2, y2);
}

std::string AllXFirst(int64_t time_ns, double x0, double y0, double x1, double y1, double x2,
                      double y2) {
  return Usual(time_ns, x0, x1, x2, y0, y1, y2);
}

std::string Faults(const std::vector<std::string>& lines) {
  const auto layout = FindCsvLayout(lines);
  return layout.ok() ? ImplausibleColumns(*layout, lines) : std::string(layout.status().message());
}

TEST(ImplausibleColumns, AWaveIsPlausible) {
  EXPECT_EQ(Faults(Wave(Usual)), "");
  EXPECT_EQ(Faults({"5000000000;1;2;3;4", "5040000000;1;2;3;4"}), "") << "too few say nothing";
}

TEST(ImplausibleColumns, NamesDecimalCommasBetweenCommas) {
  std::vector<std::string> lines = Wave(Usual);
  for (std::string& line : lines) line = absl::StrReplaceAll(line, {{";", ","}, {".", ","}});
  EXPECT_THAT(Faults(lines), AllOf(HasSubstr("13 cells"), HasSubstr("decimals with a point")));
  lines.insert(lines.begin(), "timestamp_ns,x0,y0,x1,y1,x2,y2");
  EXPECT_THAT(Faults(lines), AllOf(HasSubstr("names 7 columns, and rows have 13"),
                                   HasSubstr("decimals with a point")));
}

TEST(ImplausibleColumns, NamesAllXBeforeAllY) {
  std::vector<std::string> lines = Wave(AllXFirst);
  EXPECT_THAT(Faults(lines), HasSubstr("timestamp_ns;x0;x1;x2;y0;y1;y2"));
  lines.insert(lines.begin(), "timestamp_ns;x0;x1;x2;y0;y1;y2");
  EXPECT_EQ(Faults(lines), "") << "a header says it";
}

TEST(ImplausibleColumns, NamesAColumnThatNeverChanges) {
  const std::vector<std::string> lines =
      Wave([](int64_t time_ns, double x0, double y0, double x1, double y1, double, double) {
        return absl::StrFormat("%d;%.2f;%.2f;1.0;%.2f;%.2f;1.0", time_ns, x0, y0, x1, y1);
      });
  EXPECT_THAT(Faults(lines), AllOf(HasSubstr("column 4 is 1.0"), HasSubstr("likelihood")));
}

TEST(FindCsvLayoutOfFile, NamesTheFileThatIsImplausibleOrUtf16) {
  const TemporaryDirectory directory;
  std::string text, wide = "\xff\xfe";
  for (const std::string& line : Wave(AllXFirst)) absl::StrAppend(&text, line, "\n");
  EXPECT_THAT(FindCsvLayoutOfFile(directory.WriteFile("a.csv", text).string()),
              StatusIs(absl::StatusCode::kInvalidArgument,
                       AllOf(HasSubstr("a.csv"), HasSubstr("x0;x1;x2"))));
  for (const char c : text) wide.append({c, '\0'});
  for (const std::string& utf16 : {wide, wide.substr(2)}) {
    EXPECT_THAT(FindCsvLayoutOfFile(directory.WriteFile("b.csv", utf16).string()),
                StatusIs(absl::StatusCode::kInvalidArgument,
                         AllOf(HasSubstr("b.csv"), HasSubstr("UTF-16"), HasSubstr("UTF-8"))));
  }
}

}  // namespace
}  // namespace rigcal::csv_plausible_test

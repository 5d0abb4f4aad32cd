// SPDX-License-Identifier: Apache-2.0
// Recordings as people really have them, through `rigcal local`: tables of other programs, stamps
// that were set, doubled or written in another way, cameras that are apart.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <functional>
#include <string>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "absl/strings/str_split.h"
#include "tests/testing/process.h"
#include "tests/testing/recorded_rig.h"
#include "tests/testing/temporary_directory.h"

namespace rigcal::testing::recordings_test {
namespace {

using ::testing::AllOf;
using ::testing::ContainsRegex;
using ::testing::HasSubstr;
using ::testing::Not;

using Rows = std::vector<std::vector<std::string>>;

class Recordings : public ::testing::Test {
 protected:
  Recordings() {
    SimulationOptions options;
    options.camera_count = 4;
    options.outlier_share = 0;
    options.duration_s = 20;
    WriteRecordedRig(options, folder());
    for (const auto& entry : std::filesystem::directory_iterator(folder())) {
      if (entry.path().extension() == ".csv") cameras_.push_back(entry.path().stem().string());
    }
    std::ranges::sort(cameras_);
  }

  std::filesystem::path folder() const { return directory_.path() / "rig"; }
  std::filesystem::path FileOf(size_t camera) const {
    return folder() / (cameras_.at(camera) + ".csv");
  }
  Rows Read(size_t camera) const {
    std::ifstream file(FileOf(camera));
    Rows rows;
    for (std::string line; std::getline(file, line);) rows.push_back(absl::StrSplit(line, ';'));
    return rows;
  }
  void Write(size_t camera, const Rows& rows, const std::string& separator = ";",
             const std::string& header = "") const {
    std::ofstream file(FileOf(camera));
    file << header;
    for (const std::vector<std::string>& row : rows) file << absl::StrJoin(row, separator) << "\n";
  }
  void Change(size_t camera, const std::function<void(Rows*)>& change) const {
    Rows rows = Read(camera);
    change(&rows);
    Write(camera, rows);
  }
  static void AddSeconds(double seconds, std::vector<std::string>* row) {
    const auto time_ns = std::stoll(row->front()) + static_cast<long long>(1e9 * seconds);
    row->front() = std::to_string(time_ns);
  }
  CommandResult Calibrate(const std::string& target = "wand:0,0.13,0.39") const {
    return RunCommand({"rigcal", "local", "--data", folder().string(), "--target", target});
  }

  TemporaryDirectory directory_;
  std::vector<std::string> cameras_;
};

TEST_F(Recordings, TablesOfOtherProgramsAreRead) {
  Write(0, Read(0), ",");
  Write(1, Read(1), "\t", "timestamp_ns\tx0\ty0\tx1\ty1\tx2\ty2\n");
  Change(2, [](Rows* rows) {
    for (std::vector<std::string>& row : *rows) {
      for (std::string& cell : row) {
        if (cell == "-1") cell = "NaN";
      }
      row.push_back("");
    }
  });
  const CommandResult result = Calibrate();
  EXPECT_EQ(result.exit_code, 0) << result.output << result.error;
  EXPECT_THAT(result.output, AllOf(HasSubstr("Quality: good"), Not(HasSubstr("Left out"))));
  EXPECT_THAT(result.output, ContainsRegex("expected error +[0-9.]+ mm \\+ [0-9.]+ % of every"));
}

TEST_F(Recordings, AThirdMarkerThatIsNeverSeenLeavesTwo) {
  Change(2, [](Rows* rows) {
    for (std::vector<std::string>& row : *rows) row[5] = row[6] = "nan";
  });
  const CommandResult result = Calibrate();
  EXPECT_EQ(result.exit_code, 0) << result.output << result.error;
  EXPECT_THAT(result.output, Not(HasSubstr("never saw")));
}

TEST_F(Recordings, DecimalSecondsAreNamed) {
  for (size_t camera = 0; camera < 4; ++camera) {
    Change(camera, [](Rows* rows) {
      for (std::vector<std::string>& row : *rows) {
        char text[32];
        std::snprintf(text, sizeof(text), "%.4f", 1e-9 * std::stod(row.front()) + 1);
        row.front() = text;
      }
    });
  }
  const CommandResult result = Calibrate();
  EXPECT_EQ(result.exit_code, 1);
  EXPECT_THAT(result.error, AllOf(HasSubstr("cannot be read"), HasSubstr("seconds"),
                                  HasSubstr(".csv:"), Not(HasSubstr("never saw"))));
}

TEST_F(Recordings, TablesThatCannotBeMarkersAreNamed) {
  Change(0, [](Rows* rows) {  // all x, then all y
    for (auto& row : *rows) row = {row[0], row[1], row[3], row[5], row[2], row[4], row[6]};
  });
  Change(1, [](Rows* rows) {  // a likelihood of each marker, without a header
    for (auto& row : *rows) row = {row[0], row[1], row[2], "0.99", row[3], row[4], "0.99"};
  });
  Rows commas = Read(2);
  for (auto& row : commas) {
    for (size_t i = 1; i < row.size(); ++i) {
      if (row[i] == "-1") row[i] = "-1.00";
      std::ranges::replace(row[i], '.', ',');
    }
  }
  Write(2, commas, ",");
  std::string wide = "\xff\xfe";
  for (const auto& row : Read(3)) {
    for (const char c : absl::StrJoin(row, ";") + "\n") wide.append({c, '\0'});
  }
  std::ofstream(FileOf(3), std::ios::binary) << wide;
  const CommandResult result = Calibrate();
  EXPECT_EQ(result.exit_code, 1);
  EXPECT_THAT(result.error, AllOf(HasSubstr("timestamp_ns;x0;x1;x2;y0;y1;y2"),
                                  HasSubstr("column 4 is 0.99"), HasSubstr("decimals with a point"),
                                  HasSubstr("UTF-16"), Not(HasSubstr("never saw"))));
  for (const std::string& camera : cameras_) EXPECT_THAT(result.error, HasSubstr(camera + ".csv"));
}

TEST_F(Recordings, EndingsInCapitalsAreRead) {
  std::filesystem::rename(FileOf(1), folder() / (cameras_.at(1) + ".CSV"));
  const CommandResult result = Calibrate();
  EXPECT_EQ(result.exit_code, 0) << result.output << result.error;
  EXPECT_THAT(result.output, HasSubstr(cameras_.at(1)));
}

TEST_F(Recordings, WrongStampsCostTheirRowsAndAReversedFileNone) {
  Change(1, [](Rows* rows) {
    for (size_t i = 100; i < rows->size(); i += 100) AddSeconds(-3, &(*rows)[i]);
  });
  Change(2, [](Rows* rows) { std::ranges::reverse(*rows); });
  const CommandResult result = Calibrate();
  EXPECT_EQ(result.exit_code, 0) << result.output << result.error;
  EXPECT_THAT(result.output, AllOf(HasSubstr("Quality: good"), HasSubstr("rows_out_of_order"),
                                   ContainsRegex("clock_epoch_without_offset +[1-5] ")));
}

TEST_F(Recordings, AClockThatIsSetIsFollowed) {
  Change(2, [](Rows* rows) {
    for (size_t i = rows->size() / 2; i < rows->size(); ++i) AddSeconds(3600, &(*rows)[i]);
  });
  const CommandResult result = Calibrate();
  EXPECT_EQ(result.exit_code, 0) << result.output << result.error;
  EXPECT_THAT(result.output, AllOf(HasSubstr("Quality: good"), ContainsRegex("clock_steps.*3600"),
                                   Not(HasSubstr("views_not_used"))));
}

TEST_F(Recordings, ALostHalfIsNeverGood) {
  // In steps of 64 ms two rows of three share a stamp.
  Change(1, [](Rows* rows) {
    for (std::vector<std::string>& row : *rows) {
      row.front() = std::to_string(std::stoll(row.front()) / 64'000'000 * 64'000'000);
    }
  });
  const CommandResult result = Calibrate();
  EXPECT_THAT(result.output,
              AllOf(HasSubstr("Quality: bad"), ContainsRegex("stamps_repeat +warning"),
                    ContainsRegex("views_not_used +error"), HasSubstr("duplicate_conflict")));
  EXPECT_EQ(result.exit_code, 3);
}

TEST_F(Recordings, CamerasThatAreApartAreNamedWithThePairToWaveFor) {
  for (size_t camera = 0; camera < 4; ++camera) {
    Change(camera, [&](Rows* rows) {
      const auto half = static_cast<std::ptrdiff_t>(rows->size() / 2);
      if (camera == 3) {
        rows->erase(rows->begin(), rows->begin() + half + 20);
      } else {
        rows->erase(rows->begin() + half, rows->end());
      }
    });
  }
  const CommandResult result = Calibrate();
  EXPECT_EQ(result.exit_code, 1) << result.output;
  EXPECT_THAT(result.error, AllOf(HasSubstr("not connected"), HasSubstr(cameras_[3]),
                                  Not(HasSubstr("inconsistent"))));
}

TEST_F(Recordings, AnotherResolutionAndSharesOfTheImageAreNamed) {
  const auto scale = [](double factor) {
    return [factor](Rows* rows) {
      for (std::vector<std::string>& row : *rows) {
        for (size_t i = 1; i < row.size(); ++i) {
          if (row[i] != "-1") row[i] = absl::StrCat(factor * std::stod(row[i]));
        }
      }
    };
  };
  Change(0, scale(2));
  CommandResult result = Calibrate();
  EXPECT_EQ(result.exit_code, 1);
  EXPECT_THAT(result.error, AllOf(HasSubstr("camera " + cameras_[0]), HasSubstr("outside")));
  Change(0, scale(0.5 / 2000));
  result = Calibrate();
  EXPECT_THAT(result.error, AllOf(HasSubstr("from 0 to"), HasSubstr("give pixels")));
}

TEST_F(Recordings, AWandOfOtherSpansIsNamed) {
  const CommandResult result = Calibrate("wand:0,0.2,0.4");
  EXPECT_THAT(absl::StrCat(result.output, result.error),
              ::testing::AnyOf(HasSubstr("the target says 1 : 1"),
                               ContainsRegex("wrong_wand_length +warning")));
  EXPECT_THAT(result.output, Not(HasSubstr("Quality: good")));
}

}  // namespace
}  // namespace rigcal::testing::recordings_test

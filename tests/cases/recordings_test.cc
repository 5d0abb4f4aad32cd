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
#include <utility>
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
    options_.camera_count = 4;
    options_.outlier_share = 0;
    options_.duration_s = 20;
    WriteRecordedRig(options_, folder());
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

  SimulationOptions options_;
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

TEST_F(Recordings, AClockThatIsSetForwardByASecondIsFollowed) {
  Change(2, [](Rows* rows) {
    for (size_t i = rows->size() / 2; i < rows->size(); ++i) AddSeconds(1, &(*rows)[i]);
  });
  const CommandResult result = Calibrate();
  EXPECT_EQ(result.exit_code, 0) << result.output << result.error;
  EXPECT_THAT(result.output,
              AllOf(HasSubstr("Quality: good"), ContainsRegex("clock_steps.*set once, by \\+1 s"),
                    Not(HasSubstr("views_not_used"))));
}

TEST_F(Recordings, AFileThatWasAppendedToItselfIsUsedOnce) {
  const CommandResult once = Calibrate();
  Change(1, [](Rows* rows) {
    const Rows again = *rows;
    rows->insert(rows->end(), again.begin(), again.end());
  });
  const CommandResult result = Calibrate();
  EXPECT_EQ(result.exit_code, 0) << result.output << result.error;
  EXPECT_THAT(result.output,
              AllOf(HasSubstr("Quality: good"), ContainsRegex("rows_repeated.*a second time"),
                    HasSubstr("duplicate_equal"), Not(HasSubstr("clock_steps")),
                    Not(HasSubstr("clock_offset"))));
  // The same as if it had been written once.
  const auto headline = [](const std::string& output) {
    const size_t at = output.find("expected error");
    return output.substr(at, output.find('\n', at) - at);
  };
  EXPECT_EQ(headline(result.output), headline(once.output));
}

TEST_F(Recordings, OneCamerasFileUnderAnothersNameIsNamed) {
  Write(2, Read(1));
  const CommandResult result = Calibrate();
  EXPECT_THAT(result.exit_code, ::testing::AnyOf(1, 3)) << result.output;
  EXPECT_THAT(result.output, Not(HasSubstr("Quality: good")));
  EXPECT_THAT(absl::StrCat(result.output, result.error),
              HasSubstr(absl::StrCat("it has the same rows as ", cameras_[1])));
}

TEST_F(Recordings, ZerosForMarkersThatWereNotSeenAreTakenAsThat) {
  Change(2, [](Rows* rows) {
    for (size_t i = 0; i < rows->size(); i += 4) {
      for (size_t column = 1; column < 7; ++column) (*rows)[i][column] = "0";
    }
  });
  const CommandResult result = Calibrate();
  EXPECT_EQ(result.exit_code, 0) << result.output << result.error;
  EXPECT_THAT(result.output,
              AllOf(HasSubstr("Quality: good"), ContainsRegex("markers_at_origin +info")));
}

TEST_F(Recordings, AColumnThatNeverChangesIsNamed) {
  Change(2, [](Rows* rows) {
    for (std::vector<std::string>& row : *rows) {
      if (row[3] != "-1") row[3] = "512.5";
    }
  });
  const CommandResult result = Calibrate();
  EXPECT_EQ(result.exit_code, 1) << result.output;
  EXPECT_THAT(result.error, AllOf(HasSubstr("camera " + cameras_[2]),
                                  HasSubstr("x of its marker 1"), HasSubstr("512.5")));
}

TEST_F(Recordings, ExchangedMarkersAreNamed) {
  Change(2, [](Rows* rows) {
    for (std::vector<std::string>& row : *rows) {
      std::swap(row[1], row[3]);
      std::swap(row[2], row[4]);
    }
  });
  const CommandResult result = Calibrate();
  EXPECT_THAT(absl::StrCat(result.output, result.error),
              HasSubstr(absl::StrCat("camera ", cameras_[2], " shows the markers in the order")));
}

TEST_F(Recordings, AWrongFrameRateIsNamed) {
  Change(2, [](Rows* rows) {
    for (std::vector<std::string>& row : *rows) {
      row.front() = std::to_string(std::stoll(row.front()) / 5 * 6);
    }
  });
  const CommandResult result = Calibrate();
  EXPECT_THAT(absl::StrCat(result.output, result.error), HasSubstr("a wrong frame rate"));
}

TEST_F(Recordings, ACameraThatIsPushedIsNamedAlsoWhereItIsPutBack) {
  for (const size_t parts : {2, 3}) {
    WriteRecordedRig(options_, folder());
    // From the middle on, or in the middle third.
    Change(2, [&](Rows* rows) {
      const size_t end = parts == 2 ? rows->size() : 2 * rows->size() / 3;
      for (size_t i = rows->size() / parts; i < end; ++i) {
        for (const size_t column : {1, 3, 5}) {
          std::string& x = (*rows)[i][column];
          if (x != "-1") x = absl::StrCat(std::stod(x) + 6);
        }
      }
    });
    const CommandResult result = Calibrate();
    EXPECT_EQ(result.exit_code, 3) << result.output << result.error;
    EXPECT_THAT(result.output, ContainsRegex("camera_moved +error +" + cameras_[2])) << parts;
    if (parts == 3) {
      EXPECT_THAT(result.output, HasSubstr("and back"));
    }
  }
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
  EXPECT_EQ(result.exit_code, 0) << result.output << result.error;
  EXPECT_THAT(result.output, AllOf(HasSubstr("Quality: usable"), HasSubstr("only 3 of 4 cameras"),
                                   ContainsRegex("weak_link +warning +" + cameras_[3]),
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

// SPDX-License-Identifier: Apache-2.0
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <CLI/CLI.hpp>
#include <cmath>
#include <fstream>
#include <iterator>
#include <map>
#include <sstream>
#include <string>
#include <vector>

#include "agent/command/subcommands.h"
#include "agent/event/event_decoder.h"
#include "agent/event_files/event_file_info.h"
#include "tests/testing/status_matchers.h"
#include "tests/testing/temporary_directory.h"
#include "tests/testing/word_by_word_decoders.h"

namespace rigcal::agent::simulate_command_test {
namespace {

using ::rigcal::testing::IsOk;
using ::rigcal::testing::StatusIs;
using ::testing::HasSubstr;

absl::Status RunSimulate(const std::vector<std::string>& arguments) {
  CLI::App app;
  std::ostringstream out;
  Subcommands subcommands(out);
  subcommands.AddTo(app);
  std::vector<std::string> reversed(arguments.rbegin(), arguments.rend());
  reversed.push_back("simulate");
  app.parse(std::move(reversed));
  return subcommands.Chosen()();
}

std::string ContentsOf(const std::string& path) {
  std::ifstream stream(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(stream), std::istreambuf_iterator<char>()};
}

// time_ns and the coordinates of each row.
std::map<int64_t, std::vector<double>> ReadTruth(const std::string& path) {
  std::map<int64_t, std::vector<double>> rows;
  std::istringstream lines(ContentsOf(path));
  for (std::string line; std::getline(lines, line);) {
    std::istringstream cells(line);
    std::string cell;
    std::getline(cells, cell, ';');
    std::vector<double>& row = rows[std::stoll(cell)];
    while (std::getline(cells, cell, ';')) row.push_back(std::stod(cell));
  }
  return rows;
}

struct NearTruth {
  const std::map<int64_t, std::vector<double>>& truth;
  int near = 0, far = 0;
  void Event(uint32_t x, uint32_t y, bool, uint32_t time_us) {
    const auto row = truth.lower_bound(1000 * static_cast<int64_t>(time_us) - 500'000);
    if (row == truth.end()) return;
    bool found = false;
    for (size_t k = 0; k + 1 < row->second.size(); k += 2) {
      found |= std::hypot(x - row->second[k], y - row->second[k + 1]) < 40;
    }
    ++(found ? near : far);
  }
  void Vector(uint32_t x, uint32_t y, bool on, uint32_t time_us, uint32_t mask) {
    for (; mask != 0; mask >>= 1, ++x) {
      if ((mask & 1) != 0) Event(x, y, on, time_us);
    }
  }
  void Trigger(const TriggerEvent&) {}
  void TimeStepBack(int64_t) { ADD_FAILURE() << "time stepped back"; }
};

TEST(SimulateCommand, WritesARawFileAndWhereTheMarkersAre) {
  const testing::TemporaryDirectory folder;
  const std::string raw = (folder.path() / "left.raw").string();
  ASSERT_THAT(RunSimulate({"sim:camera=1;cameras=4;events=1;duration=0.2;background=0;leak=0;"
                           "hot_pixels=0;bars=0;lamps=0",
                           "--output", raw, "--truth-rate", "1000"}),
              IsOk());
  ASSERT_OK_AND_ASSIGN(const EventFileInfo info, ReadEventFileInfo(raw, std::nullopt, {}));
  EXPECT_EQ(info.faults, EventFaults{});
  const auto truth = ReadTruth((folder.path() / "left.csv").string());
  ASSERT_GE(truth.size(), 195u);
  for (const auto& [time_ns, row] : truth) {
    EXPECT_EQ(time_ns % 1'000'000, 0);
    EXPECT_EQ(row.size(), 6u);
  }
  const std::string bytes = ContentsOf(raw);
  const size_t begin = bytes.find("% end\n") + 6;
  Evt3Decoder decoder({1280, 720});
  NearTruth sink{truth};
  decoder.Decode({reinterpret_cast<const uint8_t*>(bytes.data()) + begin, bytes.size() - begin},
                 sink);
  EXPECT_GT(sink.near, 1000);
  EXPECT_EQ(sink.far, 0);
  const auto read = testing::DecodeEvt3ByThrees(
      {reinterpret_cast<const uint8_t*>(bytes.data()) + begin, bytes.size() - begin});
  EXPECT_EQ(read.fault, "");
  EXPECT_EQ(read.events.size(), info.cd_events + info.trigger_events);
  EXPECT_THAT(ContentsOf((folder.path() / "left.yaml").string()), HasSubstr("camera_matrix"));
}

TEST(SimulateCommand, RefusesWhatItCannotWrite) {
  const testing::TemporaryDirectory folder;
  const std::string raw = (folder.path() / "left.raw").string();
  EXPECT_THAT(
      RunSimulate({"sim:camera=1;cameras=4", "--output", raw}),
      StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("not a simulated event camera")));
  EXPECT_THAT(RunSimulate({"sim:camera=1;cameras=4;events=1", "--output", raw + ".h5"}),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr(".raw")));
  EXPECT_FALSE(RunSimulate({"sim:camera=1;cameras=4;events=1;duration=0.1", "--output",
                            (folder.path() / "no" / "left.raw").string()})
                   .ok());
}

}  // namespace
}  // namespace rigcal::agent::simulate_command_test

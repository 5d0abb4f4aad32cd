// SPDX-License-Identifier: Apache-2.0
#include "agent/event_files/event_file_info.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>
#include <sstream>
#include <string>
#include <vector>

#include "agent/command/subcommands.h"
#include "agent/event/evt3_writer.h"
#include "tests/testing/blinking_wand.h"
#include "tests/testing/recorded_data.h"
#include "tests/testing/status_matchers.h"
#include "tests/testing/temporary_directory.h"

namespace rigcal::agent::event_file_info_test {
namespace {

using ::rigcal::testing::StatusIs;
using ::testing::AllOf;
using ::testing::HasSubstr;

struct Ran {
  absl::Status status;
  std::string text;
};

Ran RunInfo(std::vector<std::string> arguments) {
  std::ostringstream out;
  CLI::App app;
  Subcommands subcommands(out);
  subcommands.AddTo(app);
  std::reverse(arguments.begin(), arguments.end());
  arguments.emplace_back("info");
  try {
    app.parse(arguments);
  } catch (const CLI::ParseError& error) {
    return {absl::InvalidArgumentError(error.what()), out.str()};
  }
  const absl::Status status = subcommands.Chosen()();
  return {status, out.str()};
}

// Events at 20 000 a second as CSV, each time in a unit of so many seconds.
std::string CsvEvents(const std::string& header, double unit_s, double step_s = 5e-5) {
  std::ostringstream text;
  text << header << "\n" << std::fixed;
  text.precision(unit_s < 1e-8 ? 0 : 6);
  for (int i = 0; i < 4000; ++i) {
    const double time_s = std::floor(i * 5e-5 / step_s) * step_s;
    text << i % 600 << "," << i % 400 << "," << i % 2 << "," << time_s / unit_s + 1 << "\n";
  }
  return text.str();
}

TEST(EventFileInfo, NotesTimesThatCannotBeInTheirUnit) {
  const rigcal::testing::TemporaryDirectory folder;
  const auto notes = [&](const std::string& text, std::vector<std::string> more = {}) {
    std::vector<std::string> arguments = {folder.WriteFile("e.csv", text).string(), "-o", "json"};
    arguments.insert(arguments.end(), more.begin(), more.end());
    const Ran ran = RunInfo(arguments);
    EXPECT_TRUE(ran.status.ok()) << ran.status;
    return nlohmann::json::parse(ran.text)["notes"].dump();
  };
  EXPECT_EQ(notes(CsvEvents("x,y,p,t_us", 1e-6)), "[]");
  EXPECT_EQ(notes(CsvEvents("x,y,p,t_s", 1)), "[]");
  EXPECT_EQ(notes(CsvEvents("x,y,p,t_ms", 1e-3)), "[]");
  EXPECT_THAT(
      notes(CsvEvents("x,y,p,t_s", 1e-6)),
      AllOf(HasSubstr("4000 events over 2.3 days cannot be seconds"), HasSubstr("use time=us")));
  EXPECT_EQ(notes(CsvEvents("x,y,p,t_s", 1e-6), {"--time", "us"}), "[]");
  EXPECT_THAT(notes(CsvEvents("x,y,p,t_s", 1e-3)), HasSubstr("use time=ms"));
  EXPECT_THAT(notes(CsvEvents("x,y,p,t_us", 1e-9)), HasSubstr("use time=ns"));
  EXPECT_THAT(notes(CsvEvents("x,y,p,t_s", 1, 0.02)), HasSubstr("32-bit floats"));
  EXPECT_THAT(notes(CsvEvents("x,y,p,t_s", 1, 128)), HasSubstr("have one time"));
}

TEST(EventFileInfo, TakesPolaritiesOfBytes) {
  const rigcal::testing::TemporaryDirectory folder;
  std::string text = "x,y,p,t_us\n";
  for (int i = 0; i < 200; ++i) {
    text += "1,2," + std::string(i % 2 == 0 ? "255" : "0") + "," + std::to_string(50 * i) + "\n";
  }
  const Ran ran = RunInfo({folder.WriteFile("e.csv", text).string(), "-o", "json"});
  EXPECT_EQ(nlohmann::json::parse(ran.text)["on_events"], 100);
}

TEST(EventFileInfo, Evt3WithTriggers) {
  RIGCAL_REQUIRE_RECORDED_DATA(data);
  const std::string path = (data / "events/evt3_640x480_trigger_1khz.raw").string();
  const Ran ran = RunInfo({path, "-o", "json"});
  ASSERT_TRUE(ran.status.ok()) << ran.status;
  const auto json = nlohmann::json::parse(ran.text);
  EXPECT_EQ(json["format"], "EVT3");
  EXPECT_EQ(json["geometry"]["width"], 640);
  EXPECT_EQ(json["geometry"]["height"], 480);
  EXPECT_EQ(json["cd_events"], 343474);
  EXPECT_EQ(json["on_events"], 125183);
  EXPECT_EQ(json["off_events"], 343474 - 125183);
  EXPECT_EQ(json["sum_x"], 116731888);
  EXPECT_EQ(json["sum_y"], 80879209);
  EXPECT_EQ(json["trigger_events"], 4157);
  EXPECT_EQ(json["last_us"], 9218023);
  ASSERT_EQ(json["triggers"].size(), 2u);
  int64_t first_us = 1LL << 62;
  for (const auto& edges : json["triggers"]) {
    EXPECT_EQ(edges["channel"], 6);
    first_us = std::min(first_us, edges["first_us"].get<int64_t>());
    if (edges["edge"] == "rising") {
      EXPECT_EQ(edges["shortest_gap_us"], 1000);
      EXPECT_EQ(edges["longest_gap_us"], 1000);
    }
  }
  EXPECT_EQ(first_us, 7139840);
  EXPECT_EQ(json["duration_us"], json["last_us"].get<int64_t>() - json["first_us"].get<int64_t>());
  const Ran table = RunInfo({path});
  EXPECT_THAT(table.text, AllOf(HasSubstr("343474"), HasSubstr("channel 6 rising"),
                                HasSubstr("1000 to 1000 us apart"), HasSubstr("640x480")));
}

TEST(EventFileInfo, Evt2) {
  RIGCAL_REQUIRE_RECORDED_DATA(data);
  const Ran ran = RunInfo({(data / "events/evt2_gen3.raw").string(), "-o", "json"});
  ASSERT_TRUE(ran.status.ok()) << ran.status;
  const auto json = nlohmann::json::parse(ran.text);
  EXPECT_EQ(json["format"], "EVT2");
  EXPECT_EQ(json["geometry"]["width"], 640);
  EXPECT_EQ(json["cd_events"], 521252);
  EXPECT_EQ(json["on_events"], 185861);
  EXPECT_EQ(json["sum_x"], 128979953);
  EXPECT_EQ(json["sum_y"], 216346680);
  EXPECT_EQ(json["first_us"], 913716224);
  EXPECT_EQ(json["last_us"], 913812095);
  EXPECT_EQ(json["trigger_events"], 0);
}

class EventFileInfoTest : public ::testing::Test {
 protected:
  std::string Write(const std::string& header, const std::vector<uint8_t>& words) {
    std::vector<uint8_t> bytes(header.begin(), header.end());
    bytes.insert(bytes.end(), words.begin(), words.end());
    const std::string path = (directory_.path() / "some.raw").string();
    testing::WriteBytes(path, bytes);
    return path;
  }
  testing::TemporaryDirectory directory_;
};

TEST_F(EventFileInfoTest, CountsFaultsAndEpochs) {
  std::vector<uint8_t> words;
  Evt3Writer early, late;
  const auto events = [](int64_t first_us) {
    std::vector<CdEvent> list;
    for (int i = 0; i < 100; ++i) {
      list.push_back({first_us + 1000 * i, static_cast<uint16_t>(i), 10, true});
    }
    return list;
  };
  late.Write(events(8'000'000), &words);
  early.Write(events(0), &words);
  words.push_back(0);
  const std::string path = Write(Evt3Header({90, 480}, "1"), words);
  ASSERT_OK_AND_ASSIGN(const EventFileInfo info, ReadEventFileInfo(path, std::nullopt));
  EXPECT_EQ(info.cd_events, 180u);
  EXPECT_EQ(info.largest_x, 89u);
  EXPECT_EQ(info.faults.outside_geometry, 20u);
  EXPECT_EQ(info.faults.time_steps_back, 1u);
  EXPECT_EQ(info.faults.truncated_bytes, 1u);
  EXPECT_EQ(info.duration_us, 2 * 89'000);
  // Where the first of each kind is, in the file.
  const auto header_bytes = info.header.byte_count;
  EXPECT_EQ(info.first_faults.at("truncated_bytes"),
            "byte " + std::to_string(header_bytes + words.size() - 1));
  EXPECT_THAT(info.first_faults.at("outside_geometry"), HasSubstr("byte "));
  EXPECT_THAT(info.first_faults.at("time_steps_back"), HasSubstr("byte "));
  // And how large the sensor must be.
  EXPECT_EQ(info.extent, (SensorGeometry{100, 11}));
  EXPECT_THAT(FormatInfo(info),
              AllOf(HasSubstr("20, the first one at byte "), HasSubstr("contradicted"),
                    HasSubstr("20 events are outside of it"), HasSubstr("100x11 pixels")));
  EXPECT_THAT(FormatInfo(info),
              AllOf(HasSubstr("outside of the geometry"), HasSubstr("truncated bytes")));
}

TEST_F(EventFileInfoTest, AFileThatDoesNotTellItsGeometry) {
  std::vector<uint8_t> words;
  const std::vector<CdEvent> events = {{100, 1279, 3, true}, {200, 5, 719, false}};
  Evt3Writer().Write(events, &words);
  const std::string path = Write("% evt 3.0\n", words);
  Ran ran = RunInfo({path});
  ASSERT_TRUE(ran.status.ok()) << ran.status;
  EXPECT_THAT(ran.text, HasSubstr("column 1279, row 719"));
  ran = RunInfo({path, "-o", "json", "--geometry", "640x480"});
  ASSERT_TRUE(ran.status.ok()) << ran.status;
  const auto json = nlohmann::json::parse(ran.text);
  EXPECT_TRUE(json["geometry"].is_null());
  EXPECT_EQ(json["cd_events"], 0);
  EXPECT_EQ(json["faults"]["outside_geometry"], 2);
  EXPECT_EQ(json["extent_of_contradiction"]["width"], 1280);
  EXPECT_THAT(json["first_faults"]["outside_geometry"].get<std::string>(), HasSubstr("byte "));
}

TEST_F(EventFileInfoTest, FilesForInterchange) {
  const std::string csv =
      "%geometry:640,480\nx,y,p,t\n1,2,1,0.5\n700,3,0,0.75\nwhat\n4,5,0,1\n6,7,1,0.1\n";
  testing::WriteBytes((directory_.path() / "some.csv").string(), {csv.begin(), csv.end()});
  const Ran ran = RunInfo({(directory_.path() / "some.csv").string()});
  ASSERT_TRUE(ran.status.ok()) << ran.status;
  EXPECT_THAT(ran.text,
              AllOf(HasSubstr("CSV"), HasSubstr("seconds"), HasSubstr("3, ON 2, OFF 1"),
                    HasSubstr("500000 to"), HasSubstr("1, the first one at line 4"),
                    HasSubstr("701x8 pixels"), HasSubstr("time steps back"),
                    HasSubstr("1, the first one at line 7"), HasSubstr("some.csv:5: 1 field")));
  const Ran json_ran =
      RunInfo({(directory_.path() / "some.csv").string(), "-o", "json", "--time", "us"});
  ASSERT_TRUE(json_ran.status.ok()) << json_ran.status;
  const auto json = nlohmann::json::parse(json_ran.text);
  EXPECT_EQ(json["format"], "CSV");
  EXPECT_EQ(json["time_unit"], "microseconds");
  EXPECT_EQ(json["refused"][0]["reason"], "event_csv_bad_line");
  EXPECT_EQ(json["sum_x"], 11);
}

TEST_F(EventFileInfoTest, SaysWhatIsWrong) {
  const std::string text = Write("x;y;z\n", {});
  EXPECT_THAT(RunInfo({text}).status, StatusIs(absl::StatusCode::kFailedPrecondition,
                                               AllOf(HasSubstr("some.raw"), HasSubstr("byte 0"))));
  EXPECT_THAT(RunInfo({text, "--geometry", "wide"}).status,
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("1280x720")));
  EXPECT_THAT(RunInfo({text + ".none"}).status,
              StatusIs(absl::StatusCode::kFailedPrecondition, HasSubstr("some.raw.none")));
  const std::string known = Write(Evt3Header({640, 480}, "1"), {});
  EXPECT_THAT(RunInfo({known, "--geometry", "1280x720"}).status,
              StatusIs(absl::StatusCode::kFailedPrecondition, HasSubstr("640x480")));
}

}  // namespace
}  // namespace rigcal::agent::event_file_info_test

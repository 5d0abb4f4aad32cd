// SPDX-License-Identifier: Apache-2.0
#include "common/log/log_formatters.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <spdlog/logger.h>
#include <spdlog/sinks/ostream_sink.h>

#include <algorithm>
#include <nlohmann/json.hpp>
#include <sstream>

#include "common/log/log_fields.h"

namespace rigcal::log_formatters_test {
namespace {

using ::testing::EndsWith;
using ::testing::HasSubstr;
using ::testing::MatchesRegex;
using ::testing::Not;

// What `message` becomes.
std::string Logged(std::unique_ptr<spdlog::formatter> formatter, const std::string& message) {
  std::ostringstream lines;
  spdlog::logger logger("rigcal-server", std::make_shared<spdlog::sinks::ostream_sink_mt>(lines));
  logger.set_formatter(std::move(formatter));
  logger.warn("{}", message);
  return lines.str();
}

constexpr char kHostile[] =
    "a\n[2026-01-01 00:00:00.000] [rigcal-server] [info] \x1b[2J\"stopped\" \xe2\x80\xae \xff!";

TEST(TextFormatter, AnEntryIsOneLineWhateverIsInIt) {
  const std::string text = Logged(MakeTextFormatter(), kHostile);
  EXPECT_EQ(std::count(text.begin(), text.end(), '\n'), 1);
  EXPECT_EQ(text.back(), '\n');
  EXPECT_THAT(text, Not(HasSubstr("\x1b")));
  EXPECT_THAT(text, HasSubstr("[rigcal-server] [warning] a\\n[2026"));
  EXPECT_THAT(text, HasSubstr("\\x1b[2J\"stopped\" \\u202e \\xff!"));
}

TEST(TextFormatter, NamesTheRequest) {
  EXPECT_THAT(Logged(MakeTextFormatter(), "hello"), EndsWith("] hello\n"));
  const LogScope scope({.session = "wave", .correlation = "c0ffee"});
  EXPECT_THAT(Logged(MakeTextFormatter(), "hello"), EndsWith("] hello (correlation c0ffee)\n"));
}

TEST(JsonFormatter, AnEntryIsOneObjectOnOneLineWhateverIsInIt) {
  const LogScope scope({.session = "wa\nve",
                        .camera = "le\"ft\xff",
                        .calibration = "c-000001",
                        .correlation = "c0ffee"});
  const std::string text = Logged(MakeJsonFormatter(), kHostile);
  EXPECT_EQ(std::count(text.begin(), text.end(), '\n'), 1);
  EXPECT_EQ(text.back(), '\n');
  EXPECT_TRUE(std::ranges::all_of(text, [](char c) { return c == '\n' || (c >= 32 && c < 127); }));
  const auto line = nlohmann::json::parse(text);
  EXPECT_THAT(line["time"].get<std::string>(),
              MatchesRegex("[0-9]{4}-[0-9]{2}-[0-9]{2}T[0-9]{2}:[0-9]{2}:[0-9]{2}\\.[0-9]{3}Z"));
  EXPECT_EQ(line["level"], "warning");
  EXPECT_EQ(line["program"], "rigcal-server");
  EXPECT_THAT(line["message"].get<std::string>(), HasSubstr("\x1b[2J\"stopped\""));
  EXPECT_EQ(line["session"], "wa\nve");
  EXPECT_EQ(line["camera"], "le\"ft\xef\xbf\xbd");
  EXPECT_EQ(line["calibration"], "c-000001");
  EXPECT_EQ(line["correlation"], "c0ffee");
}

TEST(JsonFormatter, LeavesOutWhatIsNotKnown) {
  const auto line = nlohmann::json::parse(Logged(MakeJsonFormatter(), "hello"));
  EXPECT_EQ(line.size(), 4u) << line;
}

TEST(LogScope, EndsWithItsObjectAndKeepsWhatItDoesNotName) {
  const LogScope outer({.session = "wave", .correlation = "1"});
  {
    const LogScope inner({.calibration = "c-000001", .correlation = "2"});
    EXPECT_EQ(LogFields::Current().session, "wave");
    EXPECT_EQ(LogFields::Current().calibration, "c-000001");
    EXPECT_EQ(LogFields::Current().correlation, "2");
  }
  EXPECT_EQ(LogFields::Current().calibration, "");
  EXPECT_EQ(LogFields::Current().correlation, "1");
}

}  // namespace
}  // namespace rigcal::log_formatters_test

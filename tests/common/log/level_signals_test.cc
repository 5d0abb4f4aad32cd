// SPDX-License-Identifier: Apache-2.0
#include "common/log/level_signals.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <spdlog/sinks/ostream_sink.h>
#include <spdlog/spdlog.h>

#include <sstream>

#include "common/log/start_log.h"

namespace rigcal::level_signals_test {
namespace {

using ::testing::HasSubstr;

class LevelSignals : public ::testing::Test {
 protected:
  LevelSignals() {
    spdlog::set_default_logger(std::make_shared<spdlog::logger>(
        "test", std::make_shared<spdlog::sinks::ostream_sink_mt>(lines_)));
  }
  ~LevelSignals() override { StartLog("test"); }
  bool Take(int signal) {
    lines_.str("");
    return TakeLevelSignal(signal, [this] { return file_level_; });
  }

  std::ostringstream lines_;
  absl::StatusOr<std::string> file_level_ = "error";
};

TEST_F(LevelSignals, LogMoreAndLess) {
  ASSERT_TRUE(SetLogLevel("info").ok());
  for (const char* level : {"debug", "trace", "trace"}) {
    EXPECT_TRUE(Take(SIGUSR1));
    EXPECT_EQ(LogLevel(), level);
    EXPECT_THAT(lines_.str(), HasSubstr(std::string("the log level is ") + level));
  }
  for (const char* level : {"debug", "info", "warn", "error", "off", "off"}) {
    EXPECT_TRUE(Take(SIGUSR2));
    EXPECT_EQ(LogLevel(), level);
  }
}

TEST_F(LevelSignals, ReadTheFileAgain) {
  ASSERT_TRUE(SetLogLevel("info").ok());
  EXPECT_TRUE(Take(SIGHUP));
  EXPECT_EQ(LogLevel(), "error");
  EXPECT_THAT(lines_.str(), HasSubstr("the log level is error, it was info"));
  file_level_ = absl::InvalidArgumentError("server.toml:3: log_level: unknown");
  EXPECT_TRUE(Take(SIGHUP));
  EXPECT_EQ(LogLevel(), "error");
  EXPECT_THAT(lines_.str(), HasSubstr("server.toml:3"));
}

TEST_F(LevelSignals, LeaveOtherSignalsAlone) {
  ASSERT_TRUE(SetLogLevel("info").ok());
  EXPECT_FALSE(Take(SIGTERM));
  EXPECT_EQ(LogLevel(), "info");
  sigset_t signals;
  sigemptyset(&signals);
  AddLevelSignals(/*has_config=*/false, &signals);
  EXPECT_EQ(sigismember(&signals, SIGHUP), 0);
  AddLevelSignals(/*has_config=*/true, &signals);
  EXPECT_EQ(sigismember(&signals, SIGHUP), 1);
  EXPECT_EQ(sigismember(&signals, SIGTERM), 0);
}

TEST(StartLog, RefusesWordsThatAreNone) {
  EXPECT_FALSE(SetLogLevel("loud").ok());
  EXPECT_FALSE(SetLogFormat("xml").ok());
}

}  // namespace
}  // namespace rigcal::level_signals_test

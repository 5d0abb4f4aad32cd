// SPDX-License-Identifier: Apache-2.0
#include "common/log/journal_sink.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <spdlog/logger.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cstdlib>

#include "common/log/log_fields.h"

namespace rigcal::journal_sink_test {
namespace {

using ::testing::UnorderedElementsAre;

TEST(JournalSink, SendsFieldsOnOneLineEach) {
  std::vector<std::string> sent;
  spdlog::logger logger("rigcal-agent",
                        MakeJournalSink([&](const auto& fields) { sent = fields; }));
  {
    const LogScope scope({.session = "wa\nPRIORITY=0", .camera = "left", .correlation = "c0ffee"});
    logger.error("camera gone\nPRIORITY=7 \xff");
  }
  EXPECT_THAT(
      sent, UnorderedElementsAre("MESSAGE=camera gone\\nPRIORITY=7 \\xff", "PRIORITY=3",
                                 "SYSLOG_IDENTIFIER=rigcal-agent", "RIGCAL_SESSION=wa\\nPRIORITY=0",
                                 "RIGCAL_CAMERA=left", "RIGCAL_CORRELATION=c0ffee"));
  logger.info("fine");
  EXPECT_THAT(sent,
              UnorderedElementsAre("MESSAGE=fine", "PRIORITY=6", "SYSLOG_IDENTIFIER=rigcal-agent"));
}

TEST(JournalSink, IsChosenWhereStderrIsTheJournalsStream) {
  struct stat file {};
  ASSERT_EQ(fstat(STDERR_FILENO, &file), 0);
  const std::string own = std::to_string(file.st_dev) + ":" + std::to_string(file.st_ino);
  setenv("JOURNAL_STREAM", own.c_str(), 1);
  EXPECT_TRUE(StderrIsJournal());
  // Another file, as when a service's stderr is sent elsewhere.
  setenv("JOURNAL_STREAM", (own + "1").c_str(), 1);
  EXPECT_FALSE(StderrIsJournal());
  setenv("JOURNAL_STREAM", "nonsense", 1);
  EXPECT_FALSE(StderrIsJournal());
  unsetenv("JOURNAL_STREAM");
  EXPECT_FALSE(StderrIsJournal());
}

}  // namespace
}  // namespace rigcal::journal_sink_test

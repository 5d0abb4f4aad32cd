// SPDX-License-Identifier: Apache-2.0
#include "common/log/start_log.h"

#include <gtest/gtest.h>
#include <spdlog/logger.h>
#include <spdlog/sinks/ostream_sink.h>

#include <algorithm>
#include <sstream>

namespace rigcal::start_log_test {
namespace {

TEST(Log, AnEntryIsOneLineWhateverIsInIt) {
  std::ostringstream lines;
  spdlog::logger logger("rigcal-server", std::make_shared<spdlog::sinks::ostream_sink_mt>(lines));
  logger.set_formatter(MakeLogFormatter());
  logger.info("agent {} connected",
              "a\n[2026-01-01 00:00:00.000] [rigcal-server] [info] \x1b[2Jstopped \u202e!");
  const std::string text = lines.str();
  EXPECT_EQ(std::count(text.begin(), text.end(), '\n'), 1);
  EXPECT_EQ(text.back(), '\n');
  EXPECT_EQ(text.find('\x1b'), std::string::npos);
  EXPECT_NE(text.find("[rigcal-server] [info] agent a\\n[2026"), std::string::npos) << text;
  EXPECT_NE(text.find("\\x1b[2Jstopped \\u202e! connected"), std::string::npos) << text;
}

}  // namespace
}  // namespace rigcal::start_log_test

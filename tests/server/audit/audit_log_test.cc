// SPDX-License-Identifier: Apache-2.0
#include "server/audit/audit_log.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/stat.h>

#include <fstream>
#include <nlohmann/json.hpp>
#include <string>
#include <thread>
#include <vector>

#include "tests/testing/temporary_directory.h"

namespace rigcal::testing::audit_log_test {
namespace {

using ::testing::SizeIs;

class AuditLog : public ::testing::Test {
 protected:
  std::vector<nlohmann::json> Lines(const std::filesystem::path& file) {
    std::vector<nlohmann::json> lines;
    std::ifstream stream(file);
    for (std::string line; std::getline(stream, line);) {
      lines.push_back(nlohmann::json::parse(line));
    }
    return lines;
  }

  TemporaryDirectory directory_;
  const std::filesystem::path file_ = directory_.path() / "audit.jsonl";
};

TEST_F(AuditLog, WritesOneObjectALineForThisUserOnly) {
  server::AuditLog log(file_, {.utc_now_ns = [] { return int64_t{1'700'000'000'123'000'000}; }});
  log.Write("refused", "agent 'pc1'", {{"reason", "because"}});
  const auto lines = Lines(file_);
  ASSERT_THAT(lines, SizeIs(1));
  EXPECT_EQ(lines[0]["time"], "2023-11-14T22:13:20.123Z");
  EXPECT_EQ(lines[0]["event"], "refused");
  EXPECT_EQ(lines[0]["peer"], "agent 'pc1'");
  EXPECT_EQ(lines[0]["reason"], "because");
  struct stat status {};
  ASSERT_EQ(stat(file_.c_str(), &status), 0);
  EXPECT_EQ(status.st_mode & 0777, 0600u);
}

TEST_F(AuditLog, NobodyForgesALineOrReachesATerminal) {
  server::AuditLog log(file_);
  const std::string evil = "a\"}\n{\"event\":\"change\"}\x1b[2J\xe2\x80\xae\xff";
  log.Write("refused", evil, {{"host", evil}, {"long", std::string(100'000, 'x')}});
  const auto lines = Lines(file_);
  ASSERT_THAT(lines, SizeIs(1));
  EXPECT_LT(lines[0]["long"].get<std::string>().size(), 1100u);
  std::ifstream stream(file_);
  for (char c = 0; stream.get(c);) EXPECT_TRUE(c == '\n' || (c >= ' ' && c <= '~')) << int{c};
}

TEST_F(AuditLog, ItsSizeIsBounded) {
  server::AuditLog log(
      file_, {.max_file_bytes = 2000, .kept_files = 2, .max_lines_per_interval = 1'000'000});
  for (int i = 0; i < 200; ++i) log.Write("change", "kim", {{"i", std::to_string(i)}});
  uint64_t bytes = 0;
  size_t files = 0;
  for (const auto& entry : std::filesystem::directory_iterator(directory_.path())) {
    bytes += entry.file_size();
    ++files;
  }
  EXPECT_EQ(files, 3u);
  EXPECT_LE(bytes, 3 * 2000u);
  EXPECT_EQ(Lines(file_).back()["i"], "199") << "the newest line is in the file itself";
  EXPECT_FALSE(Lines(file_.string() + ".2").empty());
}

TEST_F(AuditLog, AFloodOfOnePeerIsCountedAndLeavesTheLinesOfOthers) {
  server::AuditLog log(file_,
                       {.max_lines_per_interval = 3, .interval = std::chrono::milliseconds(200)});
  for (int i = 0; i < 50; ++i) log.Write("refused", "eve");
  for (int i = 0; i < 10; ++i) log.WriteChange("change", "kim");
  EXPECT_THAT(Lines(file_), SizeIs(13));
  std::this_thread::sleep_for(std::chrono::milliseconds(250));
  log.Write("refused", "eve");
  const auto lines = Lines(file_);
  ASSERT_THAT(lines, SizeIs(14));
  EXPECT_EQ(lines.back()["left_out"], 47);
}

TEST_F(AuditLog, AFloodUnderNewNamesIsBounded) {
  server::AuditLog log(
      file_, {.max_lines_per_interval = 2, .interval = std::chrono::milliseconds(3'600'000)});
  for (int i = 0; i < 5000; ++i) log.Write("refused", "eve" + std::to_string(i));
  EXPECT_LT(Lines(file_).size(), 1100u);
}

TEST_F(AuditLog, AFolderThatIsMissingStopsNobody) {
  server::AuditLog log(directory_.path() / "missing" / "audit.jsonl");
  log.Write("change", "kim");
  std::filesystem::create_directory(directory_.path() / "missing");
  log.Write("change", "kim");
  EXPECT_THAT(Lines(directory_.path() / "missing" / "audit.jsonl"), SizeIs(1));
  server::AuditLog("").Write("change", "kim");
}

}  // namespace
}  // namespace rigcal::testing::audit_log_test

// SPDX-License-Identifier: Apache-2.0
#include "common/config/server_config.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstdlib>
#include <fstream>
#include <string>

#include "tests/testing/status_matchers.h"
#include "tests/testing/temporary_directory.h"

namespace rigcal::testing::server_config_test {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;

class ServerConfigTest : public ::testing::Test {
 protected:
  absl::StatusOr<ServerConfig> Read(const std::string& text) {
    return ReadServerConfig(directory_.WriteFile("server.toml", text).string());
  }
  TemporaryDirectory directory_;
};

TEST_F(ServerConfigTest, AnEmptyFileIsTheDefault) {
  ASSERT_OK_AND_ASSIGN(const ServerConfig config, Read(""));
  EXPECT_EQ(config.listen, "127.0.0.1:7420");
  EXPECT_EQ(config.data_dir, "");
  EXPECT_EQ(config.log_level, "info");
  EXPECT_EQ(config.tls.loopback, std::nullopt);
  EXPECT_EQ(config.limits, ServerLimits());
  EXPECT_EQ(config.retention, RetentionConfig());
}

// deploy/server.toml shows every default; with its comment signs gone it must mean the same.
TEST_F(ServerConfigTest, TheSampleShowsTheDefaults) {
  std::ifstream sample(std::string(RIGCAL_SOURCE_DIR) + "/deploy/server.toml");
  std::string text;
  int keys = 0;
  for (std::string line; std::getline(sample, line);) {
    if (line.substr(0, 2) == "# ") continue;
    keys += line.find(" = ") != std::string::npos ? 1 : 0;
    text += (line.substr(0, 1) == "#" ? line.substr(1) : line) + "\n";
  }
  EXPECT_EQ(keys, 33);
  ASSERT_OK_AND_ASSIGN(const ServerConfig config, Read(text));
  EXPECT_EQ(config.listen, ServerConfig().listen);
  EXPECT_EQ(config.log_level, ServerConfig().log_level);
  EXPECT_EQ(config.limits, ServerLimits());
  EXPECT_EQ(config.tls.loopback, false);
  EXPECT_EQ(config.discovery, ServerDiscoveryConfig());
  EXPECT_EQ(config.retention, RetentionConfig());
}

TEST_F(ServerConfigTest, TakesEveryKey) {
  ASSERT_OK_AND_ASSIGN(const ServerConfig config, Read(R"(
listen = "[::1]:0"
advertise = "rig-a:7420"
data_dir = "data"
store = "postgresql://rigcal@db/rigcal"
store_unsafe = true
docs_dir = "html"
log_level = "debug"
[https]
listen = "[::1]:7"
hosts = "rig.lab.org, rig"
[tls]
loopback = true
[discovery]
mdns = true
[limits]
max_agents = 1
max_cameras_per_agent = 2
max_sessions = 3
max_cameras_per_session = 4
max_watches = 5
max_queued_calibrations = 6
max_calibration_observations = 7
ingest_queue_mb = 8
send_window_rows = 9
rpc_memory_mb = 10
max_connections = 11
max_connections_per_address = 12
disk_reserve_mb = 13
max_readers = 16
calibration_memory_mb = 17
calibration_silence_s = 18
[retention]
max_age_days = 14
max_size_mb = 15
delete_calibrated = true
[solve]
local = false
)"));
  EXPECT_EQ(config.listen, "[::1]:0");
  EXPECT_EQ(config.data_dir, (directory_.path() / "data").string());
  EXPECT_EQ(config.store, "postgresql://rigcal@db/rigcal");
  EXPECT_TRUE(config.store_unsafe);
  EXPECT_EQ(config.docs_dir, (directory_.path() / "html").string());
  EXPECT_EQ(config.log_level, "debug");
  const ServerLimits expected{.max_agents = 1,
                              .max_cameras_per_agent = 2,
                              .max_sessions = 3,
                              .max_cameras_per_session = 4,
                              .max_watches = 5,
                              .max_readers = 16,
                              .max_queued_calibrations = 6,
                              .max_calibration_observations = 7,
                              .calibration_memory_mb = 17,
                              .calibration_silence_s = 18,
                              .ingest_queue_mb = 8,
                              .send_window_rows = 9,
                              .rpc_memory_mb = 10,
                              .max_connections = 11,
                              .max_connections_per_address = 12,
                              .disk_reserve_mb = 13};
  EXPECT_EQ(config.limits, expected);
  EXPECT_EQ(config.https.listen, "[::1]:7");
  EXPECT_EQ(config.https.hosts, "rig.lab.org, rig");
  EXPECT_EQ(config.tls.loopback, true);
  EXPECT_TRUE(config.discovery.mdns);
  const RetentionConfig retention{.max_age_days = 14, .max_size_mb = 15, .delete_calibrated = true};
  EXPECT_EQ(config.retention, retention);
  EXPECT_FALSE(config.solve.local);
}

TEST_F(ServerConfigTest, AnAbsoluteDataDirectoryStays) {
  ASSERT_OK_AND_ASSIGN(const ServerConfig config, Read("data_dir = \"/var/lib/rigcal\""));
  EXPECT_EQ(config.data_dir, "/var/lib/rigcal");
}

TEST_F(ServerConfigTest, ListsEveryFaultWithFileAndLine) {
  EXPECT_THAT(Read("listen = 7420\n"
                   "data_dri = \"x\"\n"
                   "log_level = \"loud\"\n"
                   "[limits]\n"
                   "max_agents = 0\n"
                   "max_sessions = \"many\"\n"
                   "max_wathces = 1\n"),
              StatusIs(absl::StatusCode::kInvalidArgument,
                       AllOf(HasSubstr("server.toml:1: listen"), HasSubstr("server.toml:2: "),
                             HasSubstr("unknown key \"data_dri\"; did you mean \"data_dir\"?"),
                             HasSubstr("server.toml:3: log_level"),
                             HasSubstr("server.toml:5: max_agents=0"),
                             HasSubstr("server.toml:6: max_sessions"), HasSubstr("server.toml:7: "),
                             HasSubstr("did you mean \"max_watches\"?"))));
}

TEST_F(ServerConfigTest, RefusesValuesThatCannotBeMeant) {
  for (const char* listen : {"", "7420", ":7420", "localhost", "localhost:", "localhost:x",
                             "localhost:65536", "localhost:999999999999"}) {
    EXPECT_THAT(Read("listen = \"" + std::string(listen) + "\""),
                StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("server.toml:1: listen")))
        << listen;
  }
  EXPECT_THAT(Read("data_dir = \"\""),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("data_dir")));
  EXPECT_THAT(Read("limits = 3"),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("[limits]")));
  EXPECT_THAT(Read("[limits]\nsend_window_rows = 4294967297"),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("send_window_rows")));
  EXPECT_THAT(Read("[limits]\nmax_agents = 2.5"),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("max_agents")));
}

// Deep enough to end the program, in each way of writing it.
TEST_F(ServerConfigTest, RefusesDeepNesting) {
  std::string header = "[a", key = "a", tables = "a = ", lists = "a = ";
  for (int i = 0; i < 50'000; ++i) {
    header += ".a";
    key += ".a";
    tables += "{a = ";
    lists += "[";
  }
  for (const std::string& deep :
       {header + "]\n", key + " = 1\n", tables, lists, "[" + header + "]]"}) {
    EXPECT_THAT(Read("\n" + deep),
                StatusIs(absl::StatusCode::kInvalidArgument,
                         AllOf(HasSubstr("server.toml:2: "), HasSubstr("nested more than 64"))));
  }
}

TEST_F(ServerConfigTest, NamesAFileThatIsMissingOrNoToml) {
  EXPECT_THAT(ReadServerConfig("/nowhere/server.toml"),
              StatusIs(absl::StatusCode::kNotFound, HasSubstr("/nowhere/server.toml")));
  EXPECT_THAT(Read("listen = \"127.0.0.1:1\"\n[limits\n"),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("server.toml:2")));
}

// Environment variables, put back at the end.
class DefaultDataDirectoryTest : public ::testing::Test {
 protected:
  ~DefaultDataDirectoryTest() override {
    Set("XDG_DATA_HOME", data_home_);
    Set("HOME", home_);
  }
  static std::string Get(const char* name) {
    const char* value = std::getenv(name);
    return value == nullptr ? "" : value;
  }
  static void Set(const char* name, const std::string& value) {
    if (value.empty()) {
      unsetenv(name);
    } else {
      setenv(name, value.c_str(), 1);
    }
  }
  const std::string data_home_ = Get("XDG_DATA_HOME");
  const std::string home_ = Get("HOME");
};

TEST_F(DefaultDataDirectoryTest, FollowsTheEnvironment) {
  Set("HOME", "/home/somebody");
  Set("XDG_DATA_HOME", "/data");
  ASSERT_OK_AND_ASSIGN(const std::string from_data_home, DefaultDataDirectory());
  EXPECT_EQ(from_data_home, "/data/rigcal");
  for (const char* ignored : {"", "relative/path"}) {
    Set("XDG_DATA_HOME", ignored);
    ASSERT_OK_AND_ASSIGN(const std::string from_home, DefaultDataDirectory());
    EXPECT_EQ(from_home, "/home/somebody/.local/share/rigcal");
  }
  Set("HOME", "");
  EXPECT_THAT(DefaultDataDirectory(),
              StatusIs(absl::StatusCode::kFailedPrecondition, HasSubstr("--data-dir")));
}

}  // namespace
}  // namespace rigcal::testing::server_config_test

// SPDX-License-Identifier: Apache-2.0
#include "common/config/agent_config.h"

#include <string>

#include "tests/testing/status_matchers.h"
#include "tests/testing/temporary_directory.h"

namespace rigcal::agent_config_test {
namespace {

using ::rigcal::testing::IsOk;
using ::rigcal::testing::StatusIs;
using ::rigcal::testing::TemporaryDirectory;
using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::Not;
using ::testing::UnorderedElementsAre;

class AgentConfigTest : public ::testing::Test {
 protected:
  absl::StatusOr<AgentConfig> Read(const std::string& text) {
    return ReadAgentConfig(directory_.WriteFile("agent.toml", text).string());
  }
  std::string Path(const std::string& name) const { return (directory_.path() / name).string(); }

  TemporaryDirectory directory_;
};

TEST_F(AgentConfigTest, HasADefaultForEverything) {
  ASSERT_OK_AND_ASSIGN(const AgentConfig config, Read(""));
  EXPECT_EQ(config.server, "127.0.0.1:7420");
  EXPECT_EQ(config.rig, "rig");
  EXPECT_EQ(config.agent_id, "");
  EXPECT_EQ(config.state_dir, "");
  EXPECT_EQ(config.log_level, "info");
  EXPECT_EQ(config.spool.kind, SpoolConfig::Kind::kDisk);
  EXPECT_EQ(config.spool.limit_mb, 2048u);
  EXPECT_EQ(config.spool.full, SpoolConfig::Full::kBlock);
  EXPECT_EQ(config.spool.sync_interval_ms, 200);
  EXPECT_TRUE(config.cameras.empty());
  EXPECT_THAT(config.Validate(), IsOk());
}

TEST_F(AgentConfigTest, ReadsEveryKey) {
  ASSERT_OK_AND_ASSIGN(const AgentConfig config, Read(R"(
server = "10.0.0.5:7000"
rig = "hall"
agent_id = "pc-1"
state_dir = "/var/lib/rigcal-agent"
log_level = "debug"

[spool]
kind = "memory"
limit_mb = 64
full = "drop_oldest"
sync_interval_ms = 0

[[camera]]
name = "left"
source = "csv:data/left.csv;sigma=1"
calibration = "left.yaml"
speed = "max"
sigma = 0.25

[[camera]]
source = "sim:camera=1;seed=2"
speed = 2
)"));
  EXPECT_EQ(config.server, "10.0.0.5:7000");
  EXPECT_EQ(config.rig, "hall");
  EXPECT_EQ(config.agent_id, "pc-1");
  EXPECT_EQ(config.state_dir, "/var/lib/rigcal-agent");
  EXPECT_EQ(config.log_level, "debug");
  EXPECT_EQ(config.spool.kind, SpoolConfig::Kind::kMemory);
  EXPECT_EQ(config.spool.limit_mb, 64u);
  EXPECT_EQ(config.spool.full, SpoolConfig::Full::kDropOldest);
  EXPECT_EQ(config.spool.sync_interval_ms, 0);
  ASSERT_EQ(config.cameras.size(), 2u);
  const CameraConfig& left = config.cameras[0];
  const std::string file = Path("agent.toml");
  EXPECT_EQ(left.name, "left");
  EXPECT_EQ(left.source, "csv:data/left.csv;sigma=1");
  EXPECT_EQ(left.folder, directory_.path().string());
  EXPECT_EQ(left.where, file + ":14");
  EXPECT_THAT(left.options,
              UnorderedElementsAre(OptionText{"calibration", "left.yaml", file + ":17"},
                                   OptionText{"speed", "max", file + ":18"},
                                   OptionText{"sigma", "0.25", file + ":19"}));
  const CameraConfig& simulated = config.cameras[1];
  EXPECT_EQ(simulated.name, "");
  EXPECT_EQ(simulated.source, "sim:camera=1;seed=2");
  EXPECT_THAT(simulated.options, UnorderedElementsAre(OptionText{"speed", "2", file + ":23"}));
}

TEST_F(AgentConfigTest, PreviewsAreOffUntilTheyAreSwitchedOn) {
  ASSERT_OK_AND_ASSIGN(const AgentConfig silent, Read("[preview]\nmax_kb = 8\n"));
  EXPECT_FALSE(silent.preview.enabled);
  ASSERT_OK_AND_ASSIGN(const AgentConfig config,
                       Read("[preview]\nenabled = true\nmax_rate_hz = 0.5\nmax_kb = 1024\n"));
  EXPECT_TRUE(config.preview.enabled);
  EXPECT_EQ(config.preview.max_rate_hz, 0.5);
  EXPECT_EQ(config.preview.max_kb, 1024);
}

TEST_F(AgentConfigTest, NamesEveryFaultOfPreviews) {
  EXPECT_THAT(Read("[preview]\nenabled = 1\nmax_rate_hz = 0\nmax_kb = 2000\nquality = 3\n"),
              StatusIs(absl::StatusCode::kInvalidArgument,
                       AllOf(HasSubstr("agent.toml:2"), HasSubstr("max_rate_hz"),
                             HasSubstr("max_kb"), HasSubstr("quality"))));
  EXPECT_THAT(Read("preview = true"),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("[preview]")));
}

TEST_F(AgentConfigTest, ResolvesPathsOfItsOwn) {
  ASSERT_OK_AND_ASSIGN(const AgentConfig config, Read("state_dir = \"state\""));
  EXPECT_EQ(config.state_dir, Path("state"));
}

TEST_F(AgentConfigTest, KeepsTheTablesOfACameraForItsSource) {
  ASSERT_OK_AND_ASSIGN(const AgentConfig config, Read(R"([[camera]]
source = "images:data/left;fps=25"
[camera.settings]
exposure = 0.004
ptp = true
trigger = "Line0"
[camera.detector]
hue_min = 345
mask = "left_mask.png"

[[camera]]
source = "video:/v.mkv"
)"));
  ASSERT_EQ(config.cameras.size(), 2u);
  EXPECT_EQ(config.cameras[0].source, "images:data/left;fps=25");
  const std::string file = Path("agent.toml");
  EXPECT_THAT(config.cameras[0].options,
              UnorderedElementsAre(OptionText{"exposure", "0.004", file + ":4"},
                                   OptionText{"ptp", "1", file + ":5"},
                                   OptionText{"trigger", "Line0", file + ":6"},
                                   OptionText{"hue_min", "345", file + ":8"},
                                   OptionText{"mask", "left_mask.png", file + ":9"}));
  EXPECT_EQ(config.cameras[1].source, "video:/v.mkv");
  EXPECT_TRUE(config.cameras[1].options.empty());
}

TEST_F(AgentConfigTest, RefusesTablesOfACameraThatAreNone) {
  EXPECT_THAT(Read("[[camera]]\nsource = \"sim:camera=0\"\ndetector = 3\n"
                   "[camera.settings]\ngain = [1, 2]\n"),
              StatusIs(absl::StatusCode::kInvalidArgument,
                       AllOf(HasSubstr(":3: detector must be written as [camera.detector]"),
                             HasSubstr(":5: gain must be a number"))));
}

TEST_F(AgentConfigTest, ListsEveryFaultWithItsLine) {
  const auto config = Read(R"(server = "nowhere"
rig = "two words"
agent_id = 7
state_dirr = "x"
log_level = "loud"
spool = 0
[[camera]]
name = "left"
[[camera]]
name = "left"
source = "usb:0"
exposure = 3
sorce = "csv:a.csv"
)");
  const std::string file = Path("agent.toml");
  EXPECT_THAT(
      config,
      StatusIs(absl::StatusCode::kInvalidArgument,
               AllOf(HasSubstr(file + ":1: server=nowhere must be HOST:PORT"),
                     HasSubstr(file + ":2: rig=two words must be"),
                     HasSubstr(file + ":3: agent_id=7 must be text in quotes"),
                     HasSubstr(file + ":4: unknown key \"state_dirr\"; did you mean "
                                      "\"state_dir\"?"),
                     HasSubstr(file + ":5: log_level=loud must be trace, debug,"),
                     HasSubstr(file + ":6: "), HasSubstr(file + ":7: a camera without source"))));
  EXPECT_THAT(config, StatusIs(absl::StatusCode::kInvalidArgument,
                               AllOf(HasSubstr(file + ":9: camera left is there twice"),
                                     HasSubstr(file + ":12: unknown key \"exposure\"; known: name"),
                                     HasSubstr(file + ":13: unknown key \"sorce\"; did you mean "
                                                      "\"source\"?"))));
  EXPECT_THAT(config, StatusIs(absl::StatusCode::kInvalidArgument, Not(HasSubstr(":11:"))));
}

TEST_F(AgentConfigTest, RefusesASpoolThatCannotBe) {
  const auto config = Read(R"([spool]
kind = "tape"
limit_mb = 0
full = "drop"
sync_interval_ms = -1
syncs = 3
)");
  const std::string file = Path("agent.toml");
  EXPECT_THAT(config,
              StatusIs(absl::StatusCode::kInvalidArgument,
                       AllOf(HasSubstr(file + ":2: kind=tape must be disk or memory"),
                             HasSubstr(file + ":3: limit_mb=0 must be a whole number of 1 to "
                                              "1048576 MiB"),
                             HasSubstr(file + ":4: full=drop must be block or drop_oldest"),
                             HasSubstr(file + ":5: sync_interval_ms=-1 must be"),
                             HasSubstr(file + ":6: unknown key \"syncs\""))));
}

TEST_F(AgentConfigTest, RefusesServersThatAreNoAddress) {
  for (const char* server : {"", "host", ":7420", "host:", "host:0", "host:65536", "host:x"}) {
    EXPECT_THAT(Read("server = \"" + std::string(server) + "\""),
                StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("HOST:PORT")))
        << server;
  }
  EXPECT_THAT(Read("server = \"[::1]:7420\""), IsOk());
}

TEST_F(AgentConfigTest, RefusesACameraThatIsNoTable) {
  EXPECT_THAT(Read("camera = \"left\""),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("[[camera]]")));
  EXPECT_THAT(Read("camera = [1, 2]"),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("[[camera]]")));
  EXPECT_THAT(Read("[camera]\nsource = \"sim:camera=0\""),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("[[camera]]")));
}

TEST_F(AgentConfigTest, NamesFileAndLineOfWhatIsNoToml) {
  EXPECT_THAT(Read("rig = \"a\"\nserver = \n"),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("agent.toml:2: ")));
  EXPECT_THAT(Read("rig = \"a\"\nrig = \"b\"\n"),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("agent.toml:2: ")));
  EXPECT_THAT(ReadAgentConfig(Path("missing.toml")),
              StatusIs(absl::StatusCode::kNotFound, HasSubstr("missing.toml")));
  EXPECT_THAT(ReadAgentConfig(directory_.path().string()),
              StatusIs(absl::StatusCode::kNotFound, HasSubstr("configuration file")));
}

TEST_F(AgentConfigTest, ChecksTheValuesOfFlags) {
  AgentConfig config;
  config.server = "nowhere";
  config.rig = "two words";
  config.agent_id = "/";
  config.log_level = "loud";
  config.spool.limit_mb = 0;
  EXPECT_THAT(config.Validate(),
              StatusIs(absl::StatusCode::kInvalidArgument,
                       AllOf(HasSubstr("server="), HasSubstr("rig="), HasSubstr("agent_id="),
                             HasSubstr("log_level="), HasSubstr("limit_mb="))));
}

}  // namespace
}  // namespace rigcal::agent_config_test

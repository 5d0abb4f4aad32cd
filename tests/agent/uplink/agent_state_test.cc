// SPDX-License-Identifier: Apache-2.0
#include "agent/uplink/agent_state.h"

#include <signal.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cstdlib>
#include <fstream>
#include <set>
#include <string>

#include "tests/testing/status_matchers.h"
#include "tests/testing/temporary_directory.h"

namespace rigcal::agent::agent_state_test {
namespace {

using ::rigcal::testing::IsOk;
using ::rigcal::testing::StatusIs;
using ::rigcal::testing::TemporaryDirectory;
using ::testing::AllOf;
using ::testing::HasSubstr;

class AgentStateTest : public ::testing::Test {
 protected:
  AgentIdentity OpenAndClose(const std::string& agent_id = "") {
    const auto state = AgentState::Open(Directory(), agent_id);
    EXPECT_THAT(state, IsOk());
    return state.ok() ? state->identity() : AgentIdentity{};
  }
  std::filesystem::path Directory() const { return directory_.path() / "deep" / "state"; }

  TemporaryDirectory directory_;
};

TEST_F(AgentStateTest, KeepsTheIdAndCountsStarts) {
  const AgentIdentity first = OpenAndClose();
  EXPECT_FALSE(first.agent_id.empty());
  EXPECT_EQ(first.incarnation, 1u);
  const AgentIdentity second = OpenAndClose();
  EXPECT_EQ(second.agent_id, first.agent_id);
  EXPECT_EQ(second.incarnation, 2u);
}

TEST_F(AgentStateTest, KeepsASecretOfItsOwnForThisUserOnly) {
  const AgentIdentity first = OpenAndClose();
  EXPECT_EQ(first.secret.size(), 64u);
  EXPECT_EQ(OpenAndClose("pc-7").secret, first.secret);
  const std::filesystem::path file = Directory() / "agent.secret";
  EXPECT_EQ(std::filesystem::status(file).permissions(),
            std::filesystem::perms::owner_read | std::filesystem::perms::owner_write);
  const TemporaryDirectory other;
  const auto state = AgentState::Open(other.path(), "");
  ASSERT_THAT(state, IsOk());
  EXPECT_NE(state->identity().secret, first.secret);
  std::ofstream(file) << "short\n";
  EXPECT_THAT(AgentState::Open(Directory(), ""),
              StatusIs(absl::StatusCode::kDataLoss, HasSubstr("agent.secret")));
}

TEST_F(AgentStateTest, TakesAGivenIdFromThenOn) {
  const AgentIdentity first = OpenAndClose();
  EXPECT_NE(first.agent_id, "pc-7");
  EXPECT_EQ(OpenAndClose("pc-7").agent_id, "pc-7");
  const AgentIdentity third = OpenAndClose();
  EXPECT_EQ(third.agent_id, "pc-7");
  EXPECT_EQ(third.incarnation, 3u);
  EXPECT_THAT(AgentState::Open(Directory(), "no name"),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("agent_id")));
}

TEST_F(AgentStateTest, IsCalledAsItsHostWhereNothingElseIsSaid) {
  EXPECT_EQ(OpenAndClose().agent_id, HostName().substr(0, 31) + "-state")
      << "beside others on this host";
}

TEST_F(AgentStateTest, DrawsAStreamEpochForEachStart) {
  std::set<uint32_t> epochs;
  for (int start = 0; start < 20; ++start) epochs.insert(OpenAndClose().stream_epoch);
  EXPECT_EQ(epochs.size(), 20u);
  EXPECT_GE(*epochs.begin(), 1u);
  EXPECT_LT(*epochs.rbegin(), 1u << 31);
  // A copy of the disk in another PC goes on with others.
  const TemporaryDirectory other;
  std::filesystem::copy(Directory() / "agent.state", other.path() / "agent.state");
  const auto copy = AgentState::Open(other.path(), "");
  ASSERT_THAT(copy, IsOk());
  const AgentIdentity original = OpenAndClose();
  EXPECT_EQ(copy->identity().incarnation, original.incarnation);
  EXPECT_NE(copy->identity().stream_epoch, original.stream_epoch);
}

TEST_F(AgentStateTest, KeepsASecondAgentOut) {
  {
    auto state = AgentState::Open(Directory(), "");
    ASSERT_THAT(state, IsOk());
    const AgentState moved = *std::move(state);
    EXPECT_THAT(AgentState::Open(Directory(), ""),
                StatusIs(absl::StatusCode::kAlreadyExists,
                         AllOf(HasSubstr(Directory().string()), HasSubstr("--state-dir"))));
  }
  EXPECT_EQ(OpenAndClose().incarnation, 2u);
}

TEST_F(AgentStateTest, RefusesADamagedFileInsteadOfBeginningAnew) {
  OpenAndClose();
  for (const char* text : {"", "agent_id=pc\n", "agent_id=pc\nincarnation=x\n", "incarnation=3\n",
                           "agent_id=p c\nincarnation=3\n", "agent_id=pc\nincarnation=-3\n",
                           "agent_id=pc\nincarnation=4294967295\n"}) {
    std::ofstream(Directory() / "agent.state", std::ios::trunc) << text;
    EXPECT_THAT(AgentState::Open(Directory(), ""),
                StatusIs(absl::StatusCode::kDataLoss, HasSubstr("agent.state")))
        << text;
  }
}

TEST_F(AgentStateTest, IsForItsUserOnlyAndFollowsNoLinks) {
  const mode_t mask = umask(0);
  OpenAndClose();
  umask(mask);
  struct stat about = {};
  for (const auto& [name, mode] :
       {std::pair{".", 0700u}, {"lock", 0600u}, {"agent.state", 0600u}, {"agent.secret", 0600u}}) {
    ASSERT_EQ(stat((Directory() / name).c_str(), &about), 0);
    EXPECT_EQ(about.st_mode & 0777, mode) << name;
  }
  const std::filesystem::path target = directory_.WriteFile("target", "untouched");
  for (const char* name : {"agent.state", "lock"}) {
    std::filesystem::remove(Directory() / name);
    std::filesystem::create_symlink(target, Directory() / name);
    EXPECT_FALSE(AgentState::Open(Directory(), "").ok()) << name;
    EXPECT_EQ(std::filesystem::file_size(target), 9u) << name;
    std::filesystem::remove(Directory() / name);
  }
  if (geteuid() != 0) return;
  ASSERT_EQ(chown(Directory().c_str(), 54321, 54321), 0);
  EXPECT_THAT(AgentState::Open(Directory(), ""),
              StatusIs(absl::StatusCode::kFailedPrecondition,
                       AllOf(HasSubstr(Directory().string()), HasSubstr("54321"))));
}

TEST_F(AgentStateTest, ADiskThatTakesAPartOnlyIsNoSuccess) {
  OpenAndClose();
  std::filesystem::remove(Directory() / "agent.secret");
  signal(SIGXFSZ, SIG_IGN);
  rlimit before = {};
  getrlimit(RLIMIT_FSIZE, &before);
  const rlimit limit = {10, before.rlim_max};
  setrlimit(RLIMIT_FSIZE, &limit);
  const auto state = AgentState::Open(Directory(), "");
  setrlimit(RLIMIT_FSIZE, &before);
  EXPECT_THAT(state, StatusIs(absl::StatusCode::kResourceExhausted, HasSubstr("agent.secret")));
  EXPECT_FALSE(std::filesystem::exists(Directory() / "agent.secret"));
}

TEST_F(AgentStateTest, IgnoresWhatAnInterruptedStartLeftBehind) {
  OpenAndClose();
  std::ofstream(Directory() / "agent.state.new") << "agent_id=half";
  EXPECT_EQ(OpenAndClose().incarnation, 2u);
}

TEST_F(AgentStateTest, NamesAFolderThatCannotBeMade) {
  const std::string file = directory_.WriteFile("file", "").string();
  EXPECT_THAT(AgentState::Open(std::filesystem::path(file) / "state", ""),
              StatusIs(absl::StatusCode::kFailedPrecondition, HasSubstr(file)));
}

TEST(AgentStateDefaultDirectory, FollowsTheEnvironment) {
  setenv("XDG_STATE_HOME", "/x/state", 1);
  setenv("HOME", "/home/u", 1);
  EXPECT_EQ(*AgentState::DefaultDirectory(""), "/x/state/rigcal/agent/default");
  EXPECT_EQ(*AgentState::DefaultDirectory("pc"), "/x/state/rigcal/agent/pc");
  setenv("XDG_STATE_HOME", "relative", 1);
  EXPECT_EQ(*AgentState::DefaultDirectory(""), "/home/u/.local/state/rigcal/agent/default");
  unsetenv("XDG_STATE_HOME");
  unsetenv("HOME");
  EXPECT_THAT(AgentState::DefaultDirectory(""),
              StatusIs(absl::StatusCode::kFailedPrecondition, HasSubstr("--state-dir")));
}

TEST(HostName, CanBePartOfAnAgentId) {
  EXPECT_FALSE(HostName().empty());
  EXPECT_EQ(HostName().find_first_not_of(
                "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789-"),
            std::string::npos);
}

}  // namespace
}  // namespace rigcal::agent::agent_state_test

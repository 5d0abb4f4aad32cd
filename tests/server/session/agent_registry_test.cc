// SPDX-License-Identifier: Apache-2.0
#include "server/session/agent_registry.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/stat.h>

#include <fstream>
#include <iterator>
#include <memory>
#include <string>

#include "tests/server/session/session_fixture.h"
#include "tests/testing/status_matchers.h"
#include "tests/testing/temporary_directory.h"

namespace rigcal::testing::agent_registry_test {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::Not;

class AgentRegistry : public ::testing::Test {
 protected:
  void SetUp() override { Open(); }
  void Open(server::AgentRegistryOptions options = {}) {
    options.file = file_;
    auto registry = server::AgentRegistry::Open(options);
    ASSERT_THAT(registry, IsOk());
    registry_ = *std::move(registry);
  }
  static AgentRecord Agent(const std::string& agent_id, const std::vector<std::string>& cameras,
                           const std::string& secret = "") {
    AgentRecord agent = MakeAgent(agent_id, cameras);
    agent.credential = server::CredentialOf(secret);
    return agent;
  }
  std::string Text() const {
    std::ifstream stream(file_);
    return {std::istreambuf_iterator<char>(stream), {}};
  }

  TemporaryDirectory directory_;
  const std::filesystem::path file_ = directory_.path() / "agents.json";
  std::unique_ptr<server::AgentRegistry> registry_;
};

TEST_F(AgentRegistry, ACameraBelongsToTheAgentThatCameFirst) {
  ASSERT_THAT(registry_->Remember(Agent("pc1", {"left", "right"})), IsOk());
  for (int i = 0; i < 2; ++i) {
    EXPECT_THAT(registry_->Remember(Agent("pc1", {"left", "right"})), IsOk());
    EXPECT_THAT(registry_->Remember(Agent("pc2", {"top", "right"})),
                StatusIs(absl::StatusCode::kAlreadyExists,
                         AllOf(HasSubstr("rig/right"), HasSubstr("'pc1'"), HasSubstr("'pc2'"),
                               HasSubstr("rigcal camera move right pc2"))));
    EXPECT_EQ(registry_->OwnerOf("rig", "top"), "") << "a refused agent gets nothing";
    EXPECT_EQ(registry_->OwnerOf("rig", "right"), "pc1");
    Open();  // as after a restart
  }
  AgentRecord elsewhere = Agent("pc2", {"right"});
  elsewhere.rig = "other";
  EXPECT_THAT(registry_->Remember(elsewhere), IsOk()) << "a camera of another rig is another one";
}

TEST_F(AgentRegistry, ACameraIsMovedByName) {
  ASSERT_THAT(registry_->Remember(Agent("pc1", {"left"})), IsOk());
  ASSERT_OK_AND_ASSIGN(const std::string before, registry_->Move("rig", "left", "pc2"));
  EXPECT_EQ(before, "pc1");
  Open();
  EXPECT_THAT(registry_->Check(Agent("pc2", {"left"})), IsOk());
  EXPECT_THAT(registry_->Check(Agent("pc1", {"left"})),
              StatusIs(absl::StatusCode::kAlreadyExists, HasSubstr("'pc2'")));
  ASSERT_OK_AND_ASSIGN(const std::string none, registry_->Move("rig", "new", "pc2"));
  EXPECT_EQ(none, "");
  for (const auto& [camera, agent] :
       {std::pair{"", "pc1"}, {"left", ""}, {"a b", "pc1"}, {"left", "x\ny"}}) {
    EXPECT_THAT(registry_->Move("rig", camera, agent),
                StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("")));
  }
}

TEST_F(AgentRegistry, AnIdBelongsToTheInstallationThatCameFirst) {
  ASSERT_THAT(registry_->Remember(Agent("pc1", {"left"}, "secret")), IsOk());
  Open();
  EXPECT_THAT(registry_->Check(Agent("pc1", {"left"}, "secret")), IsOk());
  for (const char* other : {"", "guess"}) {
    AgentRecord thief = Agent("pc1", {"left"}, other);
    thief.host = "laptop\n";
    thief.incarnation = 4'000'000'000;
    EXPECT_THAT(registry_->Check(thief),
                StatusIs(absl::StatusCode::kAlreadyExists,
                         AllOf(HasSubstr("laptop"), HasSubstr(MakeAgent("pc1", {}).host),
                               Not(HasSubstr("\n")))));
  }
  AgentRecord with_certificate = Agent("pc1", {"left"});
  with_certificate.credential = std::string(server::kCertificateCredential);
  EXPECT_THAT(registry_->Check(with_certificate), IsOk()) << "the certificate names it";
  EXPECT_THAT(Text(), Not(HasSubstr("\"secret\""))) << "only its hash is kept";
}

TEST_F(AgentRegistry, SaysWhoHasAName) {
  EXPECT_EQ(registry_->HolderOf("pc1"), "");
  ASSERT_THAT(registry_->Remember(Agent("pc1", {"a", "b", "c", "d", "e"}, "secret")), IsOk());
  ASSERT_THAT(registry_->Remember(Agent("pc2", {"top"})), IsOk());
  EXPECT_EQ(registry_->HolderOf("pc1"),
            "on host 'host-of-pc1', with camera rig/a, rig/b, rig/c and 2 more");
  EXPECT_EQ(registry_->HolderOf("pc2"), "with camera rig/top");
}

TEST_F(AgentRegistry, AForgottenAgentLeavesItsNameAndCameras) {
  ASSERT_THAT(registry_->Remember(Agent("pc1", {"left"}, "secret")), IsOk());
  ASSERT_THAT(registry_->Remember(Agent("pc2", {"right"}, "secret")), IsOk());
  ASSERT_OK_AND_ASSIGN(const bool known, registry_->Forget("pc1"));
  EXPECT_TRUE(known);
  Open();
  EXPECT_EQ(registry_->HolderOf("pc1"), "");
  EXPECT_THAT(registry_->Check(Agent("pc1", {"left"}, "another")), IsOk());
  EXPECT_EQ(registry_->OwnerOf("rig", "right"), "pc2");
  ASSERT_OK_AND_ASSIGN(const bool again, registry_->Forget("pc1"));
  EXPECT_FALSE(again);
}

// It has replaced the agent that had the name without one.
TEST_F(AgentRegistry, ACertificateTakesTheNameFromWhoHadItWithout) {
  ASSERT_THAT(registry_->Remember(Agent("pc1", {"left"}, "plain")), IsOk());
  AgentRecord joined = Agent("pc1", {"left"});
  joined.credential = std::string(server::kCertificateCredential) + server::CredentialOf("joined");
  ASSERT_THAT(registry_->Remember(joined), IsOk());
  Open();
  EXPECT_THAT(registry_->Check(Agent("pc1", {"left"}, "plain")),
              StatusIs(absl::StatusCode::kAlreadyExists, HasSubstr("'pc1'")));
  EXPECT_THAT(registry_->Check(Agent("pc1", {"left"}, "joined")), IsOk())
      << "the same installation, on the server's PC";
  EXPECT_THAT(registry_->Check(joined), IsOk());
}

TEST_F(AgentRegistry, AnAgentWithoutSecretGetsOneLater) {
  ASSERT_THAT(registry_->Remember(Agent("pc1", {"left"})), IsOk());
  ASSERT_THAT(registry_->Remember(Agent("pc1", {"left"}, "secret")), IsOk());
  EXPECT_THAT(registry_->Check(Agent("pc1", {"left"})),
              StatusIs(absl::StatusCode::kAlreadyExists, HasSubstr("")));
}

TEST_F(AgentRegistry, ItsSizeIsBounded) {
  Open({.max_agents = 2, .max_cameras_per_agent = 3});
  ASSERT_THAT(registry_->Remember(Agent("pc1", {"a", "b", "c"}, "1")), IsOk());
  EXPECT_THAT(registry_->Remember(Agent("pc1", {"d"}, "1")),
              StatusIs(absl::StatusCode::kResourceExhausted, HasSubstr("'pc1'")));
  EXPECT_THAT(registry_->Move("rig", "d", "pc1"),
              StatusIs(absl::StatusCode::kResourceExhausted, HasSubstr("'pc1'")));
  ASSERT_THAT(registry_->Remember(Agent("pc2", {"e"}, "2")), IsOk());
  EXPECT_THAT(registry_->Remember(Agent("pc3", {"f"}, "3")),
              StatusIs(absl::StatusCode::kResourceExhausted, HasSubstr("'pc3'")));
  EXPECT_THAT(registry_->Check(Agent("pc1", {"a"}, "1")), IsOk());
}

TEST_F(AgentRegistry, TheFileIsForThisUserAndADamagedOneIsNamed) {
  ASSERT_THAT(registry_->Remember(Agent("pc1", {"left"}, "secret")), IsOk());
  struct stat status {};
  ASSERT_EQ(stat(file_.c_str(), &status), 0);
  EXPECT_EQ(status.st_mode & 0777, 0600u);
  for (const std::string& damaged :
       {std::string(), std::string("{"), std::string("[]"),
        std::string(R"({"agents": [{}], "cameras": []})"), std::string(1'000'000, '[')}) {
    std::ofstream(file_) << damaged;
    EXPECT_THAT(server::AgentRegistry::Open({.file = file_}),
                StatusIs(absl::StatusCode::kDataLoss, HasSubstr("agents.json")))
        << damaged;
  }
}

TEST_F(AgentRegistry, WhatCannotBeWrittenIsNotTrueEither) {
  auto registry = server::AgentRegistry::Open({.file = directory_.path() / "missing" / "a.json"});
  ASSERT_THAT(registry, IsOk());
  EXPECT_FALSE((*registry)->Remember(Agent("pc1", {"left"})).ok());
  EXPECT_EQ((*registry)->OwnerOf("rig", "left"), "");
}

}  // namespace
}  // namespace rigcal::testing::agent_registry_test

// SPDX-License-Identifier: Apache-2.0
#include "common/wire/server_access.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include <cstdlib>
#include <cstring>
#include <string>

#include "tests/testing/status_matchers.h"
#include "tests/testing/temporary_directory.h"
#include "tests/testing/test_ca.h"

namespace rigcal::wire::server_access_test {
namespace {

using ::rigcal::testing::IsOk;
using ::rigcal::testing::StatusIs;
using ::testing::AllOf;
using ::testing::HasSubstr;

class ServerAccess : public ::testing::Test {
 protected:
  void SetUp() override {
    for (const char* name : {"XDG_DATA_HOME", "XDG_CONFIG_HOME"}) {
      setenv(name, (directory_.path() / name).c_str(), 1);
    }
    std::filesystem::create_directories(data());
    std::filesystem::create_directories(identity_.folder);
  }
  void TearDown() override {
    unsetenv("XDG_DATA_HOME");
    unsetenv("XDG_CONFIG_HOME");
  }
  std::filesystem::path data() const { return directory_.path() / "XDG_DATA_HOME" / "rigcal"; }
  void WriteIdentity(const std::string& name, const std::string& text) const {
    directory_.WriteFile("state/identity/" + name, text);
  }
  void Join(const std::string& servers) const {
    const testing::TestCertificate agent = ca_.MakeAgent("pc1");
    WriteIdentity("ca.crt", ca_.certificate_pem());
    WriteIdentity("agent.crt", agent.certificate_pem);
    WriteIdentity("agent.key", agent.key_pem);
    WriteIdentity("servers.json", servers);
  }

  testing::TemporaryDirectory directory_;
  const testing::TestCa ca_;
  const ClientIdentity identity_ = ClientIdentity::OfAgent(directory_.path() / "state");
};

TEST_F(ServerAccess, KnowsThisMachine) {
  for (const char* here :
       {"127.0.0.1:7420", "127.9.9.9:1", "localhost:7420", "[::1]:7420", "unix:/run/rigcal.sock"}) {
    EXPECT_TRUE(IsOnThisMachine(here)) << here;
  }
  for (const char* there : {"10.0.0.5:7420", "localhost.example.org:1", "[fe80::1]:7420",
                            "127.0.0.1.example.org:1", "pc:7420", ""}) {
    EXPECT_FALSE(IsOnThisMachine(there)) << there;
  }
}

TEST_F(ServerAccess, AnotherMachineNeedsAnIdentity) {
  EXPECT_THAT(CredentialsFor("127.0.0.1:7420", identity_), IsOk());
  EXPECT_THAT(CredentialsFor("unix:/x", identity_), IsOk());
  // A certificate would not help.
  EXPECT_THAT(CredentialsFor("nobody.invalid:7420", identity_),
              StatusIs(absl::StatusCode::kUnavailable, HasSubstr("'nobody.invalid'")));
  EXPECT_THAT(CredentialsFor("10.0.0.5:7420", identity_),
              StatusIs(absl::StatusCode::kFailedPrecondition,
                       AllOf(HasSubstr("10.0.0.5:7420"), HasSubstr("rigcal-agent join"))));
  EXPECT_THAT(CredentialsFor("10.0.0.5:7420", ClientIdentity::OfUser()),
              StatusIs(absl::StatusCode::kFailedPrecondition, HasSubstr("rigcal login")));
  Join(R"({"grpc": [], "https": []})");
  EXPECT_THAT(CredentialsFor("10.0.0.5:7420", identity_), IsOk());
  WriteIdentity("agent.key", "");
  EXPECT_THAT(CredentialsFor("10.0.0.5:7420", identity_),
              StatusIs(absl::StatusCode::kFailedPrecondition, HasSubstr("agent.key")));
  EXPECT_THAT(CredentialsFor("127.0.0.1:7420", identity_), IsOk()) << "needs none";
}

// gRPC would trust each of them.
TEST_F(ServerAccess, AnIdentityThatTrustsTwoIsNotUsed) {
  Join(R"({"grpc": [], "https": []})");
  const testing::TestCa other;
  WriteIdentity("ca.crt", ca_.certificate_pem() + other.certificate_pem());
  EXPECT_THAT(CredentialsFor("10.0.0.5:7420", identity_),
              StatusIs(absl::StatusCode::kFailedPrecondition,
                       AllOf(HasSubstr("ca.crt holds 2 PEM blocks"), HasSubstr("join again"))));
}

TEST_F(ServerAccess, AServerOnThisMachineThatWasJoinedIsReachedWithTls) {
  Join(R"({"grpc": ["127.0.0.1:7420"], "https": []})");
  WriteIdentity("agent.key", "");
  EXPECT_THAT(CredentialsFor("127.0.0.1:7420", identity_),
              StatusIs(absl::StatusCode::kFailedPrecondition, HasSubstr("agent.key")));
  EXPECT_THAT(CredentialsFor("127.0.0.1:7421", identity_), IsOk());
}

TEST_F(ServerAccess, TheDefaultIsTheServerJoinedOrTheOneOfThisUser) {
  EXPECT_EQ(DefaultServerAddress(identity_), "127.0.0.1:7420");
  const std::string path = (data() / "rigcal.sock").string();
  sockaddr_un address{};
  address.sun_family = AF_UNIX;
  ASSERT_LT(path.size(), sizeof(address.sun_path));
  std::strcpy(address.sun_path, path.c_str());
  const int server = socket(AF_UNIX, SOCK_STREAM, 0);
  ASSERT_EQ(bind(server, reinterpret_cast<sockaddr*>(&address), sizeof(address)), 0);
  EXPECT_EQ(DefaultServerAddress(identity_), "127.0.0.1:7420") << "left by a killed server";
  ASSERT_EQ(listen(server, 1), 0);
  EXPECT_EQ(DefaultServerAddress(identity_), "unix:" + path);
  Join(R"({"grpc": ["10.0.0.5:7420", "10.0.0.6:7420"]})");
  EXPECT_EQ(DefaultServerAddress(identity_), "10.0.0.5:7420");
  for (const char* damaged : {"", "{", "[]", R"({"grpc": [1]})", R"({"grpc": 1})"}) {
    WriteIdentity("servers.json", damaged);
    EXPECT_EQ(DefaultServerAddress(identity_), "unix:" + path) << damaged;
  }
  close(server);
}

}  // namespace
}  // namespace rigcal::wire::server_access_test

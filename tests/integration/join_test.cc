// SPDX-License-Identifier: Apache-2.0
// Joining from the first command to the last, with the real programs on loopback.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <csignal>
#include <fstream>
#include <iterator>
#include <memory>
#include <string>

#include "absl/time/clock.h"
#include "common/identity/certificate_request.h"
#include "common/identity/identity_folder.h"
#include "server/identity/server_identity.h"
#include "tests/testing/issued_before.h"
#include "tests/testing/process.h"
#include "tests/testing/temporary_directory.h"

namespace rigcal::testing::join_test {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::Not;

std::string FileText(const std::filesystem::path& path) {
  std::ifstream stream(path);
  return {std::istreambuf_iterator<char>(stream), {}};
}

class Join : public ::testing::Test {
 protected:
  void SetUp() override { StartServer("[https]\nlisten = \"127.0.0.1:0\"\n"); }

  void StartServer(const std::string& more_config) {
    const auto config = directory_.WriteFile(
        "server.toml", "listen = \"127.0.0.1:0\"\ndata_dir = \"data\"\n" + more_config);
    const std::filesystem::path port_file = directory_.path() / "port";
    std::filesystem::remove(port_file);
    server_ = std::make_unique<Process>(Process::Options{
        {"rigcal-server", "--config", config.string(), "--port-file", port_file.string()}, {}});
    ASSERT_TRUE(WaitFor([&] { return !FileText(port_file).empty() || !server_->Running(); }));
    ASSERT_TRUE(server_->Running()) << server_->StandardError();
    address_ = "127.0.0.1:" + std::to_string(std::stoi(FileText(port_file)));
  }
  void StopServer() {
    server_->Signal(SIGTERM);
    ASSERT_EQ(server_->Wait(), 0);
  }
  // On the server's own PC.
  CommandResult Admin(std::vector<std::string> arguments) {
    arguments.insert(arguments.begin(), "rigcal");
    return RunCommand(arguments, {{"RIGCAL_SERVER", address_}, {"XDG_CONFIG_HOME", path("admin")}});
  }
  // As a user elsewhere, who has no server in his environment.
  CommandResult User(std::vector<std::string> arguments) {
    arguments.insert(arguments.begin(), "rigcal");
    return RunCommand(arguments, {{"RIGCAL_SERVER", ""},
                                  {"XDG_CONFIG_HOME", path("user")},
                                  {"XDG_STATE_HOME", path("state")}});
  }
  // On a PC without avahi-daemon.
  CommandResult JoinAgent(std::vector<std::string> arguments) {
    arguments.insert(arguments.begin(), {"rigcal-agent", "join", "--state-dir", path("agent")});
    return RunCommand(arguments, {{"DBUS_SYSTEM_BUS_ADDRESS", "unix:path=/nowhere"}});
  }
  std::string Token(std::vector<std::string> options = {}) {
    options.insert(options.begin(), {"token", "create"});
    const CommandResult made = Admin(options);
    EXPECT_EQ(made.exit_code, 0) << made.error;
    return made.output.substr(0, made.output.find('\n'));
  }
  // Of the only agent; "none": the server knows none.
  std::string AgentState() {
    const std::string list = Admin({"agent", "list"}).output;
    for (const char* state : {"connected", "gone"}) {
      if (list.find(state) != std::string::npos) return state;
    }
    return "none";
  }
  std::string path(const char* name) const { return (directory_.path() / name).string(); }

  const TemporaryDirectory directory_;
  std::unique_ptr<Process> server_;
  std::string address_;
};

TEST_F(Join, AnAgentJoinsAndIsForgotten) {
  const CommandResult joined = JoinAgent({Token(), "--agent-id", "pc-1"});
  ASSERT_EQ(joined.exit_code, 0) << joined.error;
  EXPECT_THAT(joined.output, AllOf(HasSubstr("pc-1"), HasSubstr(address_)));
  const CommandResult again = JoinAgent({Token()});
  EXPECT_EQ(again.exit_code, 1);
  EXPECT_THAT(again.error, HasSubstr("--force"));
  const CommandResult taken = JoinAgent({Token(), "--force"});
  EXPECT_EQ(taken.exit_code, 1);
  EXPECT_THAT(taken.error, HasSubstr("--name pc-1"));
  EXPECT_EQ(JoinAgent({Token({"--name", "pc-1"}), "--force"}).exit_code, 0);

  // Without --server: it knows where, and has a certificate for it.
  Process agent({{"rigcal-agent", "--state-dir", path("agent"), "--source", "sim:camera=0"}, {}});
  ASSERT_TRUE(WaitFor([&] { return AgentState() == "connected"; })) << agent.StandardError();
  const CommandResult forgotten = Admin({"agent", "forget", "pc-1"});
  EXPECT_EQ(forgotten.exit_code, 0) << forgotten.error;
  EXPECT_TRUE(WaitFor([&] { return AgentState() == "gone"; })) << "its connection is cut";
  EXPECT_TRUE(agent.Running());
  EXPECT_TRUE(
      WaitFor([&] { return agent.StandardError().find("was revoked") != std::string::npos; },
              std::chrono::seconds(100)))
      << agent.StandardError();
  EXPECT_THAT(FileText(directory_.path() / "data/identity/denied.json"),
              HasSubstr("rigcal://agents/pc-1"));
  EXPECT_THAT(FileText(directory_.path() / "data/audit.jsonl"),
              AllOf(HasSubstr("enrol"), HasSubstr("rigcal://agents/pc-1")));
  const CommandResult unknown = Admin({"agent", "forget", "pc-2"});
  EXPECT_EQ(unknown.exit_code, 0) << unknown.error;
  EXPECT_THAT(unknown.output, AllOf(HasSubstr("pc-2"), HasSubstr("not on record")));
}

// 25 of 30 days have passed.
TEST_F(Join, AnAgentRenewsItsCertificateWhileItCaptures) {
  ASSERT_EQ(JoinAgent({Token(), "--agent-id", "pc-1"}).exit_code, 0);
  const IdentityFolder folder = IdentityFolder::OfAgent(directory_.path() / "agent");
  PeerIdentity identity = *folder.Load();
  identity.certificate_pem =
      IssuedBefore(server::IdentityDirectory(directory_.path() / "data"),
                   {Role::kAgent, "pc-1", PublicKeyOf(identity.certificate_pem)},
                   absl::Now() - absl::Hours(24 * 25));
  ASSERT_TRUE(folder.Renew(identity).ok());
  Process agent({{"rigcal-agent", "--state-dir", path("agent"), "--source", "sim:camera=0"}, {}});
  EXPECT_TRUE(WaitFor([&] { return folder.Load()->certificate_pem != identity.certificate_pem; }))
      << agent.StandardError();
  EXPECT_TRUE(WaitFor([&] {
    return agent.StandardError().find("connecting again") != std::string::npos;
  })) << agent.StandardError();
  EXPECT_TRUE(WaitFor([&] { return AgentState() == "connected"; })) << agent.StandardError();
  agent.Signal(SIGTERM);
  EXPECT_EQ(agent.Wait(), 0) << agent.StandardError();
}

TEST_F(Join, AUserLogsInAndDoesWhatHisRoleAllows) {
  const std::string token = Token({"--role", "operator"});
  const CommandResult in = User({"login", token, "--name", "anna"});
  ASSERT_EQ(in.exit_code, 0) << in.error;
  EXPECT_THAT(in.output, AllOf(HasSubstr("anna (operator)"), HasSubstr(address_)));
  const CommandResult sessions = User({"session", "list"});
  EXPECT_EQ(sessions.exit_code, 0) << sessions.error;
  const CommandResult not_allowed = User({"token", "list"});
  EXPECT_EQ(not_allowed.exit_code, 4);
  EXPECT_THAT(not_allowed.error, AllOf(HasSubstr("anna"), HasSubstr("admin")));
  const CommandResult doctor = User({"doctor"});
  EXPECT_THAT(doctor.output, HasSubstr("the server takes this user's certificate"));

  const CommandResult list = Admin({"token", "list"});
  EXPECT_THAT(list.output,
              AllOf(HasSubstr("used"), HasSubstr("rigcal://users/anna"), Not(HasSubstr(token))));
  const std::string id = list.output.substr(list.output.find("t-"), 10);
  EXPECT_EQ(Admin({"token", "revoke", id}).exit_code, 0);
  EXPECT_TRUE(WaitFor([&] { return User({"session", "list"}).exit_code != 0; }));
  // The last line is the cause.
  const std::string error = User({"session", "list"}).error;
  EXPECT_THAT(error.substr(error.rfind('\n', error.size() - 2) + 1),
              HasSubstr("the certificate of rigcal://users/anna was revoked"));
  const CommandResult why = User({"doctor"});
  EXPECT_NE(why.exit_code, 0);
  EXPECT_THAT(why.output, AllOf(HasSubstr("revoked"), HasSubstr("rigcal login")));
}

// F9: an agent on the server's PC needs no certificate, and has a name and cameras.
TEST_F(Join, AStringWithoutANameTakesNoAgentsPlace) {
  Process plain({{"rigcal-agent", "--server", address_, "--agent-id", "pc-1", "--state-dir",
                  path("plain"), "--source", "sim:camera=0"},
                 {}});
  ASSERT_TRUE(WaitFor([&] { return AgentState() == "connected"; })) << plain.StandardError();
  const CommandResult taken = JoinAgent({Token(), "--agent-id", "pc-1"});
  EXPECT_EQ(taken.exit_code, 1);
  EXPECT_THAT(taken.error, AllOf(HasSubstr("rig/sim_0"), HasSubstr("--name pc-1"),
                                 HasSubstr("rigcal agent forget pc-1")));
  plain.Signal(SIGTERM);
  EXPECT_EQ(plain.Wait(), 0) << plain.StandardError();
  const CommandResult forgotten = Admin({"agent", "forget", "pc-1"});
  EXPECT_EQ(forgotten.exit_code, 0) << forgotten.error;
  const CommandResult joined = JoinAgent({Token(), "--agent-id", "pc-1"});
  EXPECT_EQ(joined.exit_code, 0) << joined.error;
}

// F1: a folder in which a second CA was left by an earlier version.
TEST_F(Join, AFolderThatTrustsTwoIsNamedAndNotUsed) {
  const std::string state = path("state") + "/rigcal/agent/default";
  ASSERT_EQ(User({"login", Token({"--role", "operator"}), "--name", "anna"}).exit_code, 0);
  ASSERT_EQ(
      RunCommand({"rigcal-agent", "join", Token(), "--agent-id", "pc-1", "--state-dir", state})
          .exit_code,
      0);
  EXPECT_THAT(User({"doctor"}).output, HasSubstr("agent pc-1: its server takes its certificate"));
  const TemporaryDirectory elsewhere;
  const std::string other = server::CertificateAuthority::Open(elsewhere.path())->pem();
  for (const std::string& folder : {path("user") + "/rigcal/identity", state + "/identity"}) {
    std::ofstream(folder + "/ca.crt", std::ios::app) << other;
    const CommandResult doctor = User({"doctor", address_});
    EXPECT_NE(doctor.exit_code, 0);
    EXPECT_THAT(doctor.output, AllOf(HasSubstr(folder), HasSubstr("ca.crt holds 2 PEM blocks"),
                                     HasSubstr("join again")));
  }
  const CommandResult agent =
      RunCommand({"rigcal-agent", "--state-dir", state, "--source", "sim:camera=0"});
  EXPECT_EQ(agent.exit_code, 1);
  EXPECT_THAT(agent.error,
              AllOf(HasSubstr("ca.crt holds 2 PEM blocks"), HasSubstr("rigcal-agent join STRING")));
}

TEST_F(Join, WrongStringsAreExplained) {
  const std::string token = Token();
  std::string typo = token;
  typo[20] = typo[20] == 'A' ? 'B' : 'A';
  const CommandResult mistyped = JoinAgent({typo});
  EXPECT_EQ(mistyped.exit_code, 2);
  EXPECT_THAT(mistyped.error, HasSubstr("typo"));
  const CommandResult wrong_program = User({"login", token});
  EXPECT_EQ(wrong_program.exit_code, 1);
  EXPECT_THAT(wrong_program.error, HasSubstr("rigcal-agent join"));
  const CommandResult other_program = JoinAgent({Token({"--role", "viewer"})});
  EXPECT_EQ(other_program.exit_code, 2);
  EXPECT_THAT(other_program.error, HasSubstr("rigcal login"));
  EXPECT_EQ(JoinAgent({token}).exit_code, 0);
  const CommandResult used = JoinAgent({token, "--force"});
  EXPECT_EQ(used.exit_code, 1);
  EXPECT_THAT(used.error, HasSubstr("already used"));
  EXPECT_EQ(Admin({"token", "create", "--ttl", "31d"}).exit_code, 2);
  EXPECT_EQ(Admin({"token", "create", "--role", "admin"}).exit_code, 2);
}

TEST_F(Join, AServerThatIsGoneIsExplained) {
  const std::string token = Token();
  StopServer();
  const CommandResult gone = JoinAgent({token});
  EXPECT_EQ(gone.exit_code, 1);
  EXPECT_THAT(gone.error, AllOf(HasSubstr("refused"), HasSubstr("firewall")));
}

TEST_F(Join, AServerAtAnotherAddressThanTheStringSaysIsNamed) {
  const std::string token = Token();
  StopServer();
  StartServer("[https]\nlisten = \"127.0.0.1:0\"\n[discovery]\nmdns = true\n");
  // Of this PC only, for which nobody need look.
  EXPECT_TRUE(WaitFor([&] {
    return server_->StandardError().find("does not announce itself") != std::string::npos;
  })) << server_->StandardError();
  const CommandResult elsewhere = JoinAgent({token});
  EXPECT_EQ(elsewhere.exit_code, 1);
  EXPECT_THAT(elsewhere.error,
              AllOf(HasSubstr("refused"), HasSubstr("mDNS"), HasSubstr("--server HOST:PORT")));
  EXPECT_EQ(JoinAgent({token, "--server", "nowhere"}).exit_code, 2);
  const std::string log = server_->StandardError();
  const std::string before = "HTTPS port ";
  const int port = std::stoi(log.substr(log.find(before) + before.size()));
  const CommandResult joined = JoinAgent({token, "--server", "127.0.0.1:" + std::to_string(port)});
  EXPECT_EQ(joined.exit_code, 0) << joined.error;
}

TEST_F(Join, WithoutAStringSaysWhereToGetOne) {
  const CommandResult nothing = JoinAgent({});
  EXPECT_EQ(nothing.exit_code, 2);
  EXPECT_THAT(nothing.output, HasSubstr("mDNS"));
  EXPECT_THAT(nothing.error, HasSubstr("rigcal token create"));
}

TEST_F(Join, AServerOfOnePcMakesNoStrings) {
  StopServer();
  StartServer("");
  const CommandResult refused = Admin({"token", "create"});
  EXPECT_EQ(refused.exit_code, 1);
  EXPECT_THAT(refused.error, HasSubstr("--listen 0.0.0.0"));
}

}  // namespace
}  // namespace rigcal::testing::join_test

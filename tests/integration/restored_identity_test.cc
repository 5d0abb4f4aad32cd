// SPDX-License-Identifier: Apache-2.0
// T17: a backup that was made before somebody joined, was forgotten and used a join string is
// restored; then each of them tries, with the real programs on loopback.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <csignal>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <memory>
#include <string>

#include "tests/testing/process.h"
#include "tests/testing/temporary_directory.h"

namespace rigcal::testing::restored_identity_programs_test {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::Not;

class RestoredIdentityPrograms : public ::testing::Test {
 protected:
  void SetUp() override {
    // Fixed ports: who has joined finds the server again.
    StartServer("127.0.0.1:0");
  }
  void StartServer(const std::string& listen) {
    const auto config = directory_.WriteFile(
        "server.toml", "listen = \"" + listen +
                           "\"\ndata_dir = \"data\"\n[https]\nlisten = \"127.0.0.1:" + https_port_ +
                           "\"\n");
    for (const char* file : {"port", "http_port"}) std::filesystem::remove(path(file));
    server_ = std::make_unique<Process>(
        Process::Options{{"rigcal-server", "--config", config.string(), "--port-file", path("port"),
                          "--http-port-file", path("http_port")},
                         {}});
    ASSERT_TRUE(WaitFor([&] { return !Text("port").empty() || !server_->Running(); }));
    ASSERT_TRUE(server_->Running()) << server_->StandardError();
    address_ = "127.0.0.1:" + std::to_string(std::stoi(Text("port")));
    https_port_ = std::to_string(std::stoi(Text("http_port")));
  }
  void StopServer() {
    server_->Signal(SIGTERM);
    ASSERT_EQ(server_->Wait(), 0) << server_->StandardError();
  }
  CommandResult Care(std::vector<std::string> arguments) {
    arguments.insert(arguments.begin(), "rigcal-server");
    arguments.insert(arguments.end(), {"--data-dir", path("data")});
    return RunCommand(arguments);
  }
  // On the server's own PC.
  CommandResult Admin(std::vector<std::string> arguments) {
    arguments.insert(arguments.begin(), "rigcal");
    return RunCommand(arguments, {{"RIGCAL_SERVER", address_}, {"XDG_CONFIG_HOME", path("admin")}});
  }
  // A user elsewhere, with a certificate of his own.
  CommandResult User(const std::string& name, std::vector<std::string> arguments) {
    arguments.insert(arguments.begin(), "rigcal");
    return RunCommand(arguments, {{"RIGCAL_SERVER", ""}, {"XDG_CONFIG_HOME", path(name)}});
  }
  std::string Token() {
    const CommandResult made = Admin({"token", "create", "--role", "operator"});
    EXPECT_EQ(made.exit_code, 0) << made.error;
    return made.output.substr(0, made.output.find('\n'));
  }
  CommandResult Login(const std::string& name, const std::string& token) {
    return User(name, {"login", token, "--name", name});
  }
  bool IsLetIn(const std::string& name) { return User(name, {"session", "list"}).exit_code == 0; }
  std::string path(const std::string& name) const { return (directory_.path() / name).string(); }
  std::string Text(const std::string& name) const {
    std::ifstream stream(path(name));
    return {std::istreambuf_iterator<char>(stream), {}};
  }

  const TemporaryDirectory directory_;
  std::unique_ptr<Process> server_;
  std::string address_;
  std::string https_port_ = "0";
};

TEST_F(RestoredIdentityPrograms, NobodyIsLetInAgain) {
  ASSERT_EQ(Login("anna", Token()).exit_code, 0);
  ASSERT_EQ(Login("bob", Token()).exit_code, 0);
  const std::string used = Token();
  const std::string open = Token();
  const CommandResult backup = Care({"backup", path("old.rigcal")});
  ASSERT_EQ(backup.exit_code, 0) << backup.error;
  // Of the tokens, bob's is the second.
  const std::string list = Admin({"token", "list"}).output;
  const size_t row = list.rfind("t-", list.find("rigcal://users/bob"));
  EXPECT_EQ(Admin({"token", "revoke", list.substr(row, 10)}).exit_code, 0);
  ASSERT_EQ(Login("carl", used).exit_code, 0);
  EXPECT_TRUE(IsLetIn("anna"));
  EXPECT_FALSE(IsLetIn("bob"));
  EXPECT_TRUE(IsLetIn("carl"));

  StopServer();
  const CommandResult restored = Care({"restore", path("old.rigcal")});
  ASSERT_EQ(restored.exit_code, 0) << restored.error;
  EXPECT_THAT(restored.output,
              AllOf(HasSubstr("rigcal://users/carl joined after the backup"),
                    HasSubstr("stays so (1 join string,"), Not(HasSubstr("rigcal://users/anna"))));
  StartServer(address_);
  EXPECT_TRUE(IsLetIn("anna"));
  EXPECT_FALSE(IsLetIn("bob"));
  EXPECT_FALSE(IsLetIn("carl"));
  EXPECT_THAT(User("carl", {"doctor"}).output, HasSubstr("rigcal login"));
  const CommandResult again = Login("dora", used);
  EXPECT_NE(again.exit_code, 0);
  EXPECT_THAT(again.error, HasSubstr("was already used"));
  EXPECT_EQ(Login("dora", open).exit_code, 0);
  EXPECT_TRUE(IsLetIn("dora"));
  // The one who lost his place takes it again with a string of his own.
  EXPECT_EQ(Login("carl", Token()).exit_code, 0);
  EXPECT_TRUE(IsLetIn("carl"));

  // Into a folder that knows nothing, nobody can tell who was revoked since: that is said.
  StopServer();
  std::filesystem::rename(path("data"), path("lost"));
  const CommandResult blind = Care({"restore", path("old.rigcal")});
  ASSERT_EQ(blind.exit_code, 0) << blind.error;
  EXPECT_THAT(blind.output, HasSubstr("revoke whom you do not want"));
}

}  // namespace
}  // namespace rigcal::testing::restored_identity_programs_test

// SPDX-License-Identifier: Apache-2.0
// The programs with certificates, as joining a server leaves them on a PC.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <iterator>
#include <string>

#include "tests/testing/process.h"
#include "tests/testing/temporary_directory.h"
#include "tests/testing/test_ca.h"

namespace rigcal::testing::tls_programs_test {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;

class TlsPrograms : public ::testing::Test {
 protected:
  TlsPrograms() { ca_.WriteServerFolder(store() / "identity", ca_.MakeServer()); }

  std::filesystem::path store() const { return directory_.path() / "store"; }
  void WriteIdentity(const std::filesystem::path& folder, const std::string& stem,
                     const TestCertificate& certificate, const std::string& server) const {
    std::filesystem::create_directories(folder);
    ReplaceTestFile(folder / "ca.crt", ca_.certificate_pem());
    ReplaceTestFile(folder / (stem + ".crt"), certificate.certificate_pem);
    ReplaceTestFile(folder / (stem + ".key"), certificate.key_pem);
    ReplaceTestFile(folder / "servers.json", R"({"grpc": [")" + server + R"("], "https": []})");
  }
  std::string Audit() const {
    std::ifstream stream(store() / "audit.jsonl");
    return {std::istreambuf_iterator<char>(stream), {}};
  }
  CommandResult Rigcal(std::vector<std::string> arguments) const {
    arguments.insert(arguments.begin(), "rigcal");
    return RunCommand(arguments, {{"XDG_CONFIG_HOME", (directory_.path() / "config").string()}});
  }

  TemporaryDirectory directory_;
  TestCa ca_;
};

TEST_F(TlsPrograms, UseWhatJoiningHasLeftAndNameWhatIsRefused) {
  ServerProcess server(store());
  const TestCertificate own = ca_.MakeAgent("pc1");
  const auto state = directory_.path() / "state";
  WriteIdentity(state / "identity", "agent", own, server.address());
  WriteIdentity(directory_.path() / "config" / "rigcal" / "identity", "user",
                ca_.MakeUser("kim", "viewer"), server.address());
  Process agent({{"rigcal-agent", "--agent-id", "pc1", "--state-dir", state.string(), "--source",
                  "sim:camera=0"},
                 {}});
  ASSERT_TRUE(WaitFor([&] {
    return Audit().find("agent 'pc1' (certificate " + own.serial + ")") != std::string::npos;
  })) << agent.StandardError();
  const CommandResult list = Rigcal({"agent", "list"});
  EXPECT_EQ(list.exit_code, 0) << list.error;
  EXPECT_THAT(list.output, AllOf(HasSubstr("pc1"), HasSubstr("connected")));
  const CommandResult refused = Rigcal({"camera", "move", "sim_0", "pc2"});
  EXPECT_NE(refused.exit_code, 0);
  EXPECT_THAT(refused.error, AllOf(HasSubstr("user 'kim'"), HasSubstr("role viewer")));

  ReplaceTestFile(store() / "identity" / "denied.json",
                  R"({"denied": [{"uri": "rigcal://agents/pc1", "serials": []}]})");
  EXPECT_TRUE(WaitFor([&] { return Audit().find("connection_cut") != std::string::npos; },
                      std::chrono::seconds(5)));
  EXPECT_TRUE(WaitFor(
      [&] {
        return Rigcal({"agent", "list"}).output.find("gone") != std::string::npos;
      },
      std::chrono::seconds(20)));
}

TEST_F(TlsPrograms, WithoutACertificateAnotherMachineIsNotTried) {
  const CommandResult list = Rigcal({"agent", "list", "--server", "192.0.2.1:7420"});
  EXPECT_NE(list.exit_code, 0);
  EXPECT_THAT(list.error, AllOf(HasSubstr("192.0.2.1:7420"), HasSubstr("rigcal login")));
  const CommandResult agent =
      RunCommand({"rigcal-agent", "--server", "192.0.2.1:7420", "--state-dir",
                  (directory_.path() / "state").string(), "--source", "sim:camera=0"});
  EXPECT_EQ(agent.exit_code, 1);
  EXPECT_THAT(agent.error, HasSubstr("rigcal-agent join"));
}

TEST_F(TlsPrograms, AServerWithABrokenCertificateDoesNotStart) {
  // Without the CA's key it cannot make itself another one.
  std::filesystem::remove(store() / "identity" / "ca.key");
  ReplaceTestFile(store() / "identity" / "server.key", ca_.MakeServer().key_pem);
  const CommandResult server =
      RunCommand({"rigcal-server", "--listen", "127.0.0.1:0", "--data-dir", store().string()});
  EXPECT_EQ(server.exit_code, 1);
  EXPECT_THAT(server.error, HasSubstr("server"));
}

}  // namespace
}  // namespace rigcal::testing::tls_programs_test

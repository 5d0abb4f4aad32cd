// SPDX-License-Identifier: Apache-2.0
// What a standby, and a server that is followed, refuse, with the messages that a person reads.
#include <gmock/gmock.h>
#include <grpcpp/create_channel.h>
#include <grpcpp/security/credentials.h>
#include <gtest/gtest.h>

#include <chrono>
#include <csignal>
#include <filesystem>
#include <fstream>
#include <memory>
#include <string>
#include <vector>

#include "absl/strings/match.h"
#include "common/wire/grpc_status.h"
#include "common/wire/protocol_version.h"
#include "rigcal/v1/replication_service.grpc.pb.h"
#include "tests/integration/running_wave.h"
#include "tests/testing/http_connection.h"
#include "tests/testing/process.h"
#include "tests/testing/server_client.h"
#include "tests/testing/status_matchers.h"
#include "tests/testing/temporary_directory.h"

namespace rigcal::testing::standby_refusals_test {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::Not;

class StandbyRefusals : public ::testing::Test {
 protected:
  std::string Folder(const std::string& name) const { return (directory_.path() / name).string(); }
  std::unique_ptr<ServerProcess> Start(const std::string& name,
                                       const std::vector<std::string>& more = {}) const {
    return std::make_unique<ServerProcess>(Folder(name), 0, std::map<std::string, std::string>(),
                                           more);
  }
  static void Kill(ServerProcess* server) {
    server->process().Signal(SIGKILL);
    server->process().Wait();
  }
  static CommandResult Promote(const std::string& folder, bool force = false) {
    std::vector<std::string> command = {"rigcal-server", "promote", "--data-dir", folder};
    if (force) command.emplace_back("--force");
    return RunCommand(command);
  }
  // Within a moment, as a standby goes on and on.
  static ::testing::AssertionResult Says(ServerProcess& server, const std::string& text) {
    if (WaitFor([&] { return absl::StrContains(server.process().StandardError(), text); })) {
      return ::testing::AssertionSuccess();
    }
    return ::testing::AssertionFailure() << server.process().StandardError();
  }
  // A page of the server whose HTTP port is in the file.
  static std::string Page(const std::string& port_file, const std::string& path) {
    int port = 0;
    EXPECT_TRUE(WaitFor([&] {
      std::ifstream(port_file) >> port;
      return port != 0;
    }));
    const auto reply = HttpConnection(port).Get(path, "Host: 127.0.0.1\r\n");
    return reply.ok() ? reply->body : std::string(reply.status().message());
  }
  static absl::Status Ask(const std::string& address, const v1::ListChangesRequest& request) {
    const auto stub = v1::ReplicationService::NewStub(
        grpc::CreateChannel(address, grpc::InsecureChannelCredentials()));
    grpc::ClientContext context;
    v1::ListChangesResponse response;
    return wire::FromGrpc(stub->ListChanges(&context, request, &response));
  }

  const TemporaryDirectory directory_;
};

TEST_F(StandbyRefusals, PromoteWhileThePrimaryAnswers) {
  const auto primary = Start("primary");
  const auto standby = Start("standby", {"--follow", primary->address()});
  ASSERT_TRUE(Says(*standby, "has everything of it"));
  const CommandResult refused = Promote(Folder("standby"));
  EXPECT_EQ(refused.exit_code, 1);
  EXPECT_THAT(refused.error, AllOf(HasSubstr("the primary " + primary->address() + " answers"),
                                   HasSubstr("--force")));
  // A server that is no standby.
  EXPECT_THAT(Promote(Folder("primary")).error, HasSubstr("this server is no standby"));

  const CommandResult forced = Promote(Folder("standby"), true);
  EXPECT_EQ(forced.exit_code, 0) << forced.error;
  // The new one tells the old one.
  ASSERT_TRUE(Says(*primary, "another one has taken over with generation 2"));
  EXPECT_TRUE(WaitFor([&] {
    return absl::IsUnavailable(ServerClient(primary->address()).GetSession("wave").status());
  }));
}

TEST_F(StandbyRefusals, ThePageAndMetricsOfAStandbySayWhatItIs) {
  const auto primary = Start("primary");
  const std::string http_port = Folder("http_port");
  const auto standby =
      Start("standby", {"--follow", primary->address(), "--http-port-file", http_port});
  ASSERT_TRUE(Says(*standby, "has everything of it"));
  EXPECT_THAT(Page(http_port, "/"),
              AllOf(HasSubstr("<h1>Standby of " + primary->address() + "</h1>"),
                    HasSubstr("rigcal-server promote"), HasSubstr("It is 0 observations behind")));
  EXPECT_THAT(Page(http_port, "/metrics"),
              AllOf(HasSubstr("rigcal_standby{primary=\"" + primary->address() + "\"} 1"),
                    HasSubstr("rigcal_standby_complete 1"), HasSubstr("rigcal_standby_follows 1"),
                    HasSubstr("rigcal_standby_behind_observations 0"),
                    HasSubstr("rigcal_standby_silence_seconds ")));
  EXPECT_THAT(Page(http_port, "/v1/sessions"), HasSubstr("UNAVAILABLE"));
  primary->process().Signal(SIGKILL);
  primary->process().Wait();
  EXPECT_TRUE(WaitFor(
      [&] { return absl::StrContains(Page(http_port, "/metrics"), "rigcal_standby_follows 0"); }));
  EXPECT_THAT(Page(http_port, "/"), HasSubstr("nothing is copied"));
}

// Who was promoted last serves, whatever the others are started with.
TEST_F(StandbyRefusals, APromotedServerFollowsOnlyOneThatWasPromotedAfterIt) {
  auto a = Start("a");
  ASSERT_THAT(ServerClient(a->address()).CreateSession(WandSession()), IsOk());
  auto b = Start("b", {"--follow", a->address()});
  ASSERT_TRUE(Says(*b, "has everything of it"));
  const auto serves = [](ServerProcess& server) { return Says(server, "the dashboard is at"); };
  Kill(a.get());
  ASSERT_EQ(Promote(Folder("b")).exit_code, 0);
  Kill(b.get());
  // After a power cut, with --follow still in its configuration.
  b = Start("b", {"--follow", a->address()});
  EXPECT_TRUE(Says(*b, "none that was promoted after it answers"));
  EXPECT_TRUE(serves(*b));
  Kill(b.get());
  {
    const auto old = Start("a");
    b = Start("b", {"--follow", old->address()});
    EXPECT_TRUE(Says(*b, "this one is the older of the two"));
    EXPECT_TRUE(serves(*b));
    Kill(b.get());
  }
  // The old one follows the new one, takes over, and then that one follows it, as it was promoted
  // before.
  b = Start("b");
  a = Start("a", {"--follow", b->address()});
  ASSERT_TRUE(Says(*a, "has everything of it"));
  Kill(b.get());
  ASSERT_EQ(Promote(Folder("a")).exit_code, 0);
  // At a port that is known.
  Kill(a.get());
  a = Start("a");
  b = Start("b", {"--follow", a->address()});
  EXPECT_TRUE(Says(*b, "has everything of it (1 sessions"));
  EXPECT_TRUE(absl::IsUnavailable(ServerClient(b->address()).GetSession("wave").status()));
}

TEST_F(StandbyRefusals, APromotedServerWithDataOfItsOwnDoesNotServeBesideANewerOne) {
  auto a = Start("a");
  ASSERT_THAT(ServerClient(a->address()).CreateSession(WandSession()), IsOk());
  auto b = Start("b", {"--follow", a->address()});
  ASSERT_TRUE(Says(*b, "has everything of it"));
  Kill(a.get());
  ASSERT_EQ(Promote(Folder("b")).exit_code, 0);
  Kill(b.get());
  b = Start("b");
  a = Start("a", {"--follow", b->address()});
  ASSERT_TRUE(Says(*a, "has everything of it"));
  a->process().Signal(SIGSTOP);
  ASSERT_THAT(ServerClient(b->address()).CreateSession(WandSession("own")), IsOk());
  Kill(b.get());
  a->process().Signal(SIGCONT);
  ASSERT_EQ(Promote(Folder("a")).exit_code, 0);
  Kill(a.get());
  a = Start("a");
  Process again({{"rigcal-server", "--listen", "127.0.0.1:0", "--data-dir", Folder("b"), "--follow",
                  a->address()},
                 {}});
  EXPECT_EQ(again.Wait(), 1);
  EXPECT_THAT(again.StandardError(),
              AllOf(HasSubstr("session own"), Not(HasSubstr("the dashboard is at"))));
}

TEST_F(StandbyRefusals, CallsOfAStandbyNameThePrimary) {
  const auto primary = Start("primary");
  const auto standby = Start("standby", {"--follow", primary->address()});
  const absl::Status refused = ServerClient(standby->address()).GetSession("wave").status();
  EXPECT_TRUE(absl::IsUnavailable(refused)) << refused;
  EXPECT_THAT(refused.ToString(),
              HasSubstr("this server is a standby of " + primary->address() + "; use that one"));
}

TEST_F(StandbyRefusals, FollowersOfAFollower) {
  const auto primary = Start("primary");
  const auto standby = Start("standby", {"--follow", primary->address()});
  Process third({{"rigcal-server", "--listen", "127.0.0.1:0", "--data-dir", Folder("third"),
                  "--follow", standby->address()},
                 {}});
  EXPECT_EQ(third.Wait(), 1);
  EXPECT_THAT(third.StandardError(), HasSubstr("a standby follows only a server that serves"));
  const CommandResult promoted = Promote(Folder("third"));
  EXPECT_THAT(promoted.error, HasSubstr("this standby has never had all data of"));
}

TEST_F(StandbyRefusals, ASecondFollower) {
  const auto primary = Start("primary");
  const auto standby = Start("standby", {"--follow", primary->address()});
  ASSERT_TRUE(Says(*standby, "has everything of it"));
  const auto second = Start("second", {"--follow", primary->address()});
  EXPECT_TRUE(Says(*second, "follows this server already"));
  EXPECT_EQ(ServerClient(primary->address()).GetSession("wave").status().code(),
            absl::StatusCode::kNotFound);
}

TEST_F(StandbyRefusals, AnAddressWhereNobodyIs) {
  const std::string http_port = Folder("http_port");
  const auto standby = Start("standby", {"--follow", "127.0.0.1:1", "--http-port-file", http_port});
  EXPECT_TRUE(absl::IsUnavailable(ServerClient(standby->address()).GetSession("wave").status()));
  EXPECT_THAT(Page(http_port, "/"), HasSubstr("It has not heard of it yet"));
  // The ports were open before the primary had had its 5 s to answer.
  const auto opened = std::filesystem::last_write_time(http_port);
  ASSERT_TRUE(Says(*standby, "a standby of 127.0.0.1:1: port"));
  EXPECT_GT(std::filesystem::file_time_type::clock::now() - opened, std::chrono::seconds(4));
  EXPECT_TRUE(Says(*standby, "standby of 127.0.0.1:1: it does not answer"));
  EXPECT_THAT(Promote(Folder("standby")).error,
              HasSubstr("this standby has never had all data of 127.0.0.1:1"));
}

TEST_F(StandbyRefusals, AServerWithOtherTablesOrData) {
  const auto primary = Start("primary");
  v1::ListChangesRequest request;
  *request.mutable_protocol_version() = wire::OwnProtocolVersion();
  request.set_schema_version(1);
  request.set_address("pc-9:7420");
  EXPECT_THAT(Ask(primary->address(), request).ToString(),
              AllOf(HasSubstr("FAILED_PRECONDITION"), HasSubstr("pc-9:7420"),
                    HasSubstr("tables of version 1"), HasSubstr("the same release")));
  request.mutable_protocol_version()->set_major(wire::kProtocolMajor + 1);
  EXPECT_THAT(Ask(primary->address(), request).ToString(), HasSubstr("speaks protocol"));
}

TEST_F(StandbyRefusals, AFolderWithDataThatThePrimaryDoesNotHave) {
  const auto primary = Start("primary");
  {
    const auto other = Start("other");
    ServerClient client(other->address());
    ASSERT_THAT(client.CreateSession(WandSession()), IsOk());
  }
  Process refused({{"rigcal-server", "--listen", "127.0.0.1:0", "--data-dir", Folder("other"),
                    "--follow", primary->address()},
                   {}});
  EXPECT_EQ(refused.Wait(), 1);
  EXPECT_THAT(refused.StandardError(), HasSubstr("of another server"));
  // Nothing has changed: it serves as before.
  const auto other = Start("other");
  EXPECT_THAT(ServerClient(other->address()).GetSession("wave"), IsOk());
}

TEST_F(StandbyRefusals, TheOldPrimaryWithExtraRows) {
  auto primary = Start("primary");
  auto standby = Start("standby", {"--follow", primary->address()});
  ASSERT_TRUE(Says(*standby, "has everything of it"));
  standby->process().Signal(SIGKILL);
  standby->process().Wait();
  ASSERT_THAT(ServerClient(primary->address()).CreateSession(WandSession()), IsOk());
  primary->process().Signal(SIGKILL);
  primary->process().Wait();
  ASSERT_EQ(Promote(Folder("standby")).exit_code, 0);
  const auto promoted = Start("standby");
  Process refused({{"rigcal-server", "--listen", "127.0.0.1:0", "--data-dir", Folder("primary"),
                    "--follow", promoted->address()},
                   {}});
  EXPECT_EQ(refused.Wait(), 1);
  EXPECT_THAT(refused.StandardError(),
              AllOf(HasSubstr("session wave with 0 observations"), HasSubstr("move the folder")));
}

TEST_F(StandbyRefusals, TheOldPrimaryWithoutExtraRowsFollows) {
  auto primary = Start("primary");
  ASSERT_THAT(ServerClient(primary->address()).CreateSession(WandSession()), IsOk());
  auto standby = Start("standby", {"--follow", primary->address()});
  ASSERT_TRUE(Says(*standby, "has everything of it"));
  primary->process().Signal(SIGKILL);
  primary->process().Wait();
  ASSERT_EQ(Promote(Folder("standby")).exit_code, 0);
  ASSERT_TRUE(Says(*standby, "the dashboard is at"));
  standby->process().Signal(SIGTERM);
  standby->process().Wait();
  const auto promoted = Start("standby");
  const auto again = Start("primary", {"--follow", promoted->address()});
  EXPECT_TRUE(Says(*again, "has everything of it (1 sessions"));
}

TEST_F(StandbyRefusals, AFullDiskOfTheStandbyIsNamedAndThePrimaryGoesOn) {
  const auto primary = Start("primary");
  ASSERT_THAT(ServerClient(primary->address()).CreateSession(WandSession()), IsOk());
  const std::string config = Folder("standby.toml");
  // A terabyte, more than this disk has.
  std::ofstream(config) << "[limits]\ndisk_reserve_mb = 1000000\n";
  const auto standby = Start("standby", {"--follow", primary->address(), "--config", config});
  EXPECT_TRUE(Says(*standby, "the standby's disk is full"));
  v1::CreateSessionRequest another = WandSession();
  another.set_id("another");
  EXPECT_THAT(ServerClient(primary->address()).CreateSession(another), IsOk());
}

}  // namespace
}  // namespace rigcal::testing::standby_refusals_test

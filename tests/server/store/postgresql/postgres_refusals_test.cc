// SPDX-License-Identifier: Apache-2.0
// What the store refuses at its start, and what it says then.

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <csignal>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <string>
#include <string_view>
#include <vector>

#include "absl/strings/str_cat.h"
#include "server/store/postgresql/postgres_schema.h"
#include "server/store/postgresql/postgres_start_check.h"
#include "server/store/postgresql/postgres_store.h"
#include "tests/testing/postgres_cluster.h"
#include "tests/testing/process.h"
#include "tests/testing/status_matchers.h"

namespace rigcal::server::postgres_refusals_test {
namespace {

using ::rigcal::testing::IsOk;
using ::rigcal::testing::PostgresCluster;
using ::rigcal::testing::Process;
using ::rigcal::testing::StatusIs;
using ::rigcal::testing::WaitFor;
using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::Not;

class PostgresRefusals : public ::testing::Test {
 protected:
  void SetUp() override {
    if (!PostgresCluster::Installed()) {
      GTEST_SKIP() << "no PostgreSQL server in /usr/lib/postgresql: install the package postgresql";
    }
  }
  static absl::Status Open(const std::string& url, bool unsafe = true) {
    return PostgresStore::Open(
               {.url = url,
                .writer = {.start = {.unsafe = unsafe}, .takeover_limit = std::chrono::seconds(1)}})
        .status();
  }
  static auto Refused(auto message) {
    return StatusIs(absl::StatusCode::kFailedPrecondition, message);
  }
};

TEST_F(PostgresRefusals, ANewerSchema) {
  PostgresCluster& cluster = PostgresCluster::Shared();
  const std::string database = cluster.CreateDatabase();
  ASSERT_THAT(Open(cluster.Url(database)), IsOk());
  cluster.Sql(database, "UPDATE rigcal_schema SET version=version+1");
  EXPECT_THAT(Open(cluster.Url(database)),
              Refused(AllOf(HasSubstr(absl::StrCat("schema version ", kPostgresSchemaVersion + 1)),
                            HasSubstr(absl::StrCat("reads version ", kPostgresSchemaVersion)),
                            HasSubstr("newer rigcal-server"))));
  cluster.Sql(database, "UPDATE rigcal_schema SET version=version-1");
  EXPECT_THAT(Open(cluster.Url(database)), IsOk());
}

TEST_F(PostgresRefusals, ADatabaseOfAnotherProgram) {
  PostgresCluster& cluster = PostgresCluster::Shared();
  const std::string database = cluster.CreateDatabase();
  cluster.Sql(database, "CREATE TABLE diary(entry TEXT)");
  EXPECT_THAT(
      Open(cluster.Url(database)),
      Refused(AllOf(HasSubstr("another program"), HasSubstr("'diary'"), HasSubstr("createdb"))));
  EXPECT_EQ(cluster.Sql(database, "SELECT count(*) FROM pg_tables WHERE schemaname='public'"), "1");
}

TEST_F(PostgresRefusals, AUserWithoutRights) {
  PostgresCluster& cluster = PostgresCluster::Shared();
  const std::string database = cluster.CreateDatabase();
  cluster.Sql("postgres", "CREATE ROLE guest LOGIN");
  const std::string url = cluster.Url(database, "guest");
  EXPECT_THAT(Open(url),
              Refused(AllOf(HasSubstr("guest@"), HasSubstr("42501"), HasSubstr("owner"))));
  ASSERT_THAT(Open(cluster.Url(database)), IsOk());
  EXPECT_THAT(Open(url), Refused(AllOf(HasSubstr("42501"), HasSubstr("owner"))));
}

TEST_F(PostgresRefusals, ADatabaseInUse) {
  PostgresCluster& cluster = PostgresCluster::Shared();
  const std::string url = cluster.NewUrl();
  {
    ASSERT_OK_AND_ASSIGN(const auto first,
                         PostgresStore::Open({.url = url, .writer = {.start = {.unsafe = true}}}));
    EXPECT_THAT(Open(url), Refused(AllOf(HasSubstr("in use by another rigcal-server"),
                                         HasSubstr("this PC"), HasSubstr("stop that one"))));
  }
  EXPECT_THAT(Open(url), IsOk());
}

TEST_F(PostgresRefusals, APoolerThatGivesEachTransactionAnotherSession) {
  const std::string program = "/usr/sbin/pgbouncer";
  if (!std::filesystem::exists(program)) GTEST_SKIP() << "install the package pgbouncer";
  PostgresCluster cluster({.fsync = false});
  const std::string database = cluster.CreateDatabase();
  const std::string folder = cluster.socket_folder().string();
  for (const char* mode : {"transaction", "statement", "session"}) {
    const std::string file = absl::StrCat(folder, "/", mode, ".ini");
    std::ofstream(file) << "[databases]\n* = host=" << folder
                        << " user=rigcal\n[pgbouncer]\nlisten_addr =\nlisten_port = 6432\n"
                           "auth_type = any\nignore_startup_parameters = options\n"
                        << "unix_socket_dir = " << folder << "\npool_mode = " << mode << "\n";
    std::vector<std::string> arguments = {program, "-q"};
    if (geteuid() == 0) arguments.insert(arguments.end(), {"-u", "postgres"});
    arguments.push_back(file);
    Process pooler({arguments, {}});
    ASSERT_TRUE(WaitFor([&] { return std::filesystem::exists(folder + "/.s.PGSQL.6432"); }))
        << pooler.StandardError();
    const std::string url =
        absl::StrCat("postgresql://rigcal@/", database, "?host=", folder, "&port=6432");
    const absl::Status opened = Open(url);
    if (std::string_view(mode) == "session") {
      EXPECT_THAT(opened, IsOk());
    } else if (std::string_view(mode) == "transaction") {
      EXPECT_THAT(opened, Refused(HasSubstr("pool_mode = session")));
    } else {
      // The pooler says it itself.
      EXPECT_THAT(opened, StatusIs(absl::StatusCode::kUnavailable,
                                   HasSubstr("not allowed in statement pooling mode")));
    }
    pooler.Signal(SIGINT);
    pooler.Wait();
  }
}

TEST_F(PostgresRefusals, AServerThatDoesNotWriteThrough) {
  PostgresCluster& cluster = PostgresCluster::Shared();
  EXPECT_THAT(Open(cluster.NewUrl(), false),
              Refused(AllOf(HasSubstr("fsync = off"), HasSubstr("--store-unsafe"))));
  PostgresCluster pages({.settings = {"full_page_writes=off"}});
  const std::string url = pages.NewUrl();
  EXPECT_THAT(Open(url, false), Refused(HasSubstr("full_page_writes = off")));
  EXPECT_THAT(Open(url, true), IsOk());
}

TEST_F(PostgresRefusals, AStandbyWhichAServerFindsOnceItIsPromoted) {
  PostgresCluster primary({.fsync = false});
  const std::string database = primary.CreateDatabase();
  const auto standby = primary.MakeStandby();
  standby->Start();
  const std::string url = standby->Url(database);
  EXPECT_THAT(Open(url), Refused(AllOf(HasSubstr("in recovery"), HasSubstr("HOST1,HOST2"))));
  // The one of both that can be written.
  std::string both = url;
  const std::string host = standby->Url("").substr(std::string("postgresql://rigcal@").size());
  const std::string other = primary.Url("").substr(std::string("postgresql://rigcal@").size());
  both.insert(std::string("postgresql://rigcal@").size(), other.substr(0, other.size() - 1) + ",");
  EXPECT_THAT(Open(both), IsOk());
  primary.StopAtOnce();
  standby->Promote();
  EXPECT_THAT(Open(both), IsOk());
}

TEST_F(PostgresRefusals, AWrongPasswordAndNone) {
  PostgresCluster cluster({.fsync = false, .hba = {"local all locked scram-sha-256"}});
  cluster.Sql("postgres", "CREATE ROLE locked LOGIN PASSWORD 'right'");
  cluster.Sql("postgres", "CREATE DATABASE own OWNER locked");
  const std::string url = cluster.Url("own", "locked");
  EXPECT_THAT(Open(url),
              Refused(AllOf(HasSubstr("no password was given"), HasSubstr("PGPASSWORD"))));
  std::string with_password = url;
  with_password.insert(url.find('@'), ":wrong");
  EXPECT_THAT(Open(with_password), Refused(AllOf(HasSubstr("check the user, its password"),
                                                 HasSubstr("locked@"), Not(HasSubstr("wrong")))));
  setenv("PGPASSWORD", "right", 1);
  const absl::Status opened = Open(url);
  unsetenv("PGPASSWORD");
  EXPECT_THAT(opened, IsOk());
}

TEST_F(PostgresRefusals, AHostThatDoesNotAnswer) {
  EXPECT_THAT(Open("postgresql://rigcal:secret@127.0.0.1:1/rigcal"),
              StatusIs(absl::StatusCode::kUnavailable,
                       AllOf(HasSubstr("rigcal@127.0.0.1:1/rigcal"), HasSubstr("pg_hba.conf"),
                             Not(HasSubstr("secret")))));
}

TEST_F(PostgresRefusals, ADatabaseOfAnotherEncoding) {
  PostgresCluster& cluster = PostgresCluster::Shared();
  cluster.Sql(
      "postgres",
      "CREATE DATABASE latin TEMPLATE template0 ENCODING 'LATIN1' LC_COLLATE 'C' LC_CTYPE 'C'");
  EXPECT_THAT(Open(cluster.Url("latin")),
              Refused(AllOf(HasSubstr("LATIN1"), HasSubstr("-E UTF8"))));
}

TEST_F(PostgresRefusals, TransactionsThatOnlyRead) {
  PostgresCluster& cluster = PostgresCluster::Shared();
  const std::string database = cluster.CreateDatabase();
  cluster.Sql("postgres", "ALTER DATABASE " + database + " SET default_transaction_read_only=on");
  EXPECT_THAT(Open(cluster.Url(database)), Refused(HasSubstr("only read")));
}

}  // namespace
}  // namespace rigcal::server::postgres_refusals_test

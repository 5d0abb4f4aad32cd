// SPDX-License-Identifier: Apache-2.0
#include "server/store/postgresql/postgres_address.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>

#include "server/store/postgresql/postgres_connection.h"
#include "tests/testing/postgres_cluster.h"
#include "tests/testing/status_matchers.h"

namespace rigcal::server::postgres_address_test {
namespace {

using ::rigcal::testing::PostgresCluster;
using ::rigcal::testing::StatusIs;
using ::testing::HasSubstr;
using ::testing::Not;

TEST(PostgresAddress, ShowsEverythingButThePassword) {
  ASSERT_OK_AND_ASSIGN(
      const PostgresAddress address,
      PostgresAddress::Parse("postgresql://rigcal:secret@db1:5433,db2:5434/lab?password=hidden"));
  EXPECT_EQ(address.text(), "postgresql://rigcal@db1,db2:5433,5434/lab");
  EXPECT_EQ(address.options().at("target_session_attrs"), "read-write");
  EXPECT_EQ(address.options().at("password"), "hidden");
}

TEST(PostgresAddress, KeepsTheOptionsThatAreGiven) {
  ASSERT_OK_AND_ASSIGN(
      const PostgresAddress address,
      PostgresAddress::Parse("postgres://db/lab?connect_timeout=2&application_name=other"));
  EXPECT_EQ(address.options().at("connect_timeout"), "2");
  EXPECT_EQ(address.options().at("application_name"), "other");
}

TEST(PostgresAddress, DoesNotRepeatWhatItCannotRead) {
  for (const char* url : {"postgresql://rigcal:sec%ret@db/lab",
                          "postgresql://db/lab?nonsense=secret", "host=db password=secret"}) {
    EXPECT_THAT(PostgresAddress::Parse(url),
                StatusIs(absl::StatusCode::kInvalidArgument, Not(HasSubstr("sec"))))
        << url;
  }
}

TEST(PostgresParameters, AreNumbered) {
  EXPECT_EQ(NumberedParameters("a=? AND b='?' AND c=?"), "a=$1 AND b='?' AND c=$2");
  EXPECT_EQ(NumberedParameters("(?1<<32) + ?2, ?1"), "($1<<32) + $2, $1");
}

TEST(PostgresText, IsUtf8WithoutZeroBytes) {
  EXPECT_EQ(StorableText("wand \xC3\xA4 \xE2\x82\xAC \xF0\x9F\x98\x80"),
            "wand \xC3\xA4 \xE2\x82\xAC \xF0\x9F\x98\x80");
  const std::string bad = "\xEF\xBF\xBD";
  EXPECT_EQ(StorableText(std::string("a\0b", 3)), "a" + bad + "b");
  EXPECT_EQ(StorableText("\xFF\xC0\x80"), bad + bad + bad);
  EXPECT_EQ(StorableText("\xED\xA0\x80"), bad + bad + bad);  // a surrogate
  EXPECT_EQ(StorableText("cut \xE2\x82"), "cut " + bad + bad);
}

// Beside it the tests of this folder and of server/store/contract are silent.
TEST(PostgresServer, IsInstalledForTheTests) {
  if (!PostgresCluster::Installed()) {
    GTEST_SKIP() << "no PostgreSQL server in /usr/lib/postgresql: install the package postgresql";
  }
}

}  // namespace
}  // namespace rigcal::server::postgres_address_test

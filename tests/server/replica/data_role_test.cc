// SPDX-License-Identifier: Apache-2.0
#include "server/replica/data_role.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fstream>

#include "tests/testing/status_matchers.h"
#include "tests/testing/temporary_directory.h"

namespace rigcal::server::data_role_test {
namespace {

using ::rigcal::testing::IsOk;
using ::rigcal::testing::StatusIs;
using ::testing::HasSubstr;

TEST(DataRole, AFolderWithoutAFileIsAServers) {
  const ::rigcal::testing::TemporaryDirectory directory;
  const auto role = ReadDataRole(directory.path());
  ASSERT_THAT(role, IsOk());
  EXPECT_EQ(role->role, RoleOfData::kServer);
  EXPECT_EQ(WhyNotToServe(*role), "");
}

TEST(DataRole, ComesBackAsItWasWritten) {
  const ::rigcal::testing::TemporaryDirectory directory;
  for (const RoleOfData kind : {RoleOfData::kServer, RoleOfData::kStandby, RoleOfData::kPromoted,
                                RoleOfData::kSuperseded}) {
    const DataRole written{.role = kind,
                           .standby_id = "a1",
                           .primary = "pc-1:7420",
                           .complete = true,
                           .generation = 7,
                           .superseded_by = "pc-2:7420"};
    ASSERT_THAT(WriteDataRole(directory.path(), written), IsOk());
    const auto read = ReadDataRole(directory.path());
    ASSERT_THAT(read, IsOk());
    EXPECT_EQ(read->role, kind);
    EXPECT_EQ(read->standby_id, "a1");
    EXPECT_EQ(read->primary, "pc-1:7420");
    EXPECT_TRUE(read->complete);
    EXPECT_EQ(read->generation, 7u);
    EXPECT_EQ(read->superseded_by, "pc-2:7420");
  }
}

TEST(DataRole, ADamagedFileIsNamed) {
  const ::rigcal::testing::TemporaryDirectory directory;
  for (const char* text : {"", "{", "{}", R"({"role": "king"})", R"({"role": 3})"}) {
    std::ofstream(directory.path() / "standby.json") << text;
    EXPECT_THAT(ReadDataRole(directory.path()),
                StatusIs(absl::StatusCode::kDataLoss, HasSubstr("standby.json is damaged")))
        << text;
  }
}

TEST(DataRole, SaysWhichServerIsToBeAsked) {
  EXPECT_THAT(WhyNotToServe({.role = RoleOfData::kStandby, .primary = "pc-1:7420"}),
              HasSubstr("a standby of pc-1:7420; use that one"));
  EXPECT_THAT(WhyNotToServe(
                  {.role = RoleOfData::kSuperseded, .generation = 3, .superseded_by = "pc-2:7420"}),
              HasSubstr("generation 3 (pc-2:7420)"));
}

}  // namespace
}  // namespace rigcal::server::data_role_test

// SPDX-License-Identifier: Apache-2.0
#include "server/store/factory/open_store.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <string>

#include "tests/testing/status_matchers.h"
#include "tests/testing/temporary_directory.h"

namespace rigcal::server::open_store_test {
namespace {

using ::rigcal::testing::IsOk;
using ::rigcal::testing::StatusIs;
using ::rigcal::testing::TemporaryDirectory;
using ::testing::AllOf;
using ::testing::HasSubstr;

std::string KindAt(const std::string& location) {
  const auto store = OpenStore(location);
  EXPECT_THAT(store, IsOk());
  return store.ok() ? (*store)->Health().kind : "";
}

TEST(OpenStore, OpensAFolderAsTheDefaultKind) {
  const TemporaryDirectory directory;
  EXPECT_EQ(KindAt((directory.path() / "data").string()), "sqlite");
  EXPECT_EQ(KindAt("sqlite:" + (directory.path() / "data").string()), "sqlite");
  EXPECT_TRUE(std::filesystem::is_directory(directory.path() / "data"));
}

TEST(OpenStore, TakesAColonBehindASlashAsPartOfThePath) {
  const TemporaryDirectory directory;
  EXPECT_EQ(KindAt((directory.path() / "rig:1").string()), "sqlite");
  EXPECT_TRUE(std::filesystem::is_directory(directory.path() / "rig:1"));
}

TEST(OpenStore, NamesTheKnownKindsWhereItIsGivenAnother) {
  EXPECT_THAT(OpenStore("tape:reel"),
              StatusIs(absl::StatusCode::kInvalidArgument,
                       AllOf(HasSubstr("'tape'"), HasSubstr("sqlite"), HasSubstr("./tape:reel"))));
}

TEST(OpenStore, PassesTheErrorsOfTheKindOn) {
  const TemporaryDirectory directory;
  const std::string location = directory.path().string();
  const auto first = OpenStore(location);
  EXPECT_THAT(OpenStore(location),
              StatusIs(absl::StatusCode::kFailedPrecondition, HasSubstr("in use")));
  EXPECT_THAT(OpenStore(""), StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("empty")));
}

}  // namespace
}  // namespace rigcal::server::open_store_test

// SPDX-License-Identifier: Apache-2.0
#include "common/identity/durable_file.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/stat.h>

#include <string>

#include "tests/testing/status_matchers.h"
#include "tests/testing/temporary_directory.h"

namespace rigcal::testing::durable_file_test {
namespace {

using ::testing::HasSubstr;

TEST(DurableFile, IsReplacedWholeAndPrivate) {
  const TemporaryDirectory directory;
  const std::filesystem::path path = directory.WriteFile("a.json", "old");
  directory.WriteFile("a.json.new", "half of");
  ASSERT_THAT(WriteDurableFile(path, "new"), IsOk());
  EXPECT_EQ(*ReadSmallFile(path), "new");
  EXPECT_FALSE(std::filesystem::exists(directory.path() / "a.json.new"));
  struct stat status {};
  ASSERT_EQ(stat(path.c_str(), &status), 0);
  EXPECT_EQ(status.st_mode & 0777, 0600u);
}

TEST(SmallFile, NamesWhatCannotBeRead) {
  const TemporaryDirectory directory;
  EXPECT_THAT(ReadSmallFile(directory.path() / "none"),
              StatusIs(absl::StatusCode::kNotFound, HasSubstr("none")));
  std::filesystem::create_directory(directory.path() / "folder");
  const auto folder = ReadSmallFile(directory.path() / "folder");
  EXPECT_FALSE(folder.ok());
  EXPECT_THAT(std::string(folder.status().message()), HasSubstr("folder"));
}

TEST(SmallFile, IsSmall) {
  const TemporaryDirectory directory;
  const std::string most(size_t{1} << 20, 'x');
  EXPECT_EQ(ReadSmallFile(directory.WriteFile("most", most))->size(), most.size());
  EXPECT_THAT(ReadSmallFile(directory.WriteFile("more", most + "x")),
              StatusIs(absl::StatusCode::kOutOfRange, HasSubstr("more")));
  EXPECT_EQ(*ReadSmallFile(directory.WriteFile("empty", "")), "");
}

}  // namespace
}  // namespace rigcal::testing::durable_file_test

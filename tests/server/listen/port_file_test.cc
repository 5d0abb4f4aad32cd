// SPDX-License-Identifier: Apache-2.0
#include "server/listen/port_file.h"

#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <iterator>
#include <string>

#include "tests/testing/status_matchers.h"
#include "tests/testing/temporary_directory.h"

namespace rigcal::testing::port_file_test {
namespace {

TEST(WritePortFileTest, LeavesTheNumberAndNothingElse) {
  const TemporaryDirectory folder;
  const std::filesystem::path file = folder.path() / "port";
  std::ofstream(file) << "of an earlier run";
  ASSERT_THAT(server::WritePortFile(file, 7420), IsOk());
  std::ifstream stream(file);
  EXPECT_EQ(std::string(std::istreambuf_iterator<char>(stream), {}), "7420\n");
  EXPECT_EQ(std::distance(std::filesystem::directory_iterator(folder.path()), {}), 1);
}

TEST(WritePortFileTest, SaysWhichFileCannotBeWritten) {
  const TemporaryDirectory folder;
  const std::string file = folder.path() / "missing" / "port";
  EXPECT_THAT(server::WritePortFile(file, 1),
              StatusIs(absl::StatusCode::kUnavailable, ::testing::HasSubstr(file)));
}

}  // namespace
}  // namespace rigcal::testing::port_file_test

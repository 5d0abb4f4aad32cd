// SPDX-License-Identifier: Apache-2.0
#include "server/care/running_server.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/stat.h>

#include "tests/testing/status_matchers.h"
#include "tests/testing/temporary_directory.h"

namespace rigcal::server::running_server_test {
namespace {

using ::rigcal::testing::StatusIs;
using ::rigcal::testing::TemporaryDirectory;
using ::testing::HasSubstr;

TEST(RunningServerNote, IsThereAsLongAsTheServer) {
  const TemporaryDirectory directory;
  EXPECT_THAT(AddressOfRunningServer(directory.path()),
              StatusIs(absl::StatusCode::kNotFound, HasSubstr("--server")));
  {
    const RunningServerNote note(directory.path(), "127.0.0.1:7420");
    EXPECT_EQ(*AddressOfRunningServer(directory.path()), "127.0.0.1:7420");
    struct stat entry = {};
    ASSERT_EQ(stat((directory.path() / "address").c_str(), &entry), 0);
    EXPECT_EQ(entry.st_mode & 0777, 0600u);
  }
  EXPECT_FALSE(AddressOfRunningServer(directory.path()).ok());
}

TEST(RunningServerNote, AFolderThatCannotBeWrittenIsNoFault) {
  const RunningServerNote note("/nonexistent/folder", "127.0.0.1:1");
  EXPECT_FALSE(AddressOfRunningServer("/nonexistent/folder").ok());
}

TEST(LocalAddress, IsOneThatThisMachineReaches) {
  EXPECT_EQ(LocalAddress("127.0.0.1:0", 4711), "127.0.0.1:4711");
  EXPECT_EQ(LocalAddress("0.0.0.0:7420", 7420), "127.0.0.1:7420");
  EXPECT_EQ(LocalAddress("[::]:7420", 7420), "[::1]:7420");
  EXPECT_EQ(LocalAddress("[::1]:1", 2), "[::1]:2");
  EXPECT_EQ(LocalAddress("localhost:1", 2), "localhost:2");
}

}  // namespace
}  // namespace rigcal::server::running_server_test

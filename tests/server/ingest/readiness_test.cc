// SPDX-License-Identifier: Apache-2.0
#include "server/ingest/readiness.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/testing/status_matchers.h"
#include "tests/testing/temporary_directory.h"

namespace rigcal::testing::readiness_test {
namespace {

using ::testing::HasSubstr;

constexpr uint64_t kMiB = 1 << 20;

class Readiness : public ::testing::Test {
 protected:
  absl::Status Of() const { return server::Readiness(data_dir_, store_, ingest_); }

  TemporaryDirectory folder_;
  std::string data_dir_ = folder_.path();
  server::StoreHealth store_{.kind = "fake", .free_bytes = 100 * kMiB, .reserve_bytes = 50 * kMiB};
  server::IngestStats ingest_;
};

TEST_F(Readiness, AHealthyServerIsReady) { EXPECT_THAT(Of(), IsOk()); }

TEST_F(Readiness, NamesTheReserveOfTheDisk) {
  store_.free_bytes = 49 * kMiB;
  EXPECT_THAT(Of(), StatusIs(absl::StatusCode::kUnavailable, HasSubstr("49 MiB left")));
  // Nothing is known of the disk.
  store_.free_bytes = store_.reserve_bytes = 0;
  EXPECT_THAT(Of(), IsOk());
}

TEST_F(Readiness, UnusedSpaceOfTheStoreIsRoom) {
  store_.free_bytes = 10 * kMiB;
  store_.unused_bytes = 39 * kMiB;
  EXPECT_THAT(Of(), StatusIs(absl::StatusCode::kUnavailable, HasSubstr("49 MiB left")));
  store_.unused_bytes = 40 * kMiB;
  EXPECT_THAT(Of(), IsOk());
}

TEST_F(Readiness, SaysThatSomethingCannotBeRead) {
  store_.read_problem = "the store cannot be read";
  EXPECT_THAT(Of(), StatusIs(absl::StatusCode::kUnavailable, HasSubstr("cannot be read")));
}

TEST_F(Readiness, NamesAFolderThatIsGone) {
  data_dir_ += "/gone";
  EXPECT_THAT(Of(), StatusIs(absl::StatusCode::kUnavailable, HasSubstr(data_dir_)));
}

TEST_F(Readiness, TellsWhatTheStoreAndTheWriterSay) {
  ingest_.problem = "the writer stands still";
  EXPECT_THAT(Of(), StatusIs(absl::StatusCode::kUnavailable, HasSubstr("stands still")));
  store_.problem = "a sync failed";
  EXPECT_THAT(Of(), StatusIs(absl::StatusCode::kUnavailable, HasSubstr("a sync failed")));
}

}  // namespace
}  // namespace rigcal::testing::readiness_test

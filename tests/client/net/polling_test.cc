// SPDX-License-Identifier: Apache-2.0
#include "client/net/polling.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <vector>

#include "tests/testing/status_matchers.h"

namespace rigcal::client::polling_test {
namespace {

using ::rigcal::testing::IsOk;
using ::rigcal::testing::StatusIs;
using ::testing::_;

using Answers = std::vector<absl::StatusOr<int>>;

absl::StatusOr<int> PollUntilThree(const Answers& answers, PollOptions options) {
  auto next = answers.begin();
  options.interval = std::chrono::milliseconds(0);
  return PollUntil(
      [&]() -> absl::StatusOr<int> {
        if (next == answers.end()) return absl::OutOfRangeError("asked once too often");
        return *next++;
      },
      [](int value) { return value == 3; }, options);
}

const absl::Status kAway = absl::UnavailableError("away");

TEST(PollUntil, AsksUntilItIsDone) {
  ASSERT_OK_AND_ASSIGN(const int answer, PollUntilThree({1, 2, 3}, {}));
  EXPECT_EQ(answer, 3);
}

TEST(PollUntil, AServerThatComesBackIsWaitedFor) {
  EXPECT_THAT(PollUntilThree({kAway, 1, kAway, kAway, 2, kAway, 3}, {}), IsOk());
}

TEST(PollUntil, PatienceEnds) {
  PollOptions options;
  options.patience = std::chrono::milliseconds(-1);
  EXPECT_THAT(PollUntilThree({1, kAway, 3}, options), StatusIs(absl::StatusCode::kUnavailable, _));
}

TEST(PollUntil, OtherErrorsEndItAtOnce) {
  EXPECT_THAT(PollUntilThree({1, absl::NotFoundError("deleted"), 3}, {}),
              StatusIs(absl::StatusCode::kNotFound, _));
}

TEST(PollUntil, WaitingCanEndIt) {
  PollOptions options;
  options.wait = [](std::chrono::milliseconds) { return absl::CancelledError("interrupted"); };
  EXPECT_THAT(PollUntilThree({1, 3}, options), StatusIs(absl::StatusCode::kCancelled, _));
  EXPECT_THAT(PollUntilThree({3}, options), IsOk());
}

}  // namespace
}  // namespace rigcal::client::polling_test

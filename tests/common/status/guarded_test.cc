// SPDX-License-Identifier: Apache-2.0
#include "common/status/guarded.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <new>
#include <stdexcept>

#include "tests/testing/status_matchers.h"

namespace rigcal::guarded_test {
namespace {

using ::rigcal::testing::IsOk;
using ::rigcal::testing::StatusIs;

TEST(Guarded, ReturnsWhatTheBodyReturns) {
  bool called = false;
  EXPECT_THAT(Guarded("a round", [&] { called = true; }), IsOk());
  EXPECT_TRUE(called);
  EXPECT_THAT(Guarded("a round", [] { return absl::NotFoundError("gone"); }),
              StatusIs(absl::StatusCode::kNotFound, "gone"));
}

TEST(Guarded, TurnsWhatIsThrownIntoAStatus) {
  EXPECT_THAT(Guarded("a round", [] { throw std::runtime_error("broken"); }),
              StatusIs(absl::StatusCode::kInternal, "a round: broken"));
  EXPECT_THAT(Guarded("a round", []() -> absl::Status { throw std::bad_alloc(); }),
              StatusIs(absl::StatusCode::kInternal, "a round: std::bad_alloc"));
  EXPECT_THAT(Guarded("a round", [] { throw 7; }),
              StatusIs(absl::StatusCode::kInternal, "a round: an exception of an unknown kind"));
}

}  // namespace
}  // namespace rigcal::guarded_test

// SPDX-License-Identifier: Apache-2.0
#include "common/failpoint/failpoint.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <chrono>
#include <cstdlib>

#include "tests/testing/status_matchers.h"

namespace rigcal::failpoint_test {
namespace {

using ::rigcal::testing::IsOk;
using ::rigcal::testing::StatusIs;
using ::testing::HasSubstr;
using ::testing::SizeIs;

TEST(Failpoint, ReadsAbortAndSleepAndThePass) {
  ASSERT_OK_AND_ASSIGN(const auto actions,
                       ParseFailpoints("after_send:abort@7,before_commit:sleep_250"));
  ASSERT_THAT(actions, SizeIs(2));
  EXPECT_EQ(actions[0].name, "after_send");
  EXPECT_TRUE(actions[0].abort);
  EXPECT_EQ(actions[0].pass, 7u);
  EXPECT_FALSE(actions[1].abort);
  EXPECT_EQ(actions[1].sleep, std::chrono::milliseconds(250));
  EXPECT_EQ(actions[1].pass, 1u);
}

TEST(Failpoint, RefusesWhatItDoesNotUnderstand) {
  for (const char* text :
       {"after_send", "after_send:", "nowhere:abort", "after_send:stop", "after_send:sleep_",
        "after_send:sleep_0", "after_send:sleep_-5", "after_send:sleep_5s", "after_send:abort@0",
        "after_send:abort@x", "after_send:sleep_99999999", ":abort"}) {
    EXPECT_THAT(ParseFailpoints(text),
                StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("RIGCAL_FAILPOINT")))
        << text;
  }
  EXPECT_THAT(ParseFailpoints("nowhere:abort"),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("before_commit")));
}

TEST(FailpointDeathTest, AbortsAtThePassThatIsAsked) {
  EXPECT_DEATH(
      {
        setenv("RIGCAL_FAILPOINT", "after_send:abort@3", 1);
        if (!ActivateFailpoints().ok()) std::exit(0);
        Failpoint("after_spool_append");
        Failpoint("after_send");
        Failpoint("after_send");
        std::fprintf(stderr, "two passes; ");
        Failpoint("after_send");
        std::exit(0);
      },
      "two passes; failpoint after_send: abort");
}

TEST(Failpoint, DoesNothingUnlessItIsActive) {
  unsetenv("RIGCAL_FAILPOINT");
  EXPECT_THAT(ActivateFailpoints(), IsOk());
  Failpoint("after_send");
}

}  // namespace
}  // namespace rigcal::failpoint_test

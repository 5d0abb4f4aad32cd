// SPDX-License-Identifier: Apache-2.0
#include "server/session/calibration_request.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "tests/server/session/session_fixture.h"
#include "tests/testing/status_matchers.h"

namespace rigcal::testing::calibration_request_test {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

using Ids = std::vector<std::string>;

TEST(CheckNamedSessionsTest, RefusesWhatNamesNoSolvableSet) {
  const CalibrationOptions solve;
  EXPECT_THAT(server::CheckNamedSessions(Ids{"a", "b"}, solve), IsOk());
  EXPECT_THAT(server::CheckNamedSessions(Ids(), solve),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("is empty")));
  EXPECT_THAT(server::CheckNamedSessions(Ids{"a", "b", "a"}, solve),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("'a' twice")));
  EXPECT_THAT(server::CheckNamedSessions(Ids(65, "a"), solve),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("65 sessions")));
}

TEST(CheckNamedSessionsTest, ANewFrameIsMadeFromOneSessionOrNone) {
  CalibrationOptions frame;
  frame.kind = SolveKind::kOrigin;
  EXPECT_THAT(server::CheckNamedSessions(Ids(), frame), IsOk());
  EXPECT_THAT(server::CheckNamedSessions(Ids{"a"}, frame), IsOk());
  EXPECT_THAT(server::CheckNamedSessions(Ids{"a", "b"}, frame),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("the rows of one")));
}

class SessionsToUse : public SessionFixture {
 protected:
  // Each goes on with the one before.
  void Record(const Ids& ids) {
    std::string earlier;
    for (const std::string& id : ids) {
      Session session = NewSession(id);
      session.cameras.push_back({MakeCamera("left"), ""});
      session.continues = earlier;
      ASSERT_THAT(coordinator().CreateSession(session), IsOk());
      ASSERT_THAT(coordinator().StartSession(id), IsOk());
      ASSERT_THAT(coordinator().StopSession(id, 0.001), IsOk());
      AwaitFinished(id);
      earlier = id;
    }
  }
};

TEST_F(SessionsToUse, ThoseThatAreContinuedComeBehind) {
  Record({"one", "two", "three"});
  CalibrationOptions options;
  options.without_sessions = {"two"};
  ASSERT_OK_AND_ASSIGN(const Ids used, server::SessionsToUse(*faulty_, {"three"}, &options));
  EXPECT_THAT(used, ElementsAre("three", "one"));
  EXPECT_THAT(options.without_sessions, IsEmpty());
}

TEST_F(SessionsToUse, ARepairUsesThoseThatAreNamed) {
  Record({"one", "two"});
  CalibrationOptions options;
  options.kind = SolveKind::kRepair;
  ASSERT_OK_AND_ASSIGN(const Ids used, server::SessionsToUse(*faulty_, {"two"}, &options));
  EXPECT_THAT(used, ElementsAre("two"));
}

TEST_F(SessionsToUse, RefusesToLeaveNone) {
  Record({"one"});
  CalibrationOptions options;
  options.without_sessions = {"one"};
  EXPECT_THAT(server::SessionsToUse(*faulty_, {"one"}, &options),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("leaves no session")));
  options.without_sessions.clear();
  EXPECT_THAT(server::SessionsToUse(*faulty_, {"nobody"}, &options),
              StatusIs(absl::StatusCode::kNotFound, HasSubstr("nobody")));
}

}  // namespace
}  // namespace rigcal::testing::calibration_request_test

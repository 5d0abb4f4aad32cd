// SPDX-License-Identifier: Apache-2.0
#include "server/session/session_rules.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <limits>
#include <string>
#include <vector>

#include "tests/server/session/session_fixture.h"
#include "tests/testing/status_matchers.h"

namespace rigcal::testing::session_rules_test {
namespace {

using server::AgentDirectory;
using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;

std::vector<AgentDirectory::ConnectedCamera> Connected(const std::vector<std::string>& names) {
  std::vector<AgentDirectory::ConnectedCamera> cameras;
  for (const std::string& name : names) cameras.push_back({{MakeCamera(name), 1}, "pc", nullptr});
  return cameras;
}

std::vector<std::string> Names(const std::vector<SessionCamera>& cameras) {
  std::vector<std::string> names;
  for (const SessionCamera& camera : cameras) {
    names.push_back(camera.description.camera + ":" + camera.agent_id);
  }
  return names;
}

TEST(ValidateNewSession, ListsEveryFaultAtOnce) {
  Session session = NewSession("a b");
  session.target.marker_positions_m = {0};
  session.requested_cameras = {"left", "left"};
  session.title = std::string(5000, 'x');
  EXPECT_THAT(server::ValidateNewSession(session, 10),
              StatusIs(absl::StatusCode::kInvalidArgument,
                       AllOf(HasSubstr("session id"), HasSubstr("'left' is named twice"),
                             HasSubstr("5000 bytes"), HasSubstr("position"))));
}

TEST(ValidateNewSession, ChecksTheGoal) {
  Session session = NewSession("p");
  session.goal = SessionGoal{.until_mm = 0.5};
  EXPECT_THAT(server::ValidateNewSession(session, 10), IsOk());
  constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
  constexpr double kInfinity = std::numeric_limits<double>::infinity();
  for (const double until_mm : {0.0, -1.0, 1001.0, kNan, kInfinity}) {
    session.goal = SessionGoal{.until_mm = until_mm};
    EXPECT_THAT(server::ValidateNewSession(session, 10),
                StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("goal.until_mm is")));
  }
  for (const double min_s : {-1.0, 1e9, kNan}) {
    session.goal = SessionGoal{.until_mm = 1, .min_duration_s = min_s};
    EXPECT_THAT(server::ValidateNewSession(session, 10),
                StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("goal.min_duration is")));
  }
}

TEST(ContinuedSession, IsFinishedAndOfTheSameRigAndTarget) {
  const Session session = NewSession("next");
  Session earlier = NewSession("wave");
  earlier.state = SessionState::kFinished;
  EXPECT_THAT(server::CheckContinues(session, earlier), IsOk());
  const auto refuses = [&](const Session& other, const char* why) {
    EXPECT_THAT(server::CheckContinues(session, other),
                StatusIs(absl::StatusCode::kFailedPrecondition,
                         AllOf(HasSubstr("session 'wave'"), HasSubstr(why))));
  };
  Session other = earlier;
  other.state = SessionState::kCapturing;
  other.start_utc_ns = 1'800'000'000'000'000'000;
  refuses(other, "capturing since 2027-01-15 08:00:00 UTC");
  other = earlier;
  other.rig = "lab";
  refuses(other, "'lab'");
  other = earlier;
  other.target.marker_positions_m = {0, 1};
  refuses(other, "target");
  other = earlier;
  other.observations_delete_utc_ns = 1;
  refuses(other, "deleted");
}

TEST(SessionRules, ARunningSessionIsNeitherDeletedNorThrownAway) {
  Session session = NewSession("wave");
  EXPECT_THAT(server::CheckNotRunning(session, "deleted"), IsOk());
  session.state = SessionState::kCapturing;
  EXPECT_THAT(server::CheckNotRunning(session, "deleted"),
              StatusIs(absl::StatusCode::kFailedPrecondition,
                       HasSubstr("'wave' cannot be deleted: it is capturing; stop it first")));
  session.state = SessionState::kDraining;
  EXPECT_THAT(server::CheckNotRunning(session, "thrown away"),
              StatusIs(absl::StatusCode::kFailedPrecondition,
                       HasSubstr("cannot be thrown away: it is draining; wait for its end")));
  session.state = SessionState::kFinished;
  EXPECT_THAT(server::CheckNotRunning(session, "deleted"), IsOk());
}

TEST(SessionRules, StartsOnlyWhatHasNotBeenStarted) {
  Session session = NewSession("wave");
  EXPECT_THAT(server::CheckMayStart(session), IsOk());
  EXPECT_THAT(server::CheckMayStop(session),
              StatusIs(absl::StatusCode::kFailedPrecondition, HasSubstr("not been started")));
  session.discard_utc_ns = 1;
  EXPECT_THAT(server::CheckMayStart(session),
              StatusIs(absl::StatusCode::kFailedPrecondition, HasSubstr("--undo")));
  session.discard_utc_ns = 0;
  session.state = SessionState::kFinished;
  session.stop_reason = "the wand broke";
  EXPECT_THAT(server::CheckMayStart(session),
              StatusIs(absl::StatusCode::kFailedPrecondition, HasSubstr("(the wand broke)")));
  EXPECT_THAT(server::CheckMayStop(session), IsOk());
}

TEST(SessionRules, ACameraHasEndedWhenAllOfItsStreamsHave) {
  Session session = NewSession("wave");
  std::vector<SessionCameraCounts> counts;
  for (const char* name : {"left", "right", "top"}) {
    session.cameras.push_back({MakeCamera(name), "pc"});
    counts.emplace_back().camera = name;
  }
  counts[0].streams = {{.stream_epoch = 1, .durable_seq = 9, .last_seq = 9}};
  counts[1].streams = {{.stream_epoch = 1, .durable_seq = 9, .last_seq = 9},
                       {.stream_epoch = 2, .durable_seq = 4, .last_seq = 5}};
  EXPECT_THAT(server::CamerasNotEnded(session, counts), ElementsAre("right", "top"));
}

TEST(ValidateNewSession, TakesAPointOfOneMarkerOnly) {
  Session session = NewSession("p");
  session.target.kind = TargetKind::kPoint;
  session.target.marker_positions_m = {0};
  EXPECT_THAT(server::ValidateNewSession(session, 10), IsOk());
  session.target.marker_positions_m = {0, 0.1};
  EXPECT_THAT(server::ValidateNewSession(session, 10),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("point")));
}

TEST(ValidateNewSession, RefusesACameraBothNamedAndDescribed) {
  Session session = NewSession("p");
  session.requested_cameras = {"left"};
  session.cameras = {{MakeCamera("left"), ""}};
  EXPECT_THAT(server::ValidateNewSession(session, 10),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("'left'")));
}

TEST(ValidateNewSession, LimitsTheCameras) {
  Session session = NewSession("p");
  session.requested_cameras = {"a", "b", "c"};
  EXPECT_THAT(server::ValidateNewSession(session, 2),
              StatusIs(absl::StatusCode::kResourceExhausted, HasSubstr("3 cameras")));
  EXPECT_THAT(server::ValidateNewSession(session, 3), IsOk());
}

TEST(ChooseCameras, TakesAllThatAreConnected) {
  ASSERT_OK_AND_ASSIGN(const auto cameras,
                       server::ChooseCameras(NewSession("s"), Connected({"right", "left"}), 9));
  EXPECT_THAT(Names(cameras), ElementsAre("left:pc", "right:pc"));
}

TEST(ChooseCameras, TakesTheNamedOnesOnly) {
  Session session = NewSession("s");
  session.requested_cameras = {"right"};
  ASSERT_OK_AND_ASSIGN(const auto cameras,
                       server::ChooseCameras(session, Connected({"left", "right"}), 9));
  EXPECT_THAT(Names(cameras), ElementsAre("right:pc"));
}

TEST(ChooseCameras, CamerasByHandNeedNoAgentAndTakeNoOther) {
  Session session = NewSession("s");
  session.cameras = {{MakeCamera("hand"), ""}};
  ASSERT_OK_AND_ASSIGN(const auto cameras, server::ChooseCameras(session, Connected({"left"}), 9));
  EXPECT_THAT(Names(cameras), ElementsAre("hand:"));
}

TEST(ChooseCameras, NamesEveryMissingOneAndThoseThatAreThere) {
  Session session = NewSession("s");
  session.requested_cameras = {"top", "left", "low"};
  EXPECT_THAT(server::ChooseCameras(session, Connected({"left", "right"}), 9),
              StatusIs(absl::StatusCode::kFailedPrecondition,
                       AllOf(HasSubstr("'low', 'top'"), HasSubstr("'left', 'right'"))));
}

TEST(ChooseCameras, RefusesAnEmptyRigAndTooManyCameras) {
  EXPECT_THAT(server::ChooseCameras(NewSession("s"), {}, 9),
              StatusIs(absl::StatusCode::kFailedPrecondition, HasSubstr("no camera of rig 'rig'")));
  EXPECT_THAT(server::ChooseCameras(NewSession("s"), Connected({"a", "b"}), 1),
              StatusIs(absl::StatusCode::kResourceExhausted, HasSubstr("2 cameras")));
}

TEST(CheckNotCapturing, NamesCameraAndSession) {
  Session other = NewSession("busy");
  other.state = SessionState::kCapturing;
  other.cameras = {{MakeCamera("left"), "pc"}};
  Session starting = NewSession("new");
  starting.cameras = {{MakeCamera("left"), "pc"}};
  EXPECT_THAT(server::CheckNotCapturing(starting, {&other, 1}),
              StatusIs(absl::StatusCode::kFailedPrecondition,
                       AllOf(HasSubstr("'rig/left'"), HasSubstr("'busy'"), HasSubstr("'new'"))));
  other.state = SessionState::kDraining;
  EXPECT_THAT(server::CheckNotCapturing(starting, {&other, 1}), IsOk());
  other.state = SessionState::kCapturing;
  other.rig = "elsewhere";
  EXPECT_THAT(server::CheckNotCapturing(starting, {&other, 1}), IsOk());
}

TEST(DrainTimeout, HasADefaultAndALimit) {
  ASSERT_OK_AND_ASSIGN(const double by_default, server::DrainTimeout(0));
  EXPECT_EQ(by_default, 10);
  ASSERT_OK_AND_ASSIGN(const double most, server::DrainTimeout(600));
  EXPECT_EQ(most, 600);
  for (const double bad : {-1.0, 600.1, std::numeric_limits<double>::quiet_NaN(),
                           std::numeric_limits<double>::infinity()}) {
    EXPECT_THAT(server::DrainTimeout(bad),
                StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("drain_timeout is")));
  }
}

}  // namespace
}  // namespace rigcal::testing::session_rules_test

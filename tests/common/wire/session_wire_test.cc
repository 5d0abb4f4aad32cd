// SPDX-License-Identifier: Apache-2.0
#include "common/wire/session_wire.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/testing/status_matchers.h"

namespace rigcal::wire::session_wire_test {
namespace {

using ::rigcal::testing::IsOk;
using ::rigcal::testing::StatusIs;
using ::testing::HasSubstr;

TEST(SessionWire, StoredFormReadsBackEqual) {
  Session session;
  session.id = "s-1";
  session.rig = "rig";
  session.title = "evening";
  session.state = SessionState::kDraining;
  session.target.marker_positions_m = {0, 0.13, 0.39};
  session.requested_cameras = {"a"};
  CameraDescription camera;
  camera.camera = "a";
  camera.image_size_px = {1280, 1024};
  camera.clock = {"a", "recording"};
  session.cameras.push_back({camera, "agent-1"});
  session.start_utc_ns = 1'700'000'000'000'000'001;
  session.missing_cameras = {"a"};
  ASSERT_OK_AND_ASSIGN(const Session back, ParseSession(SerializeSession(session)));
  EXPECT_EQ(back.cameras.at(0).description, camera);
  EXPECT_EQ(back.cameras.at(0).agent_id, "agent-1");
  EXPECT_EQ(back.start_utc_ns, session.start_utc_ns);
  EXPECT_EQ(back.stop_utc_ns, 0);
  EXPECT_EQ(back.state, SessionState::kDraining);
  EXPECT_EQ(back.requested_cameras, session.requested_cameras);
  EXPECT_EQ(SerializeSession(back), SerializeSession(session));
}

TEST(SessionWire, RefusesWhatCannotBeASession) {
  v1::CreateSessionRequest request;
  EXPECT_THAT(FromProto(request),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("target")));
  request.mutable_target()->set_kind(v1::Target::KIND_WAND);
  request.mutable_target()->add_marker_positions_m(0);
  EXPECT_THAT(FromProto(request), StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("two")));
  request.mutable_target()->add_marker_positions_m(0.13);
  EXPECT_THAT(FromProto(request), IsOk());
}

}  // namespace
}  // namespace rigcal::wire::session_wire_test

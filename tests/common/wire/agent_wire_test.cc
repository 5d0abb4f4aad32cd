// SPDX-License-Identifier: Apache-2.0
#include "common/wire/agent_wire.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <functional>
#include <limits>
#include <string>
#include <vector>

#include "common/wire/camera_wire.h"
#include "common/wire/observation_wire.h"
#include "common/wire/protocol_version.h"
#include "tests/testing/status_matchers.h"

namespace rigcal::testing::agent_wire_test {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;

const StreamKey kLeft{"wave", "left", 1};

CameraDescription Camera(const std::string& name) {
  CameraDescription camera;
  camera.camera = name;
  camera.image_size_px = {.width = 1280, .height = 1024};
  camera.clock = {.clock_id = name, .timebase = "recording"};
  return camera;
}

v1::AgentHello Hello(const std::string& agent_id, const std::vector<std::string>& cameras,
                     uint32_t incarnation = 1, uint32_t connection = 1) {
  v1::AgentHello hello;
  *hello.mutable_protocol_version() = wire::OwnProtocolVersion();
  hello.set_agent_id(agent_id);
  hello.set_incarnation(incarnation);
  hello.set_connection(connection);
  hello.set_host("host-of-" + agent_id);
  hello.set_rig("rig");
  for (const std::string& camera : cameras) {
    *hello.add_cameras()->mutable_description() = wire::ToProto(Camera(camera));
    hello.mutable_cameras(hello.cameras_size() - 1)->set_stream_epoch(1);
  }
  return hello;
}

TEST(AgentHelloWire, TakesEveryField) {
  v1::AgentHello proto = Hello("pc", {"left", "right"}, 3, 4);
  proto.mutable_cameras(1)->set_stream_epoch(7);
  *proto.add_pending() = wire::ToProto(kLeft);
  ASSERT_OK_AND_ASSIGN(const AgentHello hello, wire::FromProto(proto));
  EXPECT_EQ(hello.agent.agent_id, "pc");
  EXPECT_EQ(hello.agent.incarnation, 3u);
  EXPECT_EQ(hello.agent.connection, 4u);
  EXPECT_EQ(hello.agent.host, "host-of-pc");
  EXPECT_EQ(hello.agent.rig, "rig");
  ASSERT_EQ(hello.agent.cameras.size(), 2u);
  EXPECT_EQ(hello.agent.cameras[0].description, Camera("left"));
  EXPECT_EQ(hello.agent.cameras[1].stream_epoch, 7u);
  EXPECT_THAT(hello.pending, ElementsAre(kLeft));
}

TEST(AgentHelloWire, TakesOneMinorVersionApartAndNoMore) {
  v1::AgentHello proto = Hello("pc", {"left"});
  proto.mutable_protocol_version()->set_minor(wire::kProtocolMinor + 1);
  EXPECT_THAT(wire::FromProto(proto), IsOk());
  proto.mutable_protocol_version()->set_minor(wire::kProtocolMinor + 2);
  EXPECT_THAT(wire::FromProto(proto),
              StatusIs(absl::StatusCode::kFailedPrecondition, HasSubstr("2.2")));
  proto.clear_protocol_version();
  EXPECT_THAT(wire::FromProto(proto),
              StatusIs(absl::StatusCode::kFailedPrecondition, HasSubstr("0.0")));
}

TEST(AgentHelloWire, NamesTheFaultyField) {
  struct Case {
    std::function<void(v1::AgentHello* hello)> damage;
    std::string said;
  };
  const std::vector<Case> cases = {
      {[](v1::AgentHello* hello) { hello->clear_agent_id(); }, "hello.agent_id"},
      {[](v1::AgentHello* hello) { hello->set_rig("a/b"); }, "hello.rig"},
      {[](v1::AgentHello* hello) { hello->mutable_cameras(0)->set_stream_epoch(0); },
       "hello.cameras[0].stream_epoch"},
      {[](v1::AgentHello* hello) {
         hello->mutable_cameras(0)->mutable_description()->mutable_intrinsics()->set_fx_px(
             std::numeric_limits<double>::quiet_NaN());
       },
       "hello.cameras[0].description"},
  };
  for (const Case& bad : cases) {
    v1::AgentHello hello = Hello("pc", {"left"});
    bad.damage(&hello);
    EXPECT_THAT(wire::FromProto(hello),
                StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr(bad.said)));
  }
}

TEST(AgentHelloWire, BoundsWhatIsPending) {
  v1::AgentHello proto = Hello("pc", {"left"});
  for (int i = 0; i < 5000; ++i) *proto.add_pending() = wire::ToProto(kLeft);
  EXPECT_THAT(wire::FromProto(proto),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("hello.pending")));
}

TEST(AgentWire, AnAgentHasItsCamerasAndTimes) {
  AgentRecord agent;
  agent.agent_id = "pc";
  agent.host = "host";
  agent.rig = "rig";
  agent.cameras = {{Camera("left"), 3}};
  agent.connect_utc_ns = 5'000'000'007;
  v1::Agent proto = wire::ToProto(agent);
  EXPECT_EQ(proto.agent_id(), "pc");
  EXPECT_EQ(proto.cameras(0).camera(), "left");
  EXPECT_EQ(proto.connect_time().seconds(), 5);
  EXPECT_EQ(proto.connect_time().nanos(), 7);
  EXPECT_FALSE(proto.has_disconnect_time());
  agent.disconnect_utc_ns = 6'000'000'000;
  EXPECT_EQ(wire::ToProto(agent).disconnect_time().seconds(), 6);
}

TEST(AgentWire, AStartCommandKeepsItsPositions) {
  StartCaptureCommand command;
  command.session_id = "wave";
  command.target.marker_positions_m = {0, 0.2};
  command.cameras = {{.stream = kLeft, .durable_seq = 7, .send_limit_seq = 9, .unknown = false}};
  const v1::StartCapture proto = wire::ToProto(command);
  EXPECT_EQ(proto.session_id(), "wave");
  EXPECT_EQ(proto.target().marker_positions_m_size(), 2);
  ASSERT_EQ(proto.cameras_size(), 1);
  const v1::StreamPosition& position = proto.cameras(0);
  EXPECT_EQ(*wire::FromProto(position.stream()), kLeft);
  EXPECT_EQ(position.durable_seq(), 7u);
  EXPECT_EQ(position.send_limit_seq(), 9u);
  EXPECT_FALSE(position.unknown());
}

}  // namespace
}  // namespace rigcal::testing::agent_wire_test

// SPDX-License-Identifier: Apache-2.0
#include "server/rpc/agent_messages.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "common/wire/observation_wire.h"
#include "common/wire/protocol_version.h"
#include "tests/server/rpc/test_agent.h"
#include "tests/server/session/session_fixture.h"
#include "tests/testing/status_matchers.h"

namespace rigcal::testing::agent_messages_test {
namespace {

using server::ParseDelivery;
using server::ParseHello;
using ::testing::ElementsAre;
using ::testing::HasSubstr;

const StreamKey kLeft{"wave", "left", 1};

TEST(ParseHello, TakesEveryField) {
  v1::AgentHello proto = MakeHello("pc", {"left", "right"}, 3, 4);
  proto.mutable_cameras(1)->set_stream_epoch(7);
  *proto.add_pending() = wire::ToProto(kLeft);
  ASSERT_OK_AND_ASSIGN(const server::Hello hello, ParseHello(proto));
  EXPECT_EQ(hello.agent.agent_id, "pc");
  EXPECT_EQ(hello.agent.incarnation, 3u);
  EXPECT_EQ(hello.agent.connection, 4u);
  EXPECT_EQ(hello.agent.host, "host-of-pc");
  EXPECT_EQ(hello.agent.rig, "rig");
  ASSERT_EQ(hello.agent.cameras.size(), 2u);
  EXPECT_EQ(hello.agent.cameras[0].description, MakeCamera("left"));
  EXPECT_EQ(hello.agent.cameras[1].stream_epoch, 7u);
  EXPECT_THAT(hello.pending, ElementsAre(kLeft));
}

TEST(ParseHello, TakesOneMinorVersionApartAndNoMore) {
  v1::AgentHello proto = MakeHello("pc", {"left"});
  proto.mutable_protocol_version()->set_minor(wire::kProtocolMinor - 1);
  EXPECT_THAT(ParseHello(proto), IsOk());
  proto.mutable_protocol_version()->set_minor(wire::kProtocolMinor + 1);
  EXPECT_THAT(ParseHello(proto), IsOk());
  proto.mutable_protocol_version()->set_minor(wire::kProtocolMinor + 2);
  EXPECT_THAT(ParseHello(proto), StatusIs(absl::StatusCode::kFailedPrecondition, HasSubstr("1.3")));
  proto.clear_protocol_version();
  EXPECT_THAT(ParseHello(proto), StatusIs(absl::StatusCode::kFailedPrecondition, HasSubstr("0.0")));
}

TEST(ParseHello, BoundsWhatIsPending) {
  v1::AgentHello proto = MakeHello("pc", {"left"});
  for (int i = 0; i < 5000; ++i) *proto.add_pending() = wire::ToProto(kLeft);
  EXPECT_THAT(ParseHello(proto),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("hello.pending")));
}

TEST(ParseDelivery, KnowsItsStream) {
  v1::ObservationBatch batch;
  wire::ToProto(MakeBatch(kLeft, 5, 8), &batch);
  ASSERT_OK_AND_ASSIGN(const server::Delivery rows, ParseDelivery(batch, 4));
  EXPECT_EQ(rows.stream(), kLeft);
  EXPECT_EQ(rows.batch.rows(), 4u);
  EXPECT_THAT(ParseDelivery(batch, 3),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("batch.time_ns")));
  ASSERT_OK_AND_ASSIGN(const server::Delivery end,
                       ParseDelivery(EndMessage(kLeft, 8).end_of_capture()));
  EXPECT_EQ(end.stream(), kLeft);
  EXPECT_EQ(end.last_seq, 8u);
  EXPECT_EQ(end.batch.rows(), 0u);
  v1::CameraReport report;
  EXPECT_THAT(ParseDelivery(report),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("session_id")));
}

TEST(ParseDelivery, AnUploadIsOfOneStream) {
  v1::UploadBatchRequest request;
  EXPECT_THAT(ParseDelivery(request, 10),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("neither")));
  wire::ToProto(MakeBatch(kLeft, 1, 3), request.mutable_batch());
  *request.mutable_end_of_capture() = EndMessage({"wave", "right", 1}, 3).end_of_capture();
  EXPECT_THAT(ParseDelivery(request, 10),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("end_of_capture")));
  *request.mutable_end_of_capture() = EndMessage(kLeft, 3).end_of_capture();
  ASSERT_OK_AND_ASSIGN(const server::Delivery both, ParseDelivery(request, 10));
  EXPECT_EQ(both.batch.rows(), 3u);
  EXPECT_EQ(both.last_seq, 3u);
}

}  // namespace
}  // namespace rigcal::testing::agent_messages_test

// SPDX-License-Identifier: Apache-2.0
#include "server/session/capture_orders.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstdint>
#include <limits>
#include <memory>
#include <string>
#include <vector>

#include "tests/server/session/recording_link.h"
#include "tests/server/store/store_fixture.h"
#include "tests/testing/status_matchers.h"

namespace rigcal::testing::capture_orders_test {
namespace {

using ::testing::ElementsAre;
using ::testing::IsEmpty;

using Connected = std::vector<server::AgentDirectory::ConnectedCamera>;

constexpr uint32_t kSendWindow = 100;

class CaptureOrders : public StoreFixture {
 protected:
  void SetUp() override {
    StoreFixture::SetUp();
    session_ = CapturingSession({"a", "b", "c"});
    session_.cameras[0].agent_id = session_.cameras[1].agent_id = "pc-1";
    session_.cameras[2].agent_id = "pc-2";
    ASSERT_THAT(store().CreateSession(session_), IsOk());
  }
  server::CaptureOrders orders() { return {&store(), kSendWindow}; }
  server::AgentDirectory::ConnectedCamera Camera(const std::string& name,
                                                 const std::string& agent_id,
                                                 uint32_t stream_epoch = 1) const {
    server::AgentDirectory::ConnectedCamera camera;
    camera.camera.description.camera = name;
    camera.camera.stream_epoch = stream_epoch;
    camera.agent_id = agent_id;
    camera.link = link_;
    return camera;
  }
  // As the agents get them.
  std::vector<std::string> Sent(const std::vector<server::CaptureOrder>& orders) const {
    for (const server::CaptureOrder& order : orders) order.link->SendStartCapture(order.command);
    return link_->Lines();
  }

  Session session_;
  std::shared_ptr<RecordingLink> link_ = std::make_shared<RecordingLink>();
};

TEST_F(CaptureOrders, StartWithOneOrderForEachAgent) {
  const Connected connected = {Camera("a", "pc-1"), Camera("b", "pc-1", 4), Camera("c", "pc-2")};
  EXPECT_THAT(Sent(orders().ToStart(session_, connected)),
              ElementsAre("start s-test a/1=0 b/4=0", "start s-test c/1=0"));
}

TEST_F(CaptureOrders, LeaveOutCamerasOfOtherSessionsAndOtherAgents) {
  const Connected connected = {Camera("a", "pc-2"), Camera("d", "pc-1")};
  EXPECT_THAT(Sent(orders().ToStart(session_, connected)), IsEmpty());
}

TEST_F(CaptureOrders, ResumeBehindTheStoredRowsWithoutCamerasThatHaveEnded) {
  Append(MakeBatch(KeyOf("a"), 1, 25));
  Append(EndDelivery(KeyOf("c"), 0));
  const Connected connected = {Camera("a", "pc-1"), Camera("b", "pc-1"), Camera("c", "pc-2")};
  ASSERT_OK_AND_ASSIGN(const auto resumed, orders().ToResume(session_, connected));
  ASSERT_EQ(resumed.size(), 1u);
  EXPECT_EQ(resumed[0].command.cameras[0].send_limit_seq, 25u + kSendWindow);
  EXPECT_THAT(Sent(resumed), ElementsAre("start s-test a/1=25 b/1=0"));
}

TEST_F(CaptureOrders, KnowPositionsAndStreamsThatDoNotExist) {
  Append(MakeBatch(KeyOf("a"), kMaxSeq, kMaxSeq));
  server::Delivery lost;
  lost.batch.stream = KeyOf("a");
  lost.batch.dropped = {
      {.first_seq = 1, .count = kMaxSeq - 1, .reason = RefusalReason::kSpoolFreed}};
  Append(lost);
  ASSERT_OK_AND_ASSIGN(const StreamPosition last, orders().PositionOf(KeyOf("a")));
  EXPECT_EQ(last.durable_seq, kMaxSeq);
  EXPECT_EQ(last.send_limit_seq, std::numeric_limits<uint32_t>::max());
  EXPECT_FALSE(last.unknown);
  EXPECT_TRUE(orders().PositionOf(KeyOf("d"))->unknown);
}

}  // namespace
}  // namespace rigcal::testing::capture_orders_test

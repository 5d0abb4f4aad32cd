// SPDX-License-Identifier: Apache-2.0
#include "server/live/rig_state.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <chrono>
#include <memory>
#include <string>

#include "absl/strings/str_cat.h"

namespace rigcal::testing::rig_state_test {
namespace {

using server::LiveSnapshot;
using ::testing::ElementsAre;
using ::testing::IsEmpty;
using ::testing::Pair;

AgentRecord AgentWith(const std::string& camera) {
  AgentRecord agent;
  agent.agent_id = "pc";
  agent.connected = true;
  AnnouncedCamera announced;
  announced.description.camera = camera;
  agent.cameras.push_back(announced);
  return agent;
}

class RigStateTest : public ::testing::Test {
 protected:
  std::shared_ptr<const LiveSnapshot> Update(uint64_t revision) {
    rig_.Advance(now_);
    return state_.Update(rig_, health_, revision, now_, 1'800'000'000'000'000'000);
  }

  server::FollowedRig rig_;
  server::RigState state_{"rig", "0123"};
  server::StoreHealth health_;
  server::FollowedRig::Time now_ = server::FollowedRig::Time(std::chrono::seconds(100));
};

TEST_F(RigStateTest, TakesARevisionOnlyForAChange) {
  const auto first = Update(1);
  ASSERT_NE(first, nullptr);
  EXPECT_EQ(first->revision, 1u);
  EXPECT_EQ(first->rig, "rig");
  EXPECT_EQ(first->incarnation, "0123");
  EXPECT_EQ(Update(2), nullptr);
  rig_.SetAgents({AgentWith("left")});
  const auto second = Update(7);
  ASSERT_NE(second, nullptr);
  EXPECT_EQ(second->revision, 7u);
  EXPECT_EQ(second->agents.revision, 7u);
  EXPECT_EQ(second->alerts.revision, 1u);
  EXPECT_EQ(second->full_since, 0u);
}

TEST_F(RigStateTest, NamesACameraThatWentUntilItIsBack) {
  rig_.SetAgents({AgentWith("left")});
  Update(1);
  rig_.SetAgents({});
  auto state = Update(2);
  ASSERT_NE(state, nullptr);
  EXPECT_THAT(state->cameras, IsEmpty());
  EXPECT_THAT(state->removed_cameras, ElementsAre(Pair(2, "left")));
  rig_.SetAgents({AgentWith("left")});
  state = Update(3);
  ASSERT_NE(state, nullptr);
  EXPECT_EQ(state->cameras.at("left").revision, 3u);
  EXPECT_THAT(state->removed_cameras, IsEmpty());
}

TEST_F(RigStateTest, TellsEverythingAnewRatherThanManyThatWent) {
  uint64_t revision = 0;
  for (int i = 0; i < 300; ++i) {
    rig_.SetAgents({AgentWith(absl::StrCat("camera", i))});
    Update(++revision);
    EXPECT_LE(state_.snapshot().removed_cameras.size(), 256u);
  }
  EXPECT_GT(state_.snapshot().full_since, 0u);
}

// Of hundreds of cameras an answer stays as small as it is useful.
TEST_F(RigStateTest, ManyCamerasHaveNeitherTrailsNorAMatrix) {
  for (const size_t count : {64u, 65u, 256u, 257u, 500u}) {
    Session session;
    session.id = absl::StrCat("wave", count);
    session.state = SessionState::kCapturing;
    session.target.marker_positions_m = {0, 0.13, 0.39};
    for (size_t i = 0; i < count; ++i) {
      SessionCamera camera;
      camera.description.camera = absl::StrCat("camera", i);
      camera.description.clock.clock_id = camera.description.camera;
      camera.description.image_size_px = {640, 480};
      session.cameras.push_back(camera);
    }
    rig_.Follow(session, now_);
    server::Arrivals arrivals;
    arrivals.last_time = now_;
    arrivals.has_rows = true;
    arrivals.stored_count = arrivals.wand_count = 1;
    server::ThinnedRow row;
    row.marker_count = 3;
    row.visible_mask = 7;
    row.x_px = {100, 150, 250};
    row.y_px = {50, 60, 80};
    arrivals.rows = {row};
    rig_.AddArrivals({session.id, "camera7", 1}, arrivals, now_, 1'800'000'000'000'000'000);
    state_.Reset();
    const auto state = Update(count);
    ASSERT_NE(state, nullptr);
    EXPECT_EQ(state->cameras.size(), count);
    EXPECT_EQ(state->cameras.at("camera7").value->trail.size(), count > 64 ? 0u : 1u) << count;
    EXPECT_EQ(state->overlap.value->counts.size(), count > 256 ? 0 : count * (count - 1) / 2);
  }
}

TEST_F(RigStateTest, BeginsAnewWithAnotherSession) {
  Session session;
  session.id = "wave";
  session.state = SessionState::kCapturing;
  session.goal = SessionGoal{.until_mm = 0.5};
  rig_.Follow(session, now_);
  state_.Reset();
  auto state = Update(1);
  ASSERT_NE(state, nullptr);
  EXPECT_EQ(state->session.value->session.id, "wave");
  EXPECT_EQ(state->goal.value->why_not, "there is no estimate yet");
  EXPECT_EQ(Update(2), nullptr);

  rig_.ForgetSession();
  state_.Reset();
  state = Update(2);
  ASSERT_NE(state, nullptr);
  EXPECT_EQ(state->full_since, 2u);
  EXPECT_EQ(state->session.value, nullptr);
  EXPECT_EQ(state->goal.value, nullptr);
}

}  // namespace
}  // namespace rigcal::testing::rig_state_test

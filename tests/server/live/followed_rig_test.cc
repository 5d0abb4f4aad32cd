// SPDX-License-Identifier: Apache-2.0
#include "server/live/followed_rig.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <chrono>
#include <string>
#include <vector>

namespace rigcal::testing::followed_rig_test {
namespace {

using server::Arrivals;
using server::FollowedRig;
using server::LiveCameraState;
using ::testing::ElementsAre;
using ::testing::IsEmpty;
using ::testing::Optional;

constexpr int64_t kMs = 1'000'000;
constexpr int64_t kUtcNs = 1'800'000'000'000'000'000;

Session Wave(const std::vector<std::string>& cameras) {
  Session session;
  session.id = "wave";
  session.rig = "rig";
  session.state = SessionState::kCapturing;
  session.target.marker_positions_m = {0, 0.13, 0.39};
  for (const std::string& name : cameras) {
    SessionCamera camera;
    camera.description.camera = name;
    camera.description.clock.clock_id = name;
    camera.description.image_size_px = {640, 480};
    camera.agent_id = "pc";
    session.cameras.push_back(camera);
  }
  return session;
}

AgentRecord Agent(const std::vector<std::string>& cameras) {
  AgentRecord agent;
  agent.agent_id = "pc";
  agent.connected = true;
  for (const std::string& name : cameras) {
    AnnouncedCamera camera;
    camera.description.camera = name;
    camera.description.image_size_px = {1280, 960};
    agent.cameras.push_back(camera);
  }
  return agent;
}

class FollowedRigTest : public ::testing::Test {
 protected:
  // Rows with the wand every 20 ms, the last one at `newest_ms` of the camera's clock.
  Arrivals Rows(int64_t newest_ms, int count, uint32_t clock_epoch = 0) {
    Arrivals arrivals;
    arrivals.last_time = now_;
    arrivals.has_rows = true;
    arrivals.newest_row_ns = newest_ms * kMs;
    arrivals.clock_epoch = clock_epoch;
    arrivals.stored_count = arrivals.wand_count = static_cast<uint64_t>(count);
    for (int i = count - 1; i >= 0; --i) {
      server::ThinnedRow row;
      row.time_ns = (newest_ms - 20 * i) * kMs;
      row.clock_epoch = clock_epoch;
      row.marker_count = 3;
      row.visible_mask = 7;
      row.x_px = {100, 150, 250};
      row.y_px = {200, 200, 200};
      arrivals.rows.push_back(row);
    }
    return arrivals;
  }
  void Arrive(const std::string& camera, const Arrivals& arrivals, int64_t utc_ns = kUtcNs) {
    rig_.AddArrivals({.session_id = "wave", .camera = camera, .stream_epoch = 1}, arrivals, now_,
                     utc_ns);
  }
  std::optional<int64_t> OffsetNs(const std::string& camera, uint32_t clock_epoch = 0) {
    return rig_.OffsetNs(*rig_.session()->FindCamera(camera), clock_epoch);
  }

  FollowedRig rig_;
  FollowedRig::Time now_ = FollowedRig::Time(std::chrono::seconds(100));
};

TEST_F(FollowedRigTest, ForgetsWhatItCountedWhenTheCamerasChange) {
  Session session = Wave({"left", "right"});
  EXPECT_TRUE(rig_.Follow(session, now_));
  Arrive("left", Rows(1000, 5));
  session.state = SessionState::kDraining;
  EXPECT_FALSE(rig_.Follow(session, now_));
  EXPECT_FALSE(rig_.capturing());
  EXPECT_EQ(rig_.DescribeCamera("left", now_).observation_count, 5u);

  session.cameras.pop_back();
  EXPECT_TRUE(rig_.Follow(session, now_));
  EXPECT_THAT(rig_.order(), ElementsAre("left"));
  EXPECT_EQ(rig_.DescribeCamera("left", now_).observation_count, 0u);
  EXPECT_EQ(OffsetNs("left"), std::nullopt);
}

// What two cameras read of one wand relates them, whatever their stamps say.
TEST_F(FollowedRigTest, ALightCodeRelatesClocksThatAreFarApart) {
  Session session = Wave({"left", "right"});
  for (SessionCamera& camera : session.cameras) camera.description.clock.timebase = "ptp";
  rig_.Follow(session, now_);
  Arrivals left = Rows(1000, 5), right = Rows(3'601'000, 5);
  left.clock_samples = {{0, {.device_ns = 1000 * kMs, .light = 3, .light_ns = 70'000 * kMs}}};
  right.clock_samples = {{0, {.device_ns = 3'601'500 * kMs, .light = 4, .light_ns = 70'500 * kMs}}};
  Arrive("left", left);
  Arrive("right", right);
  EXPECT_THAT(OffsetNs("right"), Optional(0));  // another wand says nothing
  right.clock_samples[0].second.light = 3;
  Arrive("right", right);
  EXPECT_THAT(OffsetNs("left"), Optional(0));
  EXPECT_THAT(OffsetNs("right"), Optional(-3'600'000 * kMs));
  EXPECT_EQ(rig_.DescribeCamera("right", now_).clock.wand, 3u);
  // Within 20 ms the stamps are believed.
  right.clock_samples[0].second.device_ns = 1515 * kMs;
  Arrive("right", right);
  EXPECT_THAT(OffsetNs("right"), Optional(0));
  // Values that cannot be are not used.
  right.clock_samples[0].second.light_ns = int64_t{1} << 62;
  Arrive("right", right);
  EXPECT_THAT(OffsetNs("right"), Optional(0));
}

TEST_F(FollowedRigTest, KnowsAnOffsetFromTheRowThatTookLeast) {
  rig_.Follow(Wave({"left"}), now_);
  EXPECT_EQ(OffsetNs("left"), std::nullopt);
  Arrive("left", Rows(1000, 1), kUtcNs);
  Arrive("left", Rows(1100, 1), kUtcNs + 90 * kMs);
  Arrive("left", Rows(1200, 1), kUtcNs + 250 * kMs);
  EXPECT_THAT(OffsetNs("left"), Optional(kUtcNs - 1010 * kMs));
  // Of the clock's next epoch nothing is known until it sends a row.
  EXPECT_EQ(OffsetNs("left", 1), std::nullopt);
  Arrive("left", Rows(0, 1, 1), kUtcNs + 300 * kMs);
  EXPECT_THAT(OffsetNs("left", 1), Optional(kUtcNs + 300 * kMs));
}

TEST_F(FollowedRigTest, AddsLatencyAndTheEstimatedOffset) {
  Session session = Wave({"left"});
  session.cameras[0].description.latency_s = 0.030;
  rig_.Follow(session, now_);
  Arrive("left", Rows(1000, 1));
  EXPECT_THAT(OffsetNs("left"), Optional(kUtcNs - 1030 * kMs));
  server::LiveEstimatedCamera left;
  left.camera = "left";
  left.time_offset_s = 0.004;
  server::LiveEstimate estimate;
  estimate.cameras.push_back(left);
  rig_.SetEstimate(std::make_shared<const server::LiveEstimate>(estimate));
  EXPECT_THAT(OffsetNs("left"), Optional(kUtcNs - 1026 * kMs));
}

TEST_F(FollowedRigTest, CountsTheOverlapOfClocksThatDiffer) {
  rig_.Follow(Wave({"left", "right", "top"}), now_);
  // At one instant their clocks say 10 s and 70 s.
  const Arrivals left = Rows(10'000, 50), right = Rows(70'000, 50);
  Arrive("left", left);
  Arrive("right", right);
  const std::string session_id = rig_.session()->id;
  rig_.CountOverlap({{{session_id, "left", 1}, left},
                     {{session_id, "right", 1}, right},
                     {{"another session", "top", 1}, left}});
  const server::LiveOverlap overlap = rig_.DescribeOverlap();
  EXPECT_THAT(overlap.cameras, ElementsAre("left", "right", "top"));
  ASSERT_EQ(overlap.counts.size(), 3u);
  EXPECT_NEAR(overlap.counts[0], 50, 2);
  EXPECT_EQ(overlap.counts[1], 0u);
  EXPECT_EQ(overlap.counts[2], 0u);
  EXPECT_NEAR(rig_.DescribeCamera("left", now_).shared_instant_count, 50, 2);
  EXPECT_EQ(rig_.DescribeCamera("top", now_).shared_instant_count, 0u);
}

TEST_F(FollowedRigTest, DescribesCamerasWithoutASession) {
  rig_.SetAgents({Agent({"left"})});
  server::LiveCamera left = rig_.DescribeCamera("left", now_);
  EXPECT_EQ(left.state, LiveCameraState::kIdle);
  EXPECT_EQ(left.agent_id, "pc");
  EXPECT_EQ(left.image_size_px.width, 1280);
  EXPECT_FALSE(left.has_preview);

  // The session's description counts while there is one.
  rig_.Follow(Wave({"left"}), now_);
  left = rig_.DescribeCamera("left", now_);
  EXPECT_EQ(left.state, LiveCameraState::kCapturing);
  EXPECT_EQ(left.image_size_px.width, 640);
  EXPECT_TRUE(left.has_preview);

  rig_.SetAgents({});
  EXPECT_THAT(rig_.connected(), IsEmpty());
  EXPECT_EQ(rig_.DescribeCamera("left", now_).state, LiveCameraState::kOffline);
}

}  // namespace
}  // namespace rigcal::testing::followed_rig_test

// SPDX-License-Identifier: Apache-2.0
#include "client/watch/live_mirror.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>
#include <vector>

namespace rigcal::client::live_mirror_test {
namespace {

using ::testing::ElementsAre;

void AddCamera(const std::string& name, uint64_t count, v1::LiveState* live) {
  v1::LiveCamera* camera = live->add_cameras();
  camera->set_camera(name);
  camera->set_observation_count(count);
}

std::vector<std::string> Cameras(const v1::LiveState& live) {
  std::vector<std::string> cameras;
  for (const v1::LiveCamera& camera : live.cameras()) {
    cameras.push_back(camera.camera() + "=" + std::to_string(camera.observation_count()));
  }
  return cameras;
}

v1::LiveState Full() {
  v1::LiveState live;
  live.set_full(true);
  live.set_revision("r-1");
  live.mutable_time()->set_seconds(1);
  AddCamera("a", 1, &live);
  AddCamera("c", 2, &live);
  live.mutable_session()->set_id("wave");
  live.mutable_alerts()->add_alerts()->set_kind("no_wand");
  return live;
}

TEST(LiveMirror, TakesChangesIntoWhatItHas) {
  LiveMirror mirror;
  EXPECT_FALSE(mirror.state().full());
  EXPECT_TRUE(mirror.Merge(Full()));
  v1::LiveState change;
  change.set_revision("r-2");
  change.mutable_time()->set_seconds(2);
  AddCamera("b", 7, &change);
  AddCamera("c", 5, &change);
  change.add_removed_cameras("a");
  change.mutable_goal()->set_until_mm(0.5);
  EXPECT_TRUE(mirror.Merge(change));
  EXPECT_THAT(Cameras(mirror.state()), ElementsAre("b=7", "c=5"));
  EXPECT_EQ(mirror.state().session().id(), "wave");
  EXPECT_EQ(mirror.state().alerts().alerts(0).kind(), "no_wand");
  EXPECT_EQ(mirror.state().goal().until_mm(), 0.5);
  EXPECT_EQ(mirror.state().revision(), "r-2");
  EXPECT_EQ(mirror.state().time().seconds(), 2);
  // An empty list of alerts is a change too.
  v1::LiveState none = change;
  none.mutable_alerts();
  mirror.Merge(none);
  EXPECT_EQ(mirror.state().alerts().alerts_size(), 0);
}

TEST(LiveMirror, KeepsWhatHasNotChanged) {
  LiveMirror mirror;
  mirror.Merge(Full());
  v1::LiveState nothing;
  nothing.set_revision("r-1");
  EXPECT_FALSE(mirror.Merge(nothing));
  EXPECT_EQ(mirror.state().SerializeAsString(), Full().SerializeAsString());
}

TEST(LiveMirror, AFullStateReplacesEverything) {
  LiveMirror mirror;
  mirror.Merge(Full());
  v1::LiveState other;
  other.set_full(true);
  other.set_revision("s-1");
  other.mutable_time()->set_seconds(3);
  AddCamera("x", 0, &other);
  EXPECT_TRUE(mirror.Merge(other));
  EXPECT_EQ(mirror.state().SerializeAsString(), other.SerializeAsString());
}

}  // namespace
}  // namespace rigcal::client::live_mirror_test

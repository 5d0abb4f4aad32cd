// SPDX-License-Identifier: Apache-2.0
// A session that goes on with another one, and a server that is killed within it.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <csignal>
#include <memory>

#include "tests/integration/live_rig.h"

namespace rigcal::testing::continued_session_test {
namespace {

using ContinuedSession = LiveRig;

TEST_F(ContinuedSession, GoesOnWithWhatWasSeenBefore) {
  StartAgent("");
  StartWave();
  const auto shared = [](const v1::LiveState& live) {
    return live.cameras_size() == 4 ? live.cameras(0).shared_instant_count() : 0;
  };
  ASSERT_TRUE(WaitFor([&] { return shared(Get()) > 200; }));
  ASSERT_EQ(Rigcal({"session", "stop", "wave", "--wait"}).exit_code, 0);
  const CommandResult created = Rigcal({"session", "create", "--target", "wand:0,0.13,0.39", "--id",
                                        "more", "--continue", "wave", "--start"});
  ASSERT_EQ(created.exit_code, 0) << created.error;
  v1::LiveState live;
  // More than it has rows of its own.
  EXPECT_TRUE(WaitFor([&] {
    live = Get();
    return live.session().id() == "more" &&
           shared(live) > live.cameras(0).observation_count() + 100;
  })) << live.DebugString();
  ASSERT_TRUE(WaitFor([&] { return Get().cameras(0).observation_count() > 50; }));

  // Nobody delivers anything after the restart.
  agent_.reset();
  const uint32_t before = shared(Get());
  server_->process().Signal(SIGKILL);
  server_->process().Wait();
  server_ = std::make_unique<ServerProcess>(directory_.path() / "store");
  OpenStub();
  EXPECT_TRUE(WaitFor([&] {
    live = Get();
    return shared(live) > before - before / 20;
  })) << before
      << " before; " << live.DebugString();
  // From both sessions.
  EXPECT_TRUE(WaitFor([&] {
    live = Get();
    return live.estimate().state() == v1::LiveEstimate::STATE_READY &&
           live.estimate().instant_count() > live.cameras(0).observation_count() + 50;
  })) << live.estimate().DebugString();
}

}  // namespace
}  // namespace rigcal::testing::continued_session_test

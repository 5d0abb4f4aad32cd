// SPDX-License-Identifier: Apache-2.0
#include "server/live/earlier_waves.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <atomic>
#include <map>
#include <string>
#include <utility>

#include "tests/server/live/live_fixture.h"
#include "tests/testing/status_matchers.h"

namespace rigcal::testing::earlier_waves_test {
namespace {

using ::testing::ElementsAre;
using ::testing::IsEmpty;
using ::testing::Pair;

class EarlierWaves : public LiveFixture {
 protected:
  // Rows by the session that captures, the session that they are of, and the camera.
  using TappedRows = std::map<std::tuple<std::string, std::string, std::string>, size_t>;

  void Finish(const std::string& id) {
    ASSERT_THAT(coordinator().StopSession(id, 0.001), IsOk());
    AwaitFinished(id);
    now_s_ += 5;
  }
  void Continue(const std::string& earlier, const std::string& id) {
    Session session = NewSession(id);
    session.continues = earlier;
    ASSERT_THAT(coordinator().CreateSession(session), IsOk());
    tracker_->Update();
    ASSERT_THAT(coordinator().StartSession(id), IsOk());
    tracker_->Update();
    session_id_ = id;
  }
  void TapEarlierRows() {
    tracker_->SetEarlierTap([this](const std::string& session, const SessionCamera& camera,
                                   const ObservationBatch& rows) {
      EXPECT_EQ(camera.description.camera, rows.stream.camera);
      tapped_[{session, rows.stream.session_id, rows.stream.camera}] += rows.rows();
    });
  }
  // The tracker's thread makes states from here on, so nothing of the fixture changes any more.
  void ReadEarlier() {
    now_s_ += 1;
    tracker_->Start();
    tracker_->WaitIdle();
    tracker_->Update();
  }
  server::EarlierWaves WavesOf(const std::string& id) {
    return {.session = store().GetSession(id).value(), .now_utc_ns = options_.utc_now_ns()};
  }
  absl::StatusOr<server::EarlierCounts> Read(const server::EarlierWaves& waves) {
    tapped_.clear();
    return server::ReadEarlierWaves(
        store(), waves, cancelled_, [&](const SessionCamera& camera, const ObservationBatch& rows) {
          tapped_[{waves.session.id, rows.stream.session_id, camera.description.camera}] +=
              rows.rows();
        });
  }

  TappedRows tapped_;
  std::atomic<bool> cancelled_ = false;
};

TEST_F(EarlierWaves, AContinuedSessionCountsThem) {
  TapEarlierRows();
  StartWave({"left", "right"});
  Wave(3, {{"left", SeeWand}, {"right", SeeWand}});
  const server::LiveCoverage first = camera("left").coverage;
  Finish("wave");
  Continue("wave", "next");
  Wave(1, {{"left", SeeWand}, {"right", SeeNothing}});
  EXPECT_EQ(camera("left").shared_instant_count, 0u);
  ReadEarlier();
  EXPECT_THAT(tapped_, ElementsAre(Pair(std::tuple("next", "wave", "left"), 150),
                                   Pair(std::tuple("next", "wave", "right"), 150)));
  EXPECT_NEAR(camera("left").shared_instant_count, 150, 8);
  EXPECT_NEAR(camera("right").shared_instant_count, 150, 8);
  EXPECT_NEAR(state()->overlap.value->counts.at(0), 150, 8);
  EXPECT_EQ(camera("right").coverage, first);
  // Rows are those of this session.
  EXPECT_EQ(camera("left").observation_count, 50u);
}

TEST_F(EarlierWaves, ARestartedServerCountsTheSessionsOwn) {
  StartWave({"left", "right"});
  Wave(3, {{"left", SeeWand}, {"right", SeeWand}});
  const server::LiveCoverage before = camera("left").coverage;
  RestartTracker();
  TapEarlierRows();
  EXPECT_EQ(camera("left").shared_instant_count, 0u);
  // What comes now is not read a second time.
  Wave(1, {{"left", SeeWand}, {"right", SeeWand}});
  ReadEarlier();
  EXPECT_THAT(tapped_, ElementsAre(Pair(std::tuple("wave", "wave", "left"), 150),
                                   Pair(std::tuple("wave", "wave", "right"), 150)));
  EXPECT_NEAR(camera("left").shared_instant_count, 200, 10);
  EXPECT_GE(camera("left").coverage.covered_share, before.covered_share);
  EXPECT_EQ(camera("left").observation_count, 200u);
}

// 30 Hz: common time is shown as a number of rows, whose spacing is known from what is stored.
TEST_F(EarlierWaves, ARestartedServerCountsRowsOfSlowCamerasBeforeTheFirstNewOne) {
  StartWave({"left", "right"});
  for (int row = 0; row < 90; ++row) {
    for (const char* name : {"left", "right"}) Send(name, now_s_, 1, SeeWand);
    now_s_ += 1.0 / 30;
    if (row % 3 == 0) tracker_->Update();
  }
  const uint32_t before = camera("left").shared_instant_count;
  EXPECT_GT(before, 60u);
  RestartTracker();
  ReadEarlier();
  EXPECT_NEAR(camera("left").shared_instant_count, before, 5);
  EXPECT_NEAR(state()->overlap.value->counts.at(0), before, 5);
}

TEST_F(EarlierWaves, ReadsEarlierUntilEverythingIsRead) {
  StartWave({"left", "right"});
  Wave(1, {{"left", SeeWand}, {"right", SeeWand}});
  EXPECT_FALSE(tracker_->ReadsEarlier("wave"));
  RestartTracker();
  EXPECT_TRUE(tracker_->ReadsEarlier("wave"));
  EXPECT_FALSE(tracker_->ReadsEarlier("another"));
  ReadEarlier();
  EXPECT_FALSE(tracker_->ReadsEarlier("wave"));
}

TEST_F(EarlierWaves, AChainIsReadFromItsBeginning) {
  StartWave({"left", "right"});
  Wave(1, {{"left", SeeWand}, {"right", SeeWand}});
  Finish("wave");
  Continue("wave", "second");
  Wave(2, {{"left", SeeWand}, {"right", SeeWand}});
  Finish("second");
  Continue("second", "third");
  ASSERT_OK_AND_ASSIGN(const server::EarlierCounts counts, Read(WavesOf("third")));
  EXPECT_NEAR(counts.overlap.PairS(0, 1), 3, 0.2);
  EXPECT_EQ(tapped_.size(), 4u);
  // Without one that was deleted, and what that continued.
  Finish("third");
  ASSERT_THAT(coordinator().DeleteSession("second"), IsOk());
  ASSERT_OK_AND_ASSIGN(const server::EarlierCounts fewer, Read(WavesOf("third")));
  EXPECT_EQ(fewer.overlap.PairS(0, 1), 0);
  EXPECT_THAT(tapped_, IsEmpty());
}

TEST_F(EarlierWaves, ACameraThatIsAnotherOneNowIsLeftOut) {
  StartWave({"left", "right"});
  Wave(1, {{"left", SeeWand}, {"right", SeeWand}});
  Finish("wave");
  Continue("wave", "next");
  server::EarlierWaves waves = WavesOf("next");
  waves.session.cameras[1].description.intrinsics->fx_px += 1;
  ASSERT_OK_AND_ASSIGN(const server::EarlierCounts counts, Read(waves));
  EXPECT_THAT(tapped_, ElementsAre(Pair(std::tuple("next", "wave", "left"), 50)));
  EXPECT_EQ(counts.overlap.PairS(0, 1), 0);
}

TEST_F(EarlierWaves, ClocksOfTheirOwnAreComparedBySamples) {
  clock_offset_s_ = {{"left", 1234}, {"right", -77}};
  StartWave({"other"}, [](Session* session) {
    for (const char* name : {"left", "right"}) {
      session->cameras.push_back({MakeCamera(name), ""});
      session->cameras.back().description.clock.timebase = "";
    }
  });
  for (const std::string name : {"left", "right"}) {
    Send(name, now_s_, 100, SeeWand, [&](server::Delivery* delivery) {
      delivery->batch.clock_samples.push_back(
          {.device_ns = std::llround(1e9 * (now_s_ + clock_offset_s_[name])),
           .host_monotonic_ns = std::llround(1e9 * now_s_),
           .host_utc_ns = options_.utc_now_ns()});
    });
  }
  now_s_ += 2;
  Finish("wave");
  Session next = NewSession("next");
  next.continues = "wave";
  next.cameras = store().GetSession("wave")->cameras;
  ASSERT_OK_AND_ASSIGN(const server::EarlierCounts counts,
                       Read({.session = next, .now_utc_ns = options_.utc_now_ns()}));
  EXPECT_NEAR(counts.overlap.PairS(0, 1), 2, 0.1);
}

TEST_F(EarlierWaves, WhatCannotBeReadIsLeftOut) {
  StartWave({"left", "right"});
  Wave(1, {{"left", SeeWand}, {"right", SeeWand}});
  Finish("wave");
  Continue("wave", "next");
  faulty().Fail("ReadObservations", absl::DataLossError("a damaged page"));
  ReadEarlier();
  EXPECT_EQ(camera("left").shared_instant_count, 0u);
  EXPECT_EQ(state()->session.value->session.id, "next");
}

TEST_F(EarlierWaves, ReadingEndsWithTheServer) {
  StartWave({"left"});
  Wave(1, {{"left", SeeWand}});
  Finish("wave");
  Continue("wave", "next");
  cancelled_ = true;
  EXPECT_THAT(Read(WavesOf("next")), StatusIs(absl::StatusCode::kCancelled, ::testing::_));
}

}  // namespace
}  // namespace rigcal::testing::earlier_waves_test

// SPDX-License-Identifier: Apache-2.0
#include "server/rpc/answer_limits.h"

#include <gtest/gtest.h>

#include <string>

namespace rigcal::server::answer_limits_test {
namespace {

v1::Session SessionOf(int cameras, int epochs, int refusals, size_t example_bytes) {
  v1::Session session;
  for (int c = 0; c < cameras; ++c) {
    v1::SessionCamera& camera = *session.add_cameras();
    camera.mutable_description()->set_camera("camera-" + std::to_string(c));
    camera.set_observation_count(1'000'000);
    for (int i = 0; i < epochs; ++i) {
      camera.add_clock_epochs()->set_clock_epoch(static_cast<uint32_t>(i));
      camera.add_streams()->set_stream_epoch(static_cast<uint32_t>(i + 1));
    }
    for (int i = 0; i < refusals; ++i) {
      v1::RefusalCount& refusal = *camera.add_refused();
      refusal.set_count(static_cast<uint32_t>(i + 1));
      refusal.set_example(std::string(example_bytes, 'x'));
    }
  }
  return session;
}

TEST(FitAnswer, LeavesASessionThatFits) {
  const v1::Session session = SessionOf(256, 3, 10, 100);
  ASSERT_LT(session.ByteSizeLong(), kMaxResourceBytes);
  v1::Session fitted = session;
  FitAnswer(&fitted);
  EXPECT_EQ(fitted.SerializeAsString(), session.SerializeAsString());
}

TEST(FitAnswer, ShortensExamplesFirstAndKeepsTheCounts) {
  v1::Session session = SessionOf(1000, 3, 53, 256);
  ASSERT_GT(session.ByteSizeLong(), kMaxResourceBytes);
  FitAnswer(&session);
  EXPECT_LE(session.ByteSizeLong(), kMaxResourceBytes);
  ASSERT_EQ(session.cameras_size(), 1000);
  EXPECT_EQ(session.cameras(7).clock_epochs_size(), 3);
  ASSERT_EQ(session.cameras(7).refused_size(), 53);
  EXPECT_EQ(session.cameras(7).refused(52).count(), 53u);
}

TEST(FitAnswer, KeepsTheNewestEpochsAndStreams) {
  v1::Session session = SessionOf(20, 100'000, 1, 10);
  FitAnswer(&session);
  EXPECT_LE(session.ByteSizeLong(), kMaxResourceBytes);
  const v1::SessionCamera& camera = session.cameras(3);
  ASSERT_GT(camera.streams_size(), 0);
  EXPECT_EQ(camera.streams(camera.streams_size() - 1).stream_epoch(), 100'000u);
  EXPECT_EQ(camera.observation_count(), 1'000'000u);
}

TEST(FitAnswer, ShortensACalibration) {
  v1::Calibration calibration;
  for (int i = 0; i < 1000; ++i) {
    calibration.add_findings()->set_advice(std::string(2000, 'y'));
    calibration.add_refused()->set_example("\u4e2d" + std::string(2000, 'z'));
  }
  calibration.mutable_quality()->add_reasons("short");
  FitAnswer(&calibration);
  EXPECT_LE(calibration.ByteSizeLong(), kMaxResourceBytes);
  EXPECT_EQ(calibration.findings_size(), 1000);
  EXPECT_EQ(calibration.refused(0).example().substr(0, 3), "\u4e2d");
  EXPECT_EQ(calibration.quality().reasons(0), "short");
}

}  // namespace
}  // namespace rigcal::server::answer_limits_test

// SPDX-License-Identifier: Apache-2.0
#include "agent/capture/simulated/simulated_observation_source.h"

#include <string>
#include <thread>
#include <vector>

#include "common/target/target.h"
#include "tests/testing/status_matchers.h"

namespace rigcal::agent::simulated_observation_source_test {
namespace {

using ::rigcal::testing::IsOk;
using ::rigcal::testing::StatusIs;
using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

SimulatedCameraOptions Options(int camera_index = 1) {
  SimulatedCameraOptions options;
  options.camera = "top";
  options.camera_index = camera_index;
  options.simulation.duration_s = 4;
  options.speed = kMaxSpeed;
  return options;
}

Target Wand() { return *ParseTarget("wand:0,0.2,0.5"); }

struct Capture {
  std::vector<Observation> observations;
  std::vector<ClockSample> samples;
};

Capture RunCapture(SimulatedObservationSource& source) {
  Capture capture;
  EXPECT_THAT(source.Start(Wand()), IsOk());
  while (true) {
    const auto next = source.Next();
    EXPECT_THAT(next, IsOk());
    if (!next.ok() || !next->has_value()) return capture;
    capture.observations.push_back(**next);
    for (const ClockSample& sample : source.TakeClockSamples()) capture.samples.push_back(sample);
  }
}

TEST(SimulatedObservationSource, YieldsTheFramesOfItsCameraOfTheWorld) {
  const SimulatedCameraOptions options = Options(2);
  ASSERT_OK_AND_ASSIGN(auto source, SimulatedObservationSource::Create(options));
  ASSERT_OK_AND_ASSIGN(const auto world, SimulatedWorld::Create(options.simulation, Wand()));
  for (int repetition = 0; repetition < 2; ++repetition) {
    const Capture capture = RunCapture(*source);
    ASSERT_EQ(capture.observations.size(), static_cast<size_t>(world.FrameCount(2)));
    ASSERT_GT(capture.observations.size(), 90u);
    for (size_t i = 0; i < capture.observations.size(); ++i) {
      const Observation expected = world.Observe(2, static_cast<int>(i));
      EXPECT_EQ(capture.observations[i].time_ns, expected.time_ns);
      EXPECT_EQ(capture.observations[i].clock_epoch, 0u);
      ASSERT_EQ(capture.observations[i].markers.size(), 3u);
      EXPECT_EQ(capture.observations[i].markers[1].centre_px, expected.markers[1].centre_px);
    }
    EXPECT_THAT(capture.samples, IsEmpty());
  }
}

TEST(SimulatedObservationSource, IsItsOwnClockOfTheSimulationsTimeBase) {
  ASSERT_OK_AND_ASSIGN(const auto source, SimulatedObservationSource::Create(Options()));
  EXPECT_EQ(source->description().camera, "top");
  EXPECT_EQ(source->description().clock, (Clock{"top", "sim"}));
  EXPECT_TRUE(source->description().intrinsics.has_value());
  EXPECT_EQ(source->description().source, "sim:camera=1");
}

TEST(SimulatedObservationSource, SamplesAClockOfItsOwnOncePerSecond) {
  SimulatedCameraOptions options = Options();
  options.simulation.clock_samples = true;
  options.simulation.rate_hz = 10;
  options.simulation.camera_rate_hz[1] = 40;
  ASSERT_OK_AND_ASSIGN(auto source, SimulatedObservationSource::Create(options));
  EXPECT_EQ(source->description().clock, (Clock{"top", ""}));
  const Capture capture = RunCapture(*source);
  ASSERT_GE(capture.samples.size(), 4u);
  EXPECT_LE(capture.samples.size(), 5u);
  for (size_t i = 1; i < capture.samples.size(); ++i) {
    EXPECT_NEAR(
        static_cast<double>(capture.samples[i].device_ns - capture.samples[i - 1].device_ns), 1e9,
        1e8);
  }
}

TEST(SimulatedObservationSource, StopWakesANextThatWaits) {
  SimulatedCameraOptions options = Options();
  options.speed = 1e-6;
  ASSERT_OK_AND_ASSIGN(auto source, SimulatedObservationSource::Create(options));
  ASSERT_THAT(source->Start(Wand()), IsOk());
  ASSERT_OK_AND_ASSIGN(const auto first, source->Next());
  EXPECT_TRUE(first.has_value());
  std::thread stopper([&] { source->Stop(); });
  ASSERT_OK_AND_ASSIGN(const auto second, source->Next());
  stopper.join();
  EXPECT_FALSE(second.has_value());
}

TEST(SimulatedObservationSource, IsUsedByOneThreadPerCameraOfOneWorld) {
  std::vector<std::thread> cameras;
  for (int camera = 0; camera < 4; ++camera) {
    cameras.emplace_back([camera] {
      auto source = SimulatedObservationSource::Create(Options(camera));
      ASSERT_THAT(source, IsOk());
      EXPECT_GT(RunCapture(**source).observations.size(), 90u);
    });
  }
  for (std::thread& camera : cameras) camera.join();
}

TEST(SimulatedObservationSource, RefusesACameraTheWorldDoesNotHave) {
  EXPECT_THAT(SimulatedObservationSource::Create(Options(6)),
              StatusIs(absl::StatusCode::kInvalidArgument,
                       AllOf(HasSubstr("camera top"), HasSubstr("camera=6"), HasSubstr("0 to 5"))));
  SimulatedCameraOptions options = Options(0);
  options.simulation.noise_px = -1;
  EXPECT_THAT(SimulatedObservationSource::Create(options),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("noise")));
}

}  // namespace
}  // namespace rigcal::agent::simulated_observation_source_test

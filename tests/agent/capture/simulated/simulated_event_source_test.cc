// SPDX-License-Identifier: Apache-2.0
#include "agent/capture/simulated/simulated_event_source.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "agent/capture/event_source_spec.h"
#include "agent/capture/registry/source_registry.h"
#include "agent/event/event_decoder.h"
#include "tests/agent/capture/source_options_of.h"
#include "tests/testing/simulation_text.h"
#include "tests/testing/status_matchers.h"

namespace rigcal::agent::simulated_event_source_test {
namespace {

using ::rigcal::testing::IsOk;
using ::rigcal::testing::ParseSimulationOptions;
using ::rigcal::testing::StatusIs;
using ::testing::HasSubstr;

SimulatedEventSourceOptions Options() {
  SimulatedEventSourceOptions options;
  options.camera = "events";
  options.camera_index = 1;
  options.simulation = *ParseSimulationOptions("cameras=4;duration=1;offset.1=0.5");
  options.speed = kMaxSpeed;
  return options;
}

struct Counter {
  uint64_t events = 0;
  uint32_t first_us = 0, last_us = 0;
  void Event(uint32_t, uint32_t, bool, uint32_t time_us) {
    if (events++ == 0) first_us = time_us;
    last_us = time_us;
  }
  void Vector(uint32_t x, uint32_t y, bool on, uint32_t time_us, uint32_t) {
    Event(x, y, on, time_us);
  }
  void Trigger(const TriggerEvent&) {}
  void TimeStepBack(int64_t) { ADD_FAILURE() << "time stepped back"; }
};

TEST(SimulatedEventSource, StampsWithItsOwnClock) {
  ASSERT_OK_AND_ASSIGN(const auto source, SimulatedEventSource::Create(Options()));
  EXPECT_EQ(source->description().sensor, SensorKind::kEvent);
  ASSERT_OK_AND_ASSIGN(const Target target, ParseTarget("wand:0,0.13,0.39;diameter=0.04;hz=500"));
  ASSERT_THAT(source->Start(target), IsOk());
  const ImageSize size = source->description().image_size_px;
  Evt3Decoder decoder({size.width, size.height});
  Counter counter;
  for (int chunk = 0; chunk < 20; ++chunk) {
    ASSERT_OK_AND_ASSIGN(const std::optional<EventChunk> bytes, source->Next());
    ASSERT_TRUE(bytes);
    decoder.Decode(bytes->bytes, counter);
  }
  EXPECT_EQ(decoder.faults(), EventFaults{});
  EXPECT_GT(counter.events, 100u);
  // 10 s is where the clocks of the world begin; this one shows moments half a second later.
  EXPECT_GE(counter.first_us, 9'500'000u);
  EXPECT_LE(counter.last_us, 9'500'000u + 41'000u);
}

// The sensor is lower than the frame cameras of the world, and sees what they see.
TEST(SimulatedEventSource, SeesTheHeightThatAFrameCameraWouldSee) {
  ASSERT_OK_AND_ASSIGN(const auto source, SimulatedEventSource::Create(Options()));
  EXPECT_EQ(source->description().image_size_px, (ImageSize{1280, 720}));
  ASSERT_OK_AND_ASSIGN(const Target target, ParseTarget("wand:0,0.13,0.39"));
  ASSERT_OK_AND_ASSIGN(const SimulatedWorld world,
                       SimulatedWorld::Create(Options().simulation, target));
  const CameraDescription frame = world.cameras()[1].description;
  const CameraDescription& event = source->description();
  // Edges of the outermost pixels, over the focal length.
  for (const double side : {0.0, 1.0}) {
    const double of_frame = (side * frame.image_size_px.height - 0.5 - frame.intrinsics->cy_px) /
                            frame.intrinsics->fy_px;
    const double of_event = (side * event.image_size_px.height - 0.5 - event.intrinsics->cy_px) /
                            event.intrinsics->fy_px;
    EXPECT_NEAR(of_event, of_frame, 1e-9);
  }
}

TEST(SimulatedEventSource, SensorsOnOneCableShareAClock) {
  ASSERT_OK_AND_ASSIGN(const auto spec,
                       ParseSourceSpec("sim:camera=1;cameras=4;events=1;clock=cable"));
  ASSERT_OK_AND_ASSIGN(const auto source,
                       SimulatedEventSource::Create(OptionsOf<SimulatedEventSourceOptions>(*spec)));
  EXPECT_EQ(source->description().clock.clock_id, "cable");
  ASSERT_OK_AND_ASSIGN(const auto alone, SimulatedEventSource::Create(Options()));
  EXPECT_EQ(alone->description().clock.clock_id, "events");
}

TEST(SimulatedEventSource, IsMadeFromItsNotation) {
  ASSERT_OK_AND_ASSIGN(const auto spec,
                       ParseSourceSpec("sim:camera=1;cameras=4;events=1;output=500;lux=100"));
  EXPECT_EQ(dynamic_cast<const EventSourceSpec&>(*spec).detector.output.rate_hz, 500);
  EXPECT_EQ(OptionsOf<SimulatedEventSourceOptions>(*spec).scene.lux, 100);
  EXPECT_EQ(spec->camera(), "sim_1");
}

TEST(SimulatedEventSource, RefusesACameraTheWorldDoesNotHave) {
  SimulatedEventSourceOptions options = Options();
  options.camera_index = 4;
  EXPECT_THAT(SimulatedEventSource::Create(options),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("cameras 0 to 3")));
}

}  // namespace
}  // namespace rigcal::agent::simulated_event_source_test

// SPDX-License-Identifier: Apache-2.0
#include "agent/capture/metavision/metavision_event_source.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <cstdint>
#include <deque>
#include <future>
#include <string>
#include <vector>

#include "agent/event/evt3_writer.h"
#include "tests/agent/capture/metavision/live_event_camera.h"
#include "tests/testing/fake_metavision/fake_event_camera.h"
#include "tests/testing/status_matchers.h"

namespace rigcal::agent::metavision_event_source_test {
namespace {

using ::rigcal::testing::FakeBus;
using ::rigcal::testing::FakeEventCamera;
using ::rigcal::testing::FakeStream;
using ::rigcal::testing::IsOk;
using ::rigcal::testing::StatusIs;
using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::Field;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

// Words of EVT 3.0 that tell times up to `until_us`.
std::vector<uint8_t> Evt3Words(int64_t from_us, int64_t until_us) {
  Evt3Writer writer;
  std::vector<uint8_t> bytes;
  for (int64_t time_us = from_us; time_us <= until_us; time_us += 1000) {
    writer.WriteTime(time_us, &bytes);
    const std::vector<CdEvent> events = {{.time_us = time_us, .x = 5, .y = 6, .on = true}};
    writer.Write(events, &bytes);
  }
  return bytes;
}

std::vector<uint8_t> Copy(std::span<const uint8_t> bytes) { return {bytes.begin(), bytes.end()}; }

class MetavisionEventSourceTest : public LiveEventCameraTest {};

TEST_F(MetavisionEventSourceTest, TellsTheStreamAsItCame) {
  const std::vector<uint8_t> words = Evt3Words(0, 20'000);
  const std::vector<uint8_t> first(words.begin(), words.begin() + 41);  // within a word
  const std::vector<uint8_t> second(words.begin() + 41, words.begin() + 42);
  const std::vector<uint8_t> third(words.begin() + 42, words.end());
  const auto camera = FakeBus::Get().Plug({.streams = {{.pieces = {first, second, third}}}});
  ASSERT_OK_AND_ASSIGN(const auto source, MetavisionEventSource::Create(Options()));
  ASSERT_THAT(source->Start(target_), IsOk());
  std::vector<uint8_t> told;
  while (told.size() < words.size()) {
    ASSERT_OK_AND_ASSIGN(const auto chunk, source->Next());
    ASSERT_TRUE(chunk);
    EXPECT_EQ(chunk->bytes.size() % 2, 0u);
    EXPECT_EQ(chunk->byte_offset, told.size());
    EXPECT_FALSE(chunk->clock_began_anew);
    told.insert(told.end(), chunk->bytes.begin(), chunk->bytes.end());
  }
  EXPECT_EQ(told, words);
  EXPECT_THAT(source->Refused(), IsEmpty());
}

TEST_F(MetavisionEventSourceTest, CutsLargeBuffers) {
  std::vector<uint8_t> words((size_t{5} << 19) + 6);
  for (size_t i = 0; i < words.size(); ++i) words[i] = static_cast<uint8_t>(i * 7 >> 3);
  FakeBus::Get().Plug({.streams = {{.pieces = {words}}}});
  ASSERT_OK_AND_ASSIGN(const auto source, MetavisionEventSource::Create(Options()));
  ASSERT_THAT(source->Start(target_), IsOk());
  std::vector<uint8_t> told;
  for (const size_t size : {size_t{1} << 20, size_t{1} << 20, (size_t{1} << 19) + 6}) {
    ASSERT_OK_AND_ASSIGN(const auto chunk, source->Next());
    ASSERT_EQ(chunk->bytes.size(), size);
    told.insert(told.end(), chunk->bytes.begin(), chunk->bytes.end());
  }
  EXPECT_EQ(told, words);
}

TEST_F(MetavisionEventSourceTest, StartsAndStopsAgain) {
  const auto camera = FakeBus::Get().Plug(
      {.streams = {{.pieces = {{1, 2}}}, {.pieces = {{3, 4}, {5, 6}}}, {.pieces = {{7, 8}}}}});
  ASSERT_OK_AND_ASSIGN(const auto source, MetavisionEventSource::Create(Options()));
  ASSERT_OK_AND_ASSIGN(const auto before, source->Next());
  EXPECT_FALSE(before);
  EXPECT_EQ(camera->starts, 0);
  for (const int begin : {1, 3}) {
    ASSERT_THAT(source->Start(target_), IsOk());
    ASSERT_OK_AND_ASSIGN(const auto chunk, source->Next());
    ASSERT_TRUE(chunk);
    EXPECT_EQ(chunk->bytes[0], begin);
    EXPECT_EQ(chunk->byte_offset, 0u);
    EXPECT_TRUE(camera->streaming);
    source->Stop();
    for (int i = 0; i < 2; ++i) {
      ASSERT_OK_AND_ASSIGN(const auto none, source->Next());
      EXPECT_FALSE(none);
    }
    EXPECT_FALSE(camera->streaming);
  }
  // Without a stop in between.
  ASSERT_THAT(source->Start(target_), IsOk());
  ASSERT_OK_AND_ASSIGN(const auto chunk, source->Next());
  EXPECT_THAT(Copy(chunk->bytes), ElementsAre(7, 8));
  ASSERT_THAT(source->Start(target_), IsOk());
  EXPECT_EQ(camera->starts, 3);
  EXPECT_EQ(camera->stops, 3);
}

TEST_F(MetavisionEventSourceTest, TheLastPieceStaysUntilTheNextAfterAStop) {
  // 4.x spoils what it showed as soon as its stream is stopped.
  FakeBus::Get().Plug({.streams = {{.pieces = {{1, 2, 3, 4}}}}});
  ASSERT_OK_AND_ASSIGN(const auto source, MetavisionEventSource::Create(Options()));
  ASSERT_THAT(source->Start(target_), IsOk());
  ASSERT_OK_AND_ASSIGN(const auto chunk, source->Next());
  std::async(std::launch::async, [&] { source->Stop(); }).get();
  EXPECT_THAT(Copy(chunk->bytes), ElementsAre(1, 2, 3, 4));
}

TEST_F(MetavisionEventSourceTest, StopEndsTheWaitForEvents) {
  const auto camera = FakeBus::Get().Plug({});
  ASSERT_OK_AND_ASSIGN(const auto source, MetavisionEventSource::Create(Options()));
  for (int round = 0; round < 3; ++round) {
    ASSERT_THAT(source->Start(target_), IsOk());
    const int polls = camera->polls_in_vain;
    auto next = std::async(std::launch::async, [&] { return source->Next(); });
    camera->WaitUntil(&FakeEventCamera::polls_in_vain, polls + 1);
    source->Stop();
    ASSERT_OK_AND_ASSIGN(const auto chunk, next.get());
    EXPECT_FALSE(chunk);
    EXPECT_FALSE(camera->streaming);
  }
}

TEST_F(MetavisionEventSourceTest, StopEndsTheSearchForALostCamera) {
  const auto camera = FakeBus::Get().Plug({.streams = {{.then = FakeStream::Then::kEnd}}});
  MetavisionSourceOptions options = Options();
  options.shortest_pause = std::chrono::hours(1);
  options.longest_pause = std::chrono::hours(1);
  ASSERT_OK_AND_ASSIGN(const auto source, MetavisionEventSource::Create(options));
  ASSERT_THAT(source->Start(target_), IsOk());
  auto next = std::async(std::launch::async, [&] { return source->Next(); });
  camera->WaitUntil(&FakeEventCamera::stops, 1);
  source->Stop();
  ASSERT_OK_AND_ASSIGN(const auto chunk, next.get());
  EXPECT_FALSE(chunk);
}

TEST_F(MetavisionEventSourceTest, FindsALostCameraAgain) {
  for (const auto then : {FakeStream::Then::kEnd, FakeStream::Then::kThrow}) {
    FakeBus::Get().Reset();
    const auto camera = FakeBus::Get().Plug(
        {.streams = {{.pieces = {{1, 2, 3}}, .then = then}, {.pieces = {{4, 5}, {6, 7}}}}});
    FakeBus::Get().Plug({.serial = "another"});
    MetavisionSourceOptions options = WithSettings("[biases]\nbias_fo = 7\n");
    options.serial = "00050423";
    ASSERT_OK_AND_ASSIGN(const auto source, MetavisionEventSource::Create(options));
    ASSERT_THAT(source->Start(target_), IsOk());
    ASSERT_OK_AND_ASSIGN(const auto before, source->Next());
    EXPECT_THAT(Copy(before->bytes), ElementsAre(1, 2));
    camera->options.biases["bias_fo"].value = 0;  // forgotten without power
    FakeBus::Get().absences = 3;
    ASSERT_OK_AND_ASSIGN(const auto after, source->Next());
    ASSERT_TRUE(after);
    // Half a word of before is not joined with what came after.
    EXPECT_THAT(Copy(after->bytes), ElementsAre(4, 5));
    EXPECT_EQ(after->byte_offset, 2u);
    EXPECT_TRUE(after->clock_began_anew);
    ASSERT_OK_AND_ASSIGN(const auto last, source->Next());
    EXPECT_FALSE(last->clock_began_anew);
    EXPECT_EQ(camera->options.biases["bias_fo"].value, 7);
    EXPECT_THAT(FakeBus::Get().opened,
                ElementsAre("00050423", "00050423", "00050423", "00050423", "00050423"));
    EXPECT_THAT(source->Refused(),
                ElementsAre(AllOf(Field(&Refusal::reason, RefusalReason::kCameraLost),
                                  Field(&Refusal::count, 1u))));
    // The next capture begins without it.
    ASSERT_THAT(source->Start(target_), IsOk());
    EXPECT_THAT(source->Refused(), IsEmpty());
  }
}

TEST_F(MetavisionEventSourceTest, TheOnlyCameraIsLookedForByItsName) {
  FakeBus::Get().Plug({.streams = {{.then = FakeStream::Then::kEnd}, {.pieces = {{1, 2}}}}});
  ASSERT_OK_AND_ASSIGN(const auto source, MetavisionEventSource::Create(Options()));
  FakeBus::Get().Plug({.serial = "another"});
  ASSERT_THAT(source->Start(target_), IsOk());
  ASSERT_OK_AND_ASSIGN(const auto chunk, source->Next());
  ASSERT_TRUE(chunk);
  const std::string name = "Prophesee:hal_plugin_prophesee:00050423";
  EXPECT_THAT(FakeBus::Get().opened, ElementsAre(name, name));
}

TEST_F(MetavisionEventSourceTest, AStreamThatCannotBeginIsACameraLost) {
  const auto camera = FakeBus::Get().Plug({.streams = {{.pieces = {{1, 2}}}}});
  ASSERT_OK_AND_ASSIGN(const auto source, MetavisionEventSource::Create(Options()));
  camera->options.throwing = {"I_EventsStream::start"};
  ASSERT_THAT(source->Start(target_), IsOk());
  auto next = std::async(std::launch::async, [&] { return source->Next(); });
  camera->WaitUntil(&FakeEventCamera::starts, 3);
  source->Stop();
  ASSERT_OK_AND_ASSIGN(const auto none, next.get());
  EXPECT_FALSE(none);
  camera->options.throwing.clear();
  ASSERT_THAT(source->Start(target_), IsOk());
  ASSERT_OK_AND_ASSIGN(const auto chunk, source->Next());
  EXPECT_THAT(Copy(chunk->bytes), ElementsAre(1, 2));
}

TEST_F(MetavisionEventSourceTest, ExceptionsOfTheStreamAreACameraLost) {
  for (const std::string function :
       {"I_EventsStream::poll_buffer", "I_EventsStream::get_latest_raw_data"}) {
    for (const bool odd : {false, true}) {
      FakeBus::Get().Reset();
      const auto camera =
          FakeBus::Get().Plug({.streams = std::deque<FakeStream>(100, {.pieces = {{1, 2}}})});
      ASSERT_OK_AND_ASSIGN(auto source, MetavisionEventSource::Create(Options()));
      (odd ? camera->options.throwing_odd : camera->options.throwing) = {function};
      // Found again, and lost again, until it is stopped.
      ASSERT_THAT(source->Start(target_), IsOk());
      auto next = std::async(std::launch::async, [&] { return source->Next(); });
      camera->WaitUntil(&FakeEventCamera::starts, 3);
      source->Stop();
      ASSERT_OK_AND_ASSIGN(const auto none, next.get());
      EXPECT_FALSE(none);
    }
  }
}

TEST_F(MetavisionEventSourceTest, ExceptionsAtTheEndStayInside) {
  const auto camera = FakeBus::Get().Plug({.streams = {{.pieces = {{1, 2}}}}});
  ASSERT_OK_AND_ASSIGN(auto source, MetavisionEventSource::Create(Options()));
  ASSERT_THAT(source->Start(target_), IsOk());
  ASSERT_OK_AND_ASSIGN(const auto chunk, source->Next());
  ASSERT_TRUE(chunk);
  camera->options.throwing_odd = {"I_EventsStream::stop"};
  source.reset();
  EXPECT_EQ(camera->stops, 1);
}

TEST_F(MetavisionEventSourceTest, AnotherSensorDoesNotTakeTheLostOnesPlace) {
  const auto camera = FakeBus::Get().Plug({.streams = {{.then = FakeStream::Then::kEnd}}});
  ASSERT_OK_AND_ASSIGN(auto source, MetavisionEventSource::Create(Options()));
  camera->options.width = 1280;
  ASSERT_THAT(source->Start(target_), IsOk());
  auto next = std::async(std::launch::async, [&] { return source->Next(); });
  camera->WaitUntil(&FakeEventCamera::opens, 4);
  source->Stop();
  ASSERT_OK_AND_ASSIGN(const auto none, next.get());
  EXPECT_FALSE(none);
  EXPECT_EQ(camera->starts, 1);
}

TEST_F(MetavisionEventSourceTest, PausesGrowToTheLongest) {
  MetavisionSourceOptions options;
  std::vector<int64_t> pauses_ms;
  for (auto pause = options.shortest_pause; pauses_ms.size() < 7;
       pause = MetavisionEventSource::NextPause(pause, options)) {
    pauses_ms.push_back(pause.count());
  }
  EXPECT_THAT(pauses_ms, ElementsAre(200, 400, 800, 1600, 3200, 5000, 5000));
}

TEST_F(MetavisionEventSourceTest, APrimaryWaitsForThoseThatFollowIt) {
  const auto camera = FakeBus::Get().Plug({});
  MetavisionSourceOptions options = Options();
  options.sync = EventCameraSync::kPrimary;
  options.primary_delay_s = 60;
  ASSERT_OK_AND_ASSIGN(const auto source, MetavisionEventSource::Create(options));
  ASSERT_THAT(source->Start(target_), IsOk());
  auto next = std::async(std::launch::async, [&] { return source->Next(); });
  source->Stop();
  ASSERT_OK_AND_ASSIGN(const auto none, next.get());
  EXPECT_FALSE(none);
  EXPECT_EQ(camera->starts, 0);
}

TEST_F(MetavisionEventSourceTest, ComparesTheSensorsClockWithTheHosts) {
  FakeBus::Get().Plug({.streams = {{.pieces = {Evt3Words(0, 10'000), Evt3Words(11'000, 30'000)}}}});
  ASSERT_OK_AND_ASSIGN(const auto source, MetavisionEventSource::Create(Options()));
  ASSERT_THAT(source->Start(target_), IsOk());
  ASSERT_OK_AND_ASSIGN(const auto first, source->Next());
  ASSERT_TRUE(first);
  // What is told of the time before the piece leaves before its sample.
  EXPECT_THAT(source->TakeClockSamples(), IsEmpty());
  ASSERT_OK_AND_ASSIGN(const auto second, source->Next());
  ASSERT_TRUE(second);
  EXPECT_THAT(source->TakeClockSamples(),
              ElementsAre(AllOf(Field(&ClockSample::device_ns, 10'000'000),
                                Field(&ClockSample::uncertainty_ns, 5'000'000u))));
  EXPECT_THAT(source->TakeClockSamples(), IsEmpty());
}

TEST_F(MetavisionEventSourceTest, ASecondaryThatWaitsForItsPrimaryHasNoTime) {
  FakeBus::Get().Plug(
      {.streams = {{.pieces = {Evt3Words(0, 0), Evt3Words(0, 0), Evt3Words(0, 5000), {0, 0}}}}});
  MetavisionSourceOptions options = Options();
  options.sync = EventCameraSync::kSecondary;
  options.clock_id = "cable";
  ASSERT_OK_AND_ASSIGN(const auto source, MetavisionEventSource::Create(options));
  ASSERT_THAT(source->Start(target_), IsOk());
  for (int i = 0; i < 3; ++i) {
    ASSERT_OK_AND_ASSIGN(const auto chunk, source->Next());
    ASSERT_TRUE(chunk);
    EXPECT_THAT(source->TakeClockSamples(), IsEmpty());
  }
  ASSERT_OK_AND_ASSIGN(const auto chunk, source->Next());
  ASSERT_TRUE(chunk);
  EXPECT_THAT(source->TakeClockSamples(), ElementsAre(Field(&ClockSample::device_ns, 5'000'000)));
}

TEST_F(MetavisionEventSourceTest, ClockSamplesAreOfTheTimeSinceTheCameraIsBack) {
  FakeBus::Get().Plug(
      {.streams = {{.pieces = {Evt3Words(0, 50'000)}, .then = FakeStream::Then::kEnd},
                   {.pieces = {Evt3Words(0, 7000), {0, 0}}}}});
  ASSERT_OK_AND_ASSIGN(const auto source, MetavisionEventSource::Create(Options()));
  ASSERT_THAT(source->Start(target_), IsOk());
  for (int i = 0; i < 3; ++i) {
    ASSERT_OK_AND_ASSIGN(const auto chunk, source->Next());
    ASSERT_TRUE(chunk);
  }
  EXPECT_THAT(source->TakeClockSamples(), ElementsAre(Field(&ClockSample::device_ns, 7'000'000)));
}

TEST_F(MetavisionEventSourceTest, OptionsThatMakeNoSense) {
  MetavisionSourceOptions options;
  options.primary_delay_s = std::nan("");
  options.latency_s = 11;
  options.trigger_channel = 32;
  options.shortest_pause = std::chrono::milliseconds(0);
  EXPECT_THAT(CreateStatus(options),
              StatusIs(absl::StatusCode::kInvalidArgument,
                       AllOf(HasSubstr("name is empty"), HasSubstr("primary_delay=nan"),
                             HasSubstr("latency=11"), HasSubstr("trigger_channel is 32"),
                             HasSubstr("shortest pause"))));
  EXPECT_THAT(CreateStatus(WithSettings("colour = 1\n")),
              StatusIs(absl::StatusCode::kInvalidArgument,
                       AllOf(HasSubstr("camera left: "), HasSubstr("unknown key \"colour\""))));
}

}  // namespace
}  // namespace rigcal::agent::metavision_event_source_test

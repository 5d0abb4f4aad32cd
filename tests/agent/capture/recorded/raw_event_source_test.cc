// SPDX-License-Identifier: Apache-2.0
#include "agent/capture/recorded/raw_event_source.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstring>
#include <string>
#include <variant>
#include <vector>

#include "agent/capture/registry/source_registry.h"
#include "agent/event/plain_events.h"
#include "tests/agent/capture/source_options_of.h"
#include "tests/testing/blinking_wand.h"
#include "tests/testing/status_matchers.h"
#include "tests/testing/temporary_directory.h"

namespace rigcal::agent::raw_event_source_test {
namespace {

using ::rigcal::testing::IsOk;
using ::rigcal::testing::StatusIs;
using ::testing::AllOf;
using ::testing::HasSubstr;

class RawEventSourceTest : public ::testing::Test {
 protected:
  RawSourceOptions Options(const std::string& text, size_t words = 0) {
    std::vector<uint8_t> bytes(text.begin(), text.end());
    for (size_t i = 0; i < words; ++i) {
      bytes.push_back(static_cast<uint8_t>(i));
      bytes.push_back(static_cast<uint8_t>(i >> 8 & 0x7));
    }
    return OptionsOfBytes(bytes);
  }
  RawSourceOptions OptionsOfBytes(const std::vector<uint8_t>& bytes) {
    RawSourceOptions options;
    options.camera = "left";
    options.path = (directory_.path() / "left.raw").string();
    options.speed = kMaxSpeed;
    testing::WriteBytes(options.path, bytes);
    return options;
  }

  testing::TemporaryDirectory directory_;
};

TEST_F(RawEventSourceTest, HandsOnEveryByteOnce) {
  // More than one block, and an odd byte at the end.
  const std::string header = Evt3Header({640, 480}, "1");
  std::vector<uint8_t> bytes(header.begin(), header.end());
  for (size_t i = 0; i < 2'500'001; ++i) bytes.push_back(static_cast<uint8_t>(i * 7 + i / 255));
  for (const double speed : {kMaxSpeed, 1e6}) {
    RawSourceOptions options = OptionsOfBytes(bytes);
    options.speed = speed;
    ASSERT_OK_AND_ASSIGN(const auto source, RawEventSource::Create(options));
    ASSERT_THAT(source->Start(Target()), IsOk());
    std::vector<uint8_t> read(header.begin(), header.end());
    while (true) {
      ASSERT_OK_AND_ASSIGN(const std::optional<EventChunk> chunk, source->Next());
      if (!chunk) break;
      ASSERT_EQ(chunk->byte_offset, read.size());
      ASSERT_LE(chunk->bytes.size(), size_t{1} << 20);
      read.insert(read.end(), chunk->bytes.begin(), chunk->bytes.end());
      ASSERT_LE(read.size(), bytes.size());
      if (read.size() < bytes.size() - 1) {
        ASSERT_EQ(chunk->bytes.size() % 2, 0u);
      }
    }
    EXPECT_EQ(read, bytes) << speed;
  }
}

TEST_F(RawEventSourceTest, DescribesTheCamera) {
  RawSourceOptions options = Options(Evt3Header({1280, 720}, "1"));
  options.clock_id = "cable";
  ASSERT_OK_AND_ASSIGN(const auto source, RawEventSource::Create(options));
  EXPECT_EQ(source->description().camera, "left");
  EXPECT_EQ(source->description().image_size_px, (ImageSize{1280, 720}));
  EXPECT_EQ(source->description().clock.clock_id, "cable");
  EXPECT_EQ(source->description().sensor, SensorKind::kEvent);
  EXPECT_EQ(source->description().source, "raw:left.raw");
}

TEST_F(RawEventSourceTest, TakesTheGeometryFromWhereItIsSaid) {
  RawSourceOptions options = Options("% evt 3.0\n% end\n");
  EXPECT_THAT(RawEventSource::Create(options),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr(";geometry=WxH")));
  options.geometry = SensorGeometry{320, 240};
  ASSERT_OK_AND_ASSIGN(const auto source, RawEventSource::Create(options));
  EXPECT_EQ(source->description().image_size_px, (ImageSize{320, 240}));
  options.geometry = SensorGeometry{4000, 240};
  EXPECT_THAT(RawEventSource::Create(options),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("4000x240")));
}

TEST_F(RawEventSourceTest, RefusesAContradictionWithBoth) {
  RawSourceOptions options = Options(Evt3Header({640, 480}, "1"));
  options.geometry = SensorGeometry{1280, 720};
  EXPECT_THAT(RawEventSource::Create(options),
              StatusIs(absl::StatusCode::kInvalidArgument,
                       AllOf(HasSubstr("camera left"), HasSubstr("640x480"), HasSubstr("header"),
                             HasSubstr("1280x720"), HasSubstr("geometry="))));
}

TEST_F(RawEventSourceTest, RefusesOtherFiles) {
  RawSourceOptions options = Options("timestamp_ns;x0;y0\n");
  EXPECT_THAT(RawEventSource::Create(options),
              StatusIs(absl::StatusCode::kInvalidArgument,
                       AllOf(HasSubstr("left.raw"), HasSubstr("byte 0"), HasSubstr("EVT3"))));
  options = Options("% evt 4.0\n% end\n");
  EXPECT_THAT(RawEventSource::Create(options),
              StatusIs(absl::StatusCode::kInvalidArgument,
                       AllOf(HasSubstr("4.0"), HasSubstr("EVT2"), HasSubstr("byte"))));
  options = Options("");
  EXPECT_THAT(RawEventSource::Create(options),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("left.raw")));
  options.path = (directory_.path() / "none.raw").string();
  EXPECT_THAT(RawEventSource::Create(options),
              StatusIs(absl::StatusCode::kNotFound, HasSubstr("none.raw")));
  options.path = directory_.path().string();
  EXPECT_THAT(RawEventSource::Create(options),
              StatusIs(absl::StatusCode::kFailedPrecondition, HasSubstr("camera left")));
}

TEST_F(RawEventSourceTest, TellsHowCsvIsToBeRead) {
  const RawSourceOptions file = Options("1000000 5 6 1\n2000000 5 7 0\n");
  const std::string text = "raw:" + file.path + ";calibration=none;speed=max";
  ASSERT_OK_AND_ASSIGN(const auto spec,
                       ParseSourceSpec(text + ";geometry=640x480;time=ns;columns=txyp"));
  const auto& options = OptionsOf<RawSourceOptions>(*spec);
  EXPECT_EQ(options.plain.time_unit, TimeUnit::kNanoseconds);
  ASSERT_OK_AND_ASSIGN(const auto source, RawEventSource::Create(options));
  ASSERT_THAT(source->Start(Target()), IsOk());
  ASSERT_OK_AND_ASSIGN(const std::optional<EventChunk> chunk, source->Next());
  ASSERT_TRUE(chunk);
  EXPECT_EQ(chunk->format, EventFormat::kPlain);
  ASSERT_EQ(chunk->bytes.size(), 2 * sizeof(PlainEvent));
  PlainEvent event;
  std::memcpy(&event, chunk->bytes.data(), sizeof(event));
  EXPECT_EQ(event, (PlainEvent{.time_us = 1000, .x = 5, .y = 6, .kind = PlainEvent::kOn}));
  EXPECT_THAT(source->PlaceOf(sizeof(PlainEvent)), HasSubstr("left.raw, line 2"));

  ASSERT_OK_AND_ASSIGN(const auto no_geometry, ParseSourceSpec(text + ";columns=txyp"));
  EXPECT_THAT(no_geometry->Create(),
              StatusIs(absl::StatusCode::kInvalidArgument,
                       AllOf(HasSubstr("left.raw"), HasSubstr(";geometry=WxH"))));
  EXPECT_THAT(ParseSourceSpec(text + ";time=minutes"),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("auto, s, ms, us or ns")));
  EXPECT_THAT(ParseSourceSpec(text + ";columns=xyp"),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("txyp")));
}

TEST_F(RawEventSourceTest, AHeaderWithoutEventsEnds) {
  ASSERT_OK_AND_ASSIGN(const auto source,
                       RawEventSource::Create(Options(Evt3Header({640, 480}, "1"))));
  ASSERT_THAT(source->Start(Target()), IsOk());
  ASSERT_OK_AND_ASSIGN(const std::optional<EventChunk> chunk, source->Next());
  EXPECT_FALSE(chunk);
}

}  // namespace
}  // namespace rigcal::agent::raw_event_source_test

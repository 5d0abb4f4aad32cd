// SPDX-License-Identifier: Apache-2.0
// Files of events written in another format and read again: nothing may change.
#include "agent/event_files/event_conversion.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <filesystem>
#include <fstream>
#include <functional>
#include <iterator>
#include <random>
#include <sstream>
#include <string>
#include <vector>

#include "absl/strings/str_cat.h"
#include "agent/capture/registry/source_registry.h"
#include "agent/command/subcommands.h"
#include "agent/event/event_decoder.h"
#include "agent/event_files/event_file.h"
#include "agent/event_files/event_file_info.h"
#include "agent/event_files/event_file_writer.h"
#include "tests/testing/blinking_wand.h"
#include "tests/testing/recorded_data.h"
#include "tests/testing/status_matchers.h"
#include "tests/testing/temporary_directory.h"
#include "tests/testing/word_by_word_decoders.h"

namespace rigcal::agent::event_conversion_test {
namespace {

using ::rigcal::testing::IsOk;
using ::rigcal::testing::StatusIs;
using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::Not;
namespace fs = std::filesystem;

template <typename Decoder>
struct CollectingSink {
  const Decoder& decoder;
  std::vector<PlainEvent> events;
  uint64_t epochs = 0;

  void Event(uint32_t x, uint32_t y, bool on, uint32_t time_us) { Vector(x, y, on, time_us, 1); }
  void Vector(uint32_t x, uint32_t y, bool on, uint32_t time_us, uint32_t mask) {
    for (uint32_t k = 0; k < 32; ++k) {
      if ((mask >> k & 1) == 0) continue;
      const int64_t near_us = decoder.time_us();
      events.push_back(
          {.time_us = near_us + static_cast<int32_t>(time_us - static_cast<uint32_t>(near_us)),
           .x = static_cast<uint16_t>(x + k),
           .y = static_cast<uint16_t>(y),
           .kind = on ? PlainEvent::kOn : PlainEvent::kOff});
    }
  }
  void Trigger(const TriggerEvent& trigger) {
    events.push_back(
        {.time_us = trigger.time_us,
         .kind = trigger.rising ? PlainEvent::kTriggerRising : PlainEvent::kTriggerFalling,
         .channel = trigger.channel});
  }
  void TimeStepBack(int64_t) { ++epochs; }
};

struct Content {
  std::vector<PlainEvent> events;
  uint64_t epochs = 0;
  EventFaults faults;
  std::vector<PlainEvent> Kinds(bool triggers) const {
    std::vector<PlainEvent> some;
    std::copy_if(events.begin(), events.end(), std::back_inserter(some),
                 [triggers](const PlainEvent& event) {
                   return (event.kind >= PlainEvent::kTriggerFalling) == triggers;
                 });
    return some;
  }
};

template <typename Decoder>
Content DecodeAll(Decoder decoder, EventFile* file) {
  CollectingSink<Decoder> sink{decoder, {}};
  while (true) {
    const auto bytes = file->Next(1 << 20);
    EXPECT_THAT(bytes, IsOk());
    if (!bytes.ok() || bytes->empty()) break;
    decoder.Decode(*bytes, sink);
  }
  return {std::move(sink.events), sink.epochs, decoder.faults()};
}

Content ReadContent(const std::string& path) {
  auto file = OpenEventFile(path);
  EXPECT_THAT(file, IsOk());
  if (!file.ok()) return {};
  const SensorGeometry geometry{2048, 2048};
  switch ((*file)->header().format) {
    case EventFormat::kEvt2:
      return DecodeAll(Evt2Decoder(geometry), file->get());
    case EventFormat::kEvt21:
      return DecodeAll(Evt21Decoder(geometry, (*file)->header().halves_swapped), file->get());
    case EventFormat::kEvt3:
      return DecodeAll(Evt3Decoder(geometry), file->get());
    case EventFormat::kPlain:
      break;
  }
  return DecodeAll(PlainEventDecoder(geometry), file->get());
}

ConversionOptions Options(const std::string& in, const std::string& out,
                          const std::string& layout = "compound") {
  ConversionOptions options;
  options.in = in;
  options.out = out;
  options.layout = layout;
  return options;
}

class EventConversionTest : public ::testing::Test {
 protected:
  std::string Path(const std::string& name) { return (directory_.path() / name).string(); }
  std::string Convert(const std::string& in, const std::string& name,
                      const std::string& layout = "compound") {
    const auto summary = ConvertEventFile(Options(in, Path(name), layout));
    EXPECT_THAT(summary, IsOk());
    if (summary.ok()) losses_ = summary->losses;
    return Path(name);
  }
  std::string WriteRaw(const std::string& name, const std::vector<PlainEvent>& events,
                       EventFormat format = EventFormat::kEvt3) {
    auto writer = CreateEventFileWriter(
        Path(name), ".raw", {.geometry = SensorGeometry{640, 480}, .fields = {}}, "", format);
    EXPECT_THAT(writer, IsOk());
    EXPECT_THAT((*writer)->Write(events), IsOk());
    EXPECT_THAT((*writer)->Finish(), IsOk());
    losses_ = (*writer)->losses();
    return Path(name);
  }

  testing::TemporaryDirectory directory_;
  WriterLosses losses_;
};

// The words of a RAW file behind its header, by decoders that share nothing with this project's.
testing::WordByWord ReadWordByWord(const std::string& path) {
  std::ifstream stream(path, std::ios::binary);
  const std::string text{std::istreambuf_iterator<char>(stream), std::istreambuf_iterator<char>()};
  const size_t begin = text.find("% end\n") + 6;
  const std::span words(reinterpret_cast<const uint8_t*>(text.data()) + begin, text.size() - begin);
  return text.starts_with("% evt 2.0") ? testing::DecodeEvt2WordByWord(words)
                                       : testing::DecodeEvt3ByThrees(words);
}

void CheckWordByWord(const std::string& path, const std::vector<PlainEvent>& events) {
  const testing::WordByWord read = ReadWordByWord(path);
  EXPECT_EQ(read.fault, "") << path;
  EXPECT_EQ(read.events.size(), events.size()) << path;
  EXPECT_TRUE(read.events == events) << path;
}

// Through every format and back; RAW files are read by other decoders, too. Between datasets
// triggers keep their place among events.
void CheckRoundTrips(const std::string& recording, const std::string& folder) {
  const auto convert = [&folder](const std::string& in, const std::string& name,
                                 const std::string& layout) {
    const std::string out = absl::StrCat(folder, "/", name);
    EXPECT_THAT(ConvertEventFile(Options(in, out, layout)), IsOk());
    return out;
  };
  const Content original = ReadContent(recording);
  ASSERT_FALSE(original.events.empty());
  const std::string h5 = convert(recording, "a.h5", "compound");
  EXPECT_TRUE(ReadContent(h5).events == original.events);
  const std::string raw = convert(h5, "b.raw", "");
  EXPECT_TRUE(ReadContent(raw).events == original.events);
  EXPECT_EQ(ReadContent(raw).faults, original.faults);
  CheckWordByWord(raw, original.events);
  ConversionOptions to_evt2 = Options(h5, absl::StrCat(folder, "/d.raw"));
  to_evt2.raw = EventFormat::kEvt2;
  ASSERT_THAT(ConvertEventFile(to_evt2), IsOk());
  EXPECT_TRUE(ReadContent(to_evt2.out).events == original.events);
  CheckWordByWord(to_evt2.out, original.events);
  const std::string csv = convert(raw, "c.csv", "");
  EXPECT_TRUE(ReadContent(csv).events == original.Kinds(false));
  const std::string columns = convert(csv, "d.hdf5", "events");
  EXPECT_TRUE(ReadContent(columns).events == original.Kinds(false));
  const std::string again = convert(columns, "e.raw", "");
  EXPECT_TRUE(ReadContent(again).events == original.Kinds(false));
  CheckWordByWord(again, original.Kinds(false));
}

TEST_F(EventConversionTest, RealRecordingWithTriggers) {
  RIGCAL_REQUIRE_RECORDED_DATA(data);
  const std::string recording = (data / "events/evt3_640x480_trigger_1khz.raw").string();
  CheckRoundTrips(recording, directory_.path().string());
  for (const char* const name : {"a.h5", "b.raw"}) {
    ASSERT_OK_AND_ASSIGN(const EventFileInfo info, ReadEventFileInfo(Path(name), std::nullopt));
    EXPECT_EQ(info.cd_events, 343474u);
    EXPECT_EQ(info.on_events, 125183u);
    EXPECT_EQ(info.sum_x, 116731888u);
    EXPECT_EQ(info.sum_y, 80879209u);
    EXPECT_EQ(info.first_us, 7139840);
    EXPECT_EQ(info.last_us, 9218023);
    EXPECT_EQ(info.trigger_events, 4157u);
    EXPECT_EQ(info.rising.at(6).shortest_gap_us, 1000);
    EXPECT_EQ(info.rising.at(6).longest_gap_us, 1000);
    EXPECT_EQ(info.header.geometry, (SensorGeometry{640, 480}));
  }
}

// Its clock stands at 15 minutes, of which EVT 3.0 counts 16 s.
TEST_F(EventConversionTest, RealRecordingOfTheThirdGeneration) {
  RIGCAL_REQUIRE_RECORDED_DATA(data);
  const std::string recording = (data / "events/evt2_gen3.raw").string();
  CheckRoundTrips(recording, directory_.path().string());
  for (const char* const name : {"a.h5", "b.raw", "c.csv", "d.hdf5", "e.raw"}) {
    ASSERT_OK_AND_ASSIGN(const EventFileInfo info, ReadEventFileInfo(Path(name), std::nullopt));
    EXPECT_EQ(info.cd_events, 521252u) << name;
    EXPECT_EQ(info.on_events, 185861u) << name;
    EXPECT_EQ(info.sum_x, 128979953u) << name;
    EXPECT_EQ(info.sum_y, 216346680u) << name;
    EXPECT_EQ(info.first_us, 913716224) << name;
    EXPECT_EQ(info.last_us, 913812095) << name;
    EXPECT_EQ(info.faults, EventFaults{}) << name;
  }
}

TEST_F(EventConversionTest, ASimulatedWand) {
  testing::BlinkingWand wand;
  wand.first_s = 100;
  for (int i = 0; i < 10; ++i) {
    wand.triggers.push_back(
        {.time_us = 100'010'000 + 20'000 * i, .channel = 3, .rising = i % 2 == 0});
  }
  testing::WriteBytes(Path("wand.raw"), wand.RawFile());
  CheckRoundTrips(Path("wand.raw"), directory_.path().string());
}

std::vector<Observation> Observe(const std::string& path, const std::string& options) {
  const auto spec = ParseSourceSpec("raw:" + path + ";calibration=none" + options);
  EXPECT_THAT(spec, IsOk());
  auto source = (*spec)->Create();
  EXPECT_THAT(source, IsOk());
  if (!source.ok()) return {};
  EXPECT_THAT((*source)->Start(*ParseTarget("wand:0,0.13,0.39;diameter=0.04;hz=500")), IsOk());
  std::vector<Observation> observations;
  while (true) {
    const auto next = (*source)->Next();
    EXPECT_THAT(next, IsOk());
    if (!next.ok() || !*next) break;
    observations.push_back(**next);
  }
  EXPECT_TRUE((*source)->Refused().empty());
  return observations;
}

bool AreEqual(const std::vector<Observation>& a, const std::vector<Observation>& b) {
  const auto same_marker = [](const MarkerObservation& m, const MarkerObservation& n) {
    return m.visible == n.visible && m.centre_px == n.centre_px &&
           m.covariance_px2 == n.covariance_px2 && m.time_delta_ns == n.time_delta_ns;
  };
  return std::equal(a.begin(), a.end(), b.begin(), b.end(),
                    [&](const Observation& o, const Observation& p) {
                      return o.time_ns == p.time_ns && o.clock_epoch == p.clock_epoch &&
                             std::equal(o.markers.begin(), o.markers.end(), p.markers.begin(),
                                        p.markers.end(), same_marker);
                    });
}

// raw: takes them all, and what it finds is the same to the last bit.
TEST_F(EventConversionTest, TheWandIsFoundInEveryFormat) {
  testing::BlinkingWand wand;
  wand.first_s = 4000;  // EVT 3.0 has counted many times 16 s
  wand.duration_s = 0.15;
  for (int i = 0; i < 6; ++i) {
    const int64_t time_us = 4'000'013'333 + 20'000 * i;
    wand.triggers.push_back({.time_us = time_us, .channel = 0, .rising = true});
    wand.triggers.push_back({.time_us = time_us + 4000, .channel = 0, .rising = false});
  }
  testing::WriteBytes(Path("original.raw"), wand.RawFile());
  Convert(Path("original.raw"), "a.h5");
  Convert(Path("a.h5"), "a.raw");
  Convert(Path("a.h5"), "a.csv");
  Convert(Path("a.h5"), "b.h5", "events");
  for (const std::string options : {";rate=200;speed=max", ";rate=200;speed=1000"}) {
    const auto expected = Observe(Path("a.raw"), options);
    ASSERT_GE(expected.size(), 25u);
    EXPECT_GE(std::count_if(expected.begin(), expected.end(),
                            [](const Observation& o) { return o.VisibleCount() == 3; }),
              20);
    for (const char* const name : {"a.h5", "a.csv", "b.h5"}) {
      EXPECT_TRUE(AreEqual(Observe(Path(name), options), expected)) << name << options;
    }
  }
  const auto at_triggers = Observe(Path("a.raw"), ";trigger=rising;speed=max");
  EXPECT_EQ(at_triggers.size(), 6u);
  EXPECT_TRUE(AreEqual(Observe(Path("a.h5"), ";trigger=rising;speed=max"), at_triggers));
}

// Silence of every length, across and around the overflows of EVT 3.0.
TEST_F(EventConversionTest, GapsOfEveryLengthInRaw) {
  for (int seed = 1; seed <= 30; ++seed) {
    SCOPED_TRACE(seed);
    std::mt19937_64 random(static_cast<uint64_t>(seed));
    std::vector<PlainEvent> events;
    int64_t time_us = std::uniform_int_distribution<int64_t>(0, int64_t{1} << 27)(random);
    for (int i = 0; i < 300; ++i) {
      const int bits = std::uniform_int_distribution<int>(0, 29)(random);
      time_us += std::uniform_int_distribution<int64_t>(0, int64_t{1} << bits)(random);
      events.push_back({.time_us = time_us,
                        .x = static_cast<uint16_t>(random() % 640),
                        .y = static_cast<uint16_t>(random() % 480),
                        .kind = i % 2 == 0 ? PlainEvent::kOn : PlainEvent::kOff});
    }
    const Content read = ReadContent(WriteRaw(absl::StrCat(seed, ".raw"), events));
    EXPECT_TRUE(read.events == events);
    EXPECT_EQ(read.faults, EventFaults{});
    EXPECT_EQ(losses_.moved_events, 0u);
  }
}

// Wherever the clock stood, and wherever it begins anew.
TEST_F(EventConversionTest, ClockEpochsInRaw) {
  for (int seed = 1; seed <= 60; ++seed) {
    SCOPED_TRACE(seed);
    std::mt19937_64 random(static_cast<uint64_t>(seed));
    std::vector<PlainEvent> events;
    int64_t last_us = 0;
    uint64_t steps_back = 0;
    for (int epoch = 0; epoch < 5; ++epoch) {
      const int bits = std::uniform_int_distribution<int>(12, 28)(random);
      int64_t time_us = std::uniform_int_distribution<int64_t>(0, int64_t{1} << bits)(random);
      if (epoch > 0 && time_us < last_us - PlainClock::kJitterUs) ++steps_back;
      if (epoch > 0 && time_us >= last_us - PlainClock::kJitterUs) time_us += 2'000;
      for (int i = 0; i < 3; ++i) {
        events.push_back({.time_us = time_us + 10 * i, .x = 5, .y = 6, .kind = PlainEvent::kOn});
      }
      last_us = time_us + 20;
    }
    const Content read = ReadContent(WriteRaw(absl::StrCat(seed, ".raw"), events));
    EXPECT_TRUE(read.events == events);
    EXPECT_EQ(read.epochs, steps_back);
    EXPECT_EQ(read.faults.unknown_words, 0u);
  }
}

TEST_F(EventConversionTest, SmallDisorderInRawIsTakenOutAndCounted) {
  const std::vector<PlainEvent> events = {{.time_us = 8100, .x = 1},  // 1.98 * 4096
                                          {.time_us = 8200, .x = 2},
                                          {.time_us = 8190, .x = 3},
                                          {.time_us = 8300, .x = 4},
                                          {.time_us = 8250, .x = 5}};
  const Content read = ReadContent(WriteRaw("a.raw", events));
  ASSERT_EQ(read.events.size(), 5u);
  EXPECT_EQ(read.events[2].time_us, 8192);
  EXPECT_EQ(read.events[4].time_us, 8250);
  EXPECT_EQ(losses_.moved_events, 1u);
  EXPECT_EQ(read.epochs, 0u);
}

TEST_F(EventConversionTest, SaysWhatAFormatCannotHold) {
  testing::BlinkingWand wand;
  wand.duration_s = 0.02;
  wand.triggers = {{.time_us = 5000, .channel = 0, .rising = true}};
  testing::WriteBytes(Path("wand.raw"), wand.RawFile());
  Convert(Path("wand.raw"), "a.csv");
  EXPECT_EQ(losses_.triggers, 1u);
  Convert(Path("wand.raw"), "b.h5", "events");
  EXPECT_EQ(losses_.triggers, 1u);
  Convert(Path("wand.raw"), "c.h5");
  EXPECT_EQ(losses_.triggers, 0u);
}

struct Ran {
  absl::Status status;
  std::string text;
};

Ran RunConvert(std::vector<std::string> arguments) {
  std::ostringstream out;
  CLI::App app;
  Subcommands subcommands(out);
  subcommands.AddTo(app);
  std::reverse(arguments.begin(), arguments.end());
  arguments.emplace_back("convert");
  app.parse(arguments);
  const absl::Status status = subcommands.Chosen()();
  return {status, out.str()};
}

TEST_F(EventConversionTest, TheCommandReplacesNothingUnlessForced) {
  testing::WriteBytes(Path("a.csv"), {'1', ',', '2', ',', '1', ',', '9'});
  testing::WriteBytes(Path("b.h5"), {'x'});
  EXPECT_THAT(RunConvert({Path("a.csv"), Path("b.h5")}).status,
              StatusIs(absl::StatusCode::kFailedPrecondition,
                       AllOf(HasSubstr("b.h5"), HasSubstr("--force"))));
  EXPECT_EQ(fs::file_size(Path("b.h5")), 1u);
  const Ran ran = RunConvert({Path("a.csv"), Path("b.h5"), "--force"});
  ASSERT_THAT(ran.status, IsOk());
  EXPECT_THAT(ran.text, HasSubstr("1 events, 0 triggers"));
  EXPECT_EQ(ReadContent(Path("b.h5")).events.size(), 1u);
}

TEST_F(EventConversionTest, TheCommandLeavesNothingBehindWhenItFails) {
  const std::string text = "1,2,1,9\n1,2,1,-5000000\n1,2,1,-5000001\n";
  testing::WriteBytes(Path("a.csv"), {text.begin(), text.end()});
  struct Case {
    std::vector<std::string> arguments;
    const char* what;
  };
  for (const Case& c : {Case{{Path("a.csv"), Path("b.raw")}, "--geometry"},
                        Case{{Path("a.csv"), Path("b.raw"), "--geometry", "640x480"}, "negative"},
                        Case{{Path("a.csv"), Path("b.xyz")}, ".h5"},
                        Case{{Path("none.csv"), Path("b.h5")}, "none.csv"},
                        Case{{Path("a.csv"), Path("none/b.csv")}, "none/b.csv"},
                        Case{{Path("a.csv"), Path("none/b.h5")}, "none/b.h5"},
                        Case{{Path("a.csv"), Path("a.csv"), "--force"}, "another"}}) {
    EXPECT_THAT(RunConvert(c.arguments).status, Not(IsOk()));
    EXPECT_THAT(std::string(RunConvert(c.arguments).status.message()), HasSubstr(c.what));
    EXPECT_EQ(std::distance(fs::directory_iterator(directory_.path()), {}), 1);
  }
}

TEST_F(EventConversionTest, TimesThatEvt3CannotTell) {
  const std::string text = "1,2,1,1700000000000000\n";
  testing::WriteBytes(Path("a.csv"), {text.begin(), text.end()});
  ConversionOptions options = Options(Path("a.csv"), Path("b.raw"));
  options.geometry = SensorGeometry{640, 480};
  EXPECT_THAT(ConvertEventFile(options),
              StatusIs(absl::StatusCode::kFailedPrecondition,
                       AllOf(HasSubstr("EVT 3.0"), HasSubstr("HDF5 or CSV"))));
}

}  // namespace
}  // namespace rigcal::agent::event_conversion_test

// SPDX-License-Identifier: Apache-2.0
// A wand that blinks in front of an event camera, from a RAW file through raw: to observations.
#include "agent/capture/event_observation_source.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <spdlog/sinks/ostream_sink.h>
#include <spdlog/spdlog.h>

#include <array>
#include <cmath>
#include <memory>
#include <sstream>
#include <string>
#include <vector>

#include "absl/strings/str_cat.h"
#include "agent/capture/recorded/raw_event_source.h"
#include "agent/capture/registry/source_registry.h"
#include "tests/testing/blinking_wand.h"
#include "tests/testing/recorded_data.h"
#include "tests/testing/status_matchers.h"
#include "tests/testing/temporary_directory.h"

namespace rigcal::agent::event_observation_source_test {
namespace {

using ::rigcal::testing::BlinkingWand;
using ::rigcal::testing::IsOk;
using ::rigcal::testing::StatusIs;
using ::testing::AllOf;
using ::testing::ContainsRegex;
using ::testing::ElementsAre;
using ::testing::Field;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::SizeIs;

class EventObservationSourceTest : public ::testing::Test {
 protected:
  absl::StatusOr<std::unique_ptr<ObservationSource>> Open(const std::vector<uint8_t>& bytes,
                                                          const std::string& options) {
    const std::string path = (directory_.path() / "left.raw").string();
    testing::WriteBytes(path, bytes);
    const auto spec = ParseSourceSpec("raw:" + path + ";calibration=none;speed=max" + options);
    if (!spec.ok()) return spec.status();
    return (*spec)->Create();
  }

  std::vector<Observation> Observe(const std::vector<uint8_t>& bytes, const std::string& options,
                                   std::vector<Refusal>* refused = nullptr) {
    auto source = Open(bytes, options);
    EXPECT_THAT(source, IsOk());
    if (!source.ok()) return {};
    EXPECT_THAT((*source)->Start(*ParseTarget("wand:0,0.13,0.39;diameter=0.04;hz=500")), IsOk());
    std::vector<Observation> observations;
    while (true) {
      auto next = (*source)->Next();
      EXPECT_THAT(next, IsOk());
      if (!next.ok() || !*next) break;
      observations.push_back(**next);
    }
    if (refused != nullptr) *refused = (*source)->Refused();
    return observations;
  }

  testing::TemporaryDirectory directory_;
};

struct Errors {
  int wands = 0;
  double squared_px2 = 0;
  double along_px = 0;  // sum of errors in x, the way the wand moves
  double worst_px = 0;
  double chi_squared = 0;
  double rms_px() const { return std::sqrt(squared_px2 / (6 * wands)); }
};

// Of all markers, against where the wand was at the very time each centre is said to be of.
Errors ErrorsOf(const BlinkingWand& wand, const std::vector<Observation>& observations) {
  Errors errors;
  for (const Observation& observation : observations) {
    if (observation.VisibleCount() < 3) continue;
    ++errors.wands;
    for (int k = 0; k < 3; ++k) {
      const MarkerObservation& marker = observation.markers[static_cast<size_t>(k)];
      const double time_s = static_cast<double>(observation.time_ns + marker.time_delta_ns) * 1e-9;
      const Eigen::Vector2d error = marker.centre_px - wand.CentreAt(k, time_s);
      errors.squared_px2 += error.squaredNorm();
      errors.along_px += error.x();
      errors.worst_px = std::max(errors.worst_px, error.norm());
      errors.chi_squared += error.dot(marker.covariance_px2.ldlt().solve(error));
    }
  }
  return errors;
}

TEST_F(EventObservationSourceTest, FindsTheWandAtAFixedRate) {
  for (const double rate_hz : {50.0, 200.0, 500.0}) {
    const BlinkingWand wand;
    const auto observations =
        Observe(wand.RawFile(), ";rate=" + std::to_string(static_cast<int>(rate_hz)));
    const double expected = wand.duration_s * rate_hz;
    EXPECT_NEAR(static_cast<double>(observations.size()), expected, 2) << rate_hz;
    const Errors errors = ErrorsOf(wand, observations);
    EXPECT_GE(errors.wands, 0.95 * expected - 3) << rate_hz;
    EXPECT_LT(errors.rms_px(), 0.25) << rate_hz;
    EXPECT_LT(errors.worst_px, 1) << rate_hz;
    EXPECT_LT(std::abs(errors.along_px / (3 * errors.wands)), 0.04) << rate_hz;
    // Two coordinates for each marker. A sensor is worse than these discs, so its sigma is larger.
    const double chi = errors.chi_squared / (6 * errors.wands);
    EXPECT_GT(chi, 1.0 / 16) << rate_hz;
    EXPECT_LT(chi, 2) << rate_hz;
    for (size_t i = 1; i < observations.size(); ++i) {
      ASSERT_GT(observations[i].time_ns, observations[i - 1].time_ns);
    }
  }
}

TEST_F(EventObservationSourceTest, AFasterRateThanTheWandBlinksTellsEachBurstOnce) {
  const BlinkingWand wand;
  const auto observations = Observe(wand.RawFile(), ";rate=1000");
  const Errors errors = ErrorsOf(wand, observations);
  EXPECT_NEAR(errors.wands, wand.duration_s * wand.blink_hz, 6);
  EXPECT_LT(errors.rms_px(), 0.25);
  for (size_t i = 1; i < observations.size(); ++i) {
    ASSERT_GT(observations[i].time_ns, observations[i - 1].time_ns);
  }
}

TEST_F(EventObservationSourceTest, AnswersAtTriggersWithTheTimeOfTheLight) {
  BlinkingWand wand;
  for (int i = 0; i < 14; ++i) {
    const int64_t time_us = 13'333 + 20'000 * i;
    wand.triggers.push_back({.time_us = time_us, .channel = 0, .rising = true});
    wand.triggers.push_back({.time_us = time_us + 4000, .channel = 0, .rising = false});
  }
  struct Case {
    std::string option;
    int64_t after_us;
  };
  for (const auto& [option, after_us] :
       {Case{"rising", 0}, Case{"falling", 4000}, Case{"middle", 2000}}) {
    const auto observations = Observe(wand.RawFile(), ";trigger=" + option);
    ASSERT_THAT(observations, SizeIs(14)) << option;
    for (size_t i = 0; i < observations.size(); ++i) {
      EXPECT_EQ(observations[i].time_ns,
                (13'333 + after_us + 20'000 * static_cast<int64_t>(i)) * 1000);
      ASSERT_EQ(observations[i].VisibleCount(), 3) << option << " " << i;
      for (const MarkerObservation& marker : observations[i].markers) {
        EXPECT_LE(std::abs(marker.time_delta_ns), 1'300'000);
      }
    }
    const Errors errors = ErrorsOf(wand, observations);
    EXPECT_LT(errors.rms_px(), 0.25) << option;
    EXPECT_LT(std::abs(errors.along_px / (3 * errors.wands)), 0.06) << option;
  }
  // Of another channel nobody knows.
  EXPECT_THAT(Observe(wand.RawFile(), ";trigger=rising;trigger_channel=1"), IsEmpty());
  // Both: times still grow.
  const auto both = Observe(wand.RawFile(), ";trigger=rising;rate=200");
  EXPECT_GT(both.size(), 60u);
  for (size_t i = 1; i < both.size(); ++i) ASSERT_GT(both[i].time_ns, both[i - 1].time_ns);
}

TEST_F(EventObservationSourceTest, NoiseAloneIsNoWand) {
  BlinkingWand wand;
  wand.visible = false;
  wand.noise_per_s = 3e6;
  const auto observations = Observe(wand.RawFile(), ";rate=200");
  EXPECT_NEAR(static_cast<double>(observations.size()), 60, 2);
  for (const Observation& observation : observations) EXPECT_EQ(observation.VisibleCount(), 0);
}

// What was logged during its life.
class WarningText {
 public:
  WarningText() : old_(spdlog::default_logger()) {
    spdlog::set_default_logger(std::make_shared<spdlog::logger>(
        "test", std::make_shared<spdlog::sinks::ostream_sink_mt>(stream_)));
  }
  ~WarningText() { spdlog::set_default_logger(old_); }
  std::string text() const { return stream_.str(); }

 private:
  std::ostringstream stream_;
  std::shared_ptr<spdlog::logger> old_;
};

TEST_F(EventObservationSourceTest, SaysThatNothingBlinksAsTheTargetSays) {
  BlinkingWand wand;
  wand.duration_s = 2.2;
  for (const double blink_hz : {340.0, 500.0}) {
    wand.blink_hz = blink_hz;
    const WarningText log;
    int wands = 0;
    for (const Observation& observation : Observe(wand.RawFile(), ";rate=500")) {
      wands += observation.VisibleCount() > 0 ? 1 : 0;
    }
    EXPECT_EQ(wands > 0, blink_hz == 500);
    EXPECT_EQ(log.text().find("nothing blinks at the wand's frequency") != std::string::npos,
              blink_hz != 500)
        << log.text();
    EXPECT_EQ(log.text().find("refractory period") != std::string::npos, blink_hz != 500);
  }
}

TEST_F(EventObservationSourceTest, SaysThatPixelsAnswerOneSwitchOfTheLight) {
  BlinkingWand wand;
  wand.duration_s = 1;
  for (const bool falls_only : {false, true}) {
    wand.falls_only = falls_only;
    const WarningText log;
    int wands = 0;
    for (const Observation& observation : Observe(wand.RawFile(), ";rate=200")) {
      wands += observation.VisibleCount() > 0 ? 1 : 0;
    }
    EXPECT_GT(wands, 100);
    const std::string expected = "pixels answer only the fall of the wand's light: it is off for";
    EXPECT_EQ(log.text().find(expected) != std::string::npos, falls_only) << log.text();
  }
}

TEST_F(EventObservationSourceTest, NamesTheBandThatLeavesLampsOut) {
  const auto spec = ParseSourceSpec(
      "sim:camera=1;events=1;duration=0.4;lux=300;bars=0;lamps=2;lamp_hz=480;speed=max");
  ASSERT_THAT(spec, IsOk());
  auto source = (*spec)->Create();
  ASSERT_THAT(source, IsOk());
  const WarningText log;
  ASSERT_THAT((*source)->Start(*ParseTarget("wand:0,0.13,0.39;diameter=0.04;hz=500")), IsOk());
  while (true) {
    const auto next = (*source)->Next();
    ASSERT_THAT(next, IsOk());
    if (!*next) break;
    EXPECT_EQ((*next)->VisibleCount(), 0);
  }
  EXPECT_THAT(log.text(), ContainsRegex("camera sim_1: lights of about 48[0-9] Hz"));
  EXPECT_THAT(log.text(), ContainsRegex("Add band=0.0(18|19|2|20|21|22) "));
  EXPECT_EQ(log.text().find("more than one wand"), std::string::npos) << log.text();
}

// Two cameras of one room, of which one clock is 3.7 ms behind the other.
TEST_F(EventObservationSourceTest, TellsWhenLampsFlicker) {
  std::vector<std::vector<ClockSample>> lamps;
  for (const char* const camera : {"0", "1"}) {
    const auto spec = ParseSourceSpec(absl::StrCat("sim:camera=", camera,
                                                   ";events=1;duration=2.1;cameras=2;lux=300;"
                                                   "lamps=1;offset.1=0.0037;speed=max"));
    ASSERT_THAT(spec, IsOk());
    auto source = (*spec)->Create();
    ASSERT_THAT(source, IsOk());
    ASSERT_THAT((*source)->Start(*ParseTarget("wand:0,0.13,0.39;diameter=0.04;hz=500")), IsOk());
    lamps.emplace_back();
    while (true) {
      const auto next = (*source)->Next();
      ASSERT_THAT(next, IsOk());
      if (!*next) break;
      for (const ClockSample& sample : (*source)->TakeClockSamples()) {
        if (sample.light == kLamps) lamps.back().push_back(sample);
      }
    }
    ASSERT_EQ(lamps.back().size(), 1u);  // the first second has none before it
  }
  const ClockSample &right = lamps[0][0], &behind = lamps[1][0];
  EXPECT_NEAR(static_cast<double>(right.light_ns), 1e7, 5e3);
  EXPECT_GT(right.uncertainty_ns, 0u);
  const double wrong_ns =
      std::remainder(static_cast<double>(behind.device_ns - right.device_ns) + 3.7e6, 1e7 / 3);
  EXPECT_NEAR(wrong_ns, 0, 1e5);
}

TEST_F(EventObservationSourceTest, LongTimesOfTheSensorDoNotMatter) {
  BlinkingWand wand;
  wand.duration_s = 0.2;
  const auto early = ErrorsOf(wand, Observe(wand.RawFile(), ";rate=200"));
  // EVT 3.0 tells 24 bits of time: the overflow is passed on the way.
  wand.first_s = 16.7;
  const auto observations = Observe(wand.RawFile(), ";rate=200");
  const Errors late = ErrorsOf(wand, observations);
  EXPECT_NEAR(late.wands, early.wands, 2);
  EXPECT_LT(late.rms_px(), 0.25);
  EXPECT_GT(observations.back().time_ns, 16'850'000'000);
  for (const Observation& observation : observations) EXPECT_EQ(observation.clock_epoch, 0u);
}

TEST_F(EventObservationSourceTest, AClockThatStepsBackBeginsAnEpoch) {
  BlinkingWand wand;
  wand.duration_s = 0.15;
  wand.first_s = 5;
  std::vector<uint8_t> bytes = wand.RawFile();
  wand.first_s = 1;
  const std::vector<uint8_t> again = wand.RawFile();
  const size_t header_size = Evt3Header(wand.geometry, "1").size();
  bytes.insert(bytes.end(), again.begin() + static_cast<std::ptrdiff_t>(header_size), again.end());
  const auto observations = Observe(bytes, ";rate=200");
  int wands[2] = {0, 0};
  for (const Observation& observation : observations) {
    ASSERT_LE(observation.clock_epoch, 1u);
    if (observation.VisibleCount() == 3) ++wands[observation.clock_epoch];
    EXPECT_EQ(observation.clock_epoch == 0, observation.time_ns > 4'000'000'000);
  }
  EXPECT_GE(wands[0], 24);
  EXPECT_GE(wands[1], 24);
}

// Two streams of one camera that was away in between.
class InterruptedSource : public EventSource {
 public:
  InterruptedSource(CameraDescription description, std::vector<std::vector<uint8_t>> streams)
      : description_(std::move(description)), streams_(std::move(streams)) {}
  const CameraDescription& description() const override { return description_; }
  absl::Status Start(const Target&) override {
    next_ = 0;
    return absl::OkStatus();
  }
  absl::StatusOr<std::optional<EventChunk>> Next() override {
    if (next_ == streams_.size()) return std::nullopt;
    const EventChunk chunk{.bytes = streams_[next_], .clock_began_anew = next_ > 0};
    ++next_;
    return chunk;
  }
  void Stop() override {}

 private:
  const CameraDescription description_;
  const std::vector<std::vector<uint8_t>> streams_;
  size_t next_ = 0;
};

TEST_F(EventObservationSourceTest, ACameraThatWasAwayBeginsAnEpochWhateverItsClockShows) {
  BlinkingWand wand;
  wand.duration_s = 0.15;
  wand.first_s = 1;
  const size_t header_size = Evt3Header(wand.geometry, "1").size();
  const auto words = [&] {
    const std::vector<uint8_t> file = wand.RawFile();
    return std::vector<uint8_t>(file.begin() + static_cast<std::ptrdiff_t>(header_size),
                                file.end());
  };
  constexpr std::array<uint8_t, 2> kUnknownWord = {0x00, 0xb0};
  std::vector<std::vector<uint8_t>> streams = {words()};
  streams[0].insert(streams[0].end(), kUnknownWord.begin(), kUnknownWord.end());
  wand.first_s = 1.4;  // a step forward, as far as times alone tell
  streams.push_back(words());
  streams[1].insert(streams[1].begin(), kUnknownWord.begin(), kUnknownWord.end());
  CameraDescription description;
  description.camera = "left";
  description.image_size_px = {wand.geometry.width, wand.geometry.height};
  description.clock = {.clock_id = "left", .timebase = ""};
  EventObservationSource interrupted(std::make_unique<InterruptedSource>(description, streams), {});
  EventObservationSource* const source = &interrupted;
  for (int round = 0; round < 2; ++round) {
    ASSERT_OK_AND_ASSIGN(const Target target, ParseTarget("wand:0,0.13,0.39;hz=500"));
    ASSERT_THAT(source->Start(target), IsOk());
    int wands[2] = {0, 0};
    int64_t last_ns[2] = {0, 0};
    while (true) {
      ASSERT_OK_AND_ASSIGN(const auto observation, source->Next());
      if (!observation) break;
      const uint32_t epoch = observation->clock_epoch;
      ASSERT_LE(epoch, 1u);
      if (observation->VisibleCount() == 3) ++wands[epoch];
      EXPECT_EQ(epoch == 0, observation->time_ns < 1'300'000'000);
      EXPECT_GT(observation->time_ns, last_ns[epoch]);
      last_ns[epoch] = observation->time_ns;
    }
    EXPECT_GE(wands[0], 24);
    EXPECT_GE(wands[1], 24);
    EXPECT_EQ(source->detection_counts()->Of(DetectionOutcome::kWand),
              static_cast<uint64_t>(wands[0] + wands[1]));
    EXPECT_THAT(source->Refused(),
                ElementsAre(AllOf(Field(&Refusal::reason, RefusalReason::kEventUnknownWord),
                                  Field(&Refusal::count, 2u))));
  }
}

TEST_F(EventObservationSourceTest, StartsAnew) {
  const BlinkingWand wand;
  ASSERT_OK_AND_ASSIGN(auto source, Open(wand.RawFile(), ";rate=100"));
  const Target target = *ParseTarget("wand:0,0.13,0.39;diameter=0.04;hz=500");
  std::vector<int64_t> times[2];
  for (std::vector<int64_t>& run : times) {
    ASSERT_THAT(source->Start(target), IsOk());
    while (true) {
      ASSERT_OK_AND_ASSIGN(const std::optional<Observation> next, source->Next());
      if (!next) break;
      run.push_back(next->time_ns);
    }
  }
  EXPECT_EQ(times[0], times[1]);
  EXPECT_GT(times[0].size(), 20u);
  ASSERT_THAT(source->Start(target), IsOk());
  source->Stop();
  ASSERT_OK_AND_ASSIGN(const std::optional<Observation> stopped, source->Next());
  EXPECT_FALSE(stopped);
}

TEST_F(EventObservationSourceTest, TheRecordedPaceChangesNothing) {
  BlinkingWand wand;
  wand.duration_s = 0.1;
  const auto fast = Observe(wand.RawFile(), ";rate=200");
  const std::string path = (directory_.path() / "left.raw").string();
  ASSERT_OK_AND_ASSIGN(const auto spec,
                       ParseSourceSpec("raw:" + path + ";calibration=none;speed=1000;rate=200"));
  ASSERT_OK_AND_ASSIGN(const auto source, spec->Create());
  ASSERT_THAT(source->Start(*ParseTarget("wand:0,0.13,0.39;diameter=0.04;hz=500")), IsOk());
  size_t count = 0;
  for (;; ++count) {
    ASSERT_OK_AND_ASSIGN(const std::optional<Observation> next, source->Next());
    if (!next) break;
    ASSERT_LT(count, fast.size());
    EXPECT_EQ(next->time_ns, fast[count].time_ns);
    EXPECT_EQ(next->VisibleCount(), fast[count].VisibleCount());
  }
  EXPECT_EQ(count, fast.size());
}

TEST_F(EventObservationSourceTest, KeepsWhatIsGoodInADamagedFile) {
  const BlinkingWand wand;
  std::vector<uint8_t> bytes = wand.RawFile();
  bytes.pop_back();
  const size_t header_size = Evt3Header(wand.geometry, "1").size();
  const size_t middle = header_size + (bytes.size() - header_size) / 4 * 2;
  bytes[middle + 1] = 0x15;  // a type that EVT 3.0 does not have
  std::vector<Refusal> refused;
  const auto observations = Observe(bytes, ";rate=200", &refused);
  EXPECT_GE(ErrorsOf(wand, observations).wands, 52);
  std::vector<RefusalReason> reasons;
  for (const Refusal& refusal : refused) reasons.push_back(refusal.reason);
  ASSERT_THAT(reasons, ::testing::ElementsAre(RefusalReason::kEventUnknownWord,
                                              RefusalReason::kEventTruncatedBytes));
  EXPECT_THAT(refused[1].example, HasSubstr("byte " + std::to_string(bytes.size() - 1)));
  EXPECT_THAT(refused[0].example, HasSubstr("left.raw, byte " + std::to_string(middle)));
}

TEST_F(EventObservationSourceTest, RefusesWhatItCannotDo) {
  const BlinkingWand wand;
  EXPECT_THAT(Open(wand.RawFile(), ";rate=5000"),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("rate=5000")));
  EXPECT_THAT(Open(wand.RawFile(), ";trigger=up"),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("rising, falling or middle")));
  EXPECT_THAT(Open(wand.RawFile(), ";rate=0"),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("neither a rate")));
  EXPECT_THAT(Open(wand.RawFile(), ";geometry=1280x720"),
              StatusIs(absl::StatusCode::kInvalidArgument,
                       ::testing::AllOf(HasSubstr("640x480"), HasSubstr("1280x720"))));
  EXPECT_THAT(Open(wand.RawFile(), ";geometry=huge"),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("WIDTHxHEIGHT")));
  ASSERT_OK_AND_ASSIGN(auto source, Open(wand.RawFile(), ""));
  // Too close together to be told apart.
  EXPECT_THAT(source->Start(*ParseTarget("wand:0,0.13,0.39;hz=400,420,600")),
              StatusIs(absl::StatusCode::kInvalidArgument,
                       ::testing::AllOf(HasSubstr("400"), HasSubstr("420"))));
}

// No wand is in them.
TEST_F(EventObservationSourceTest, RealRecordingsAreAnsweredAtTheirTriggers) {
  RIGCAL_REQUIRE_RECORDED_DATA(data);
  struct Case {
    std::string file, options;
    size_t least, most;
  };
  for (const auto& [file, options, least, most] :
       {Case{"evt3_640x480_trigger_1khz.raw", ";trigger=rising;trigger_channel=6", 2079, 2079},
        Case{"evt3_640x480_trigger_1khz.raw", ";rate=500", 1036, 1040},
        Case{"evt2_gen3.raw", ";rate=500", 46, 49}}) {
    ASSERT_OK_AND_ASSIGN(const auto spec,
                         ParseSourceSpec("left=raw:" + (data / "events" / file).string() +
                                         ";calibration=none;speed=max" + options));
    ASSERT_OK_AND_ASSIGN(const auto source, spec->Create());
    ASSERT_THAT(source->Start(*ParseTarget("wand:0,0.13,0.39;hz=500")), IsOk());
    size_t count = 0;
    int64_t first_ns = 0, last_ns = 0;
    while (true) {
      ASSERT_OK_AND_ASSIGN(const std::optional<Observation> next, source->Next());
      if (!next) break;
      EXPECT_EQ(next->VisibleCount(), 0);
      if (count++ == 0) first_ns = next->time_ns;
      ASSERT_TRUE(count == 1 || next->time_ns > last_ns);
      last_ns = next->time_ns;
    }
    EXPECT_GE(count, least) << file << options;
    EXPECT_LE(count, most) << file << options;
    EXPECT_THAT(source->Refused(), IsEmpty());
    if (count != 2079) continue;
    EXPECT_EQ(first_ns, 7'139'840'000);
    EXPECT_EQ(last_ns, 9'217'840'000);
  }
}

}  // namespace
}  // namespace rigcal::agent::event_observation_source_test

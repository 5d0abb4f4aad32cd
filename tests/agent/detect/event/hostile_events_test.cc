// SPDX-License-Identifier: Apache-2.0
// Streams that only a broken sensor sends: the detector's work and memory stay bounded, its
// detections in order, and it finds the wand again. What is counted here is work, not time.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cstdint>
#include <fstream>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "agent/detect/event/blink_wand_detector.h"
#include "agent/event/evt3_writer.h"
#include "tests/testing/blinking_wand.h"
#include "tests/testing/status_matchers.h"

namespace rigcal::agent::hostile_events_test {
namespace {

constexpr size_t kPieceBytes = 1 << 16;
constexpr SensorGeometry kHd{1280, 720};

CameraDescription Camera(SensorGeometry geometry = kHd) {
  CameraDescription camera;
  camera.camera = "left";
  camera.image_size_px = {geometry.width, geometry.height};
  return camera;
}

BlinkWandDetector Detector(const BlinkWandDetectorOptions& options = {},
                           const std::string& target = "wand:0,0.13,0.39;hz=500") {
  auto detector = BlinkWandDetector::Create(options, *ParseTarget(target), Camera(),
                                            EventFormat::kEvt3, /*halves_swapped=*/false);
  EXPECT_THAT(detector.status(), testing::IsOk());
  return *std::move(detector);
}

void Put(uint32_t word, std::vector<uint8_t>* bytes) {
  bytes->push_back(static_cast<uint8_t>(word));
  bytes->push_back(static_cast<uint8_t>(word >> 8));
}

struct Seen {
  size_t detections = 0, wands = 0, blobs = 0;
  size_t most_at_once = 0;  // detections of one Take
};

// Takes all in pieces and drops the detections as a source's reader does; checks their order.
Seen Feed(std::span<const uint8_t> bytes, BlinkWandDetector* detector) {
  Seen seen;
  std::vector<Detection> found;
  std::optional<Observation> last;
  const auto look = [&] {
    seen.detections += found.size();
    seen.most_at_once = std::max(seen.most_at_once, found.size());
    for (Detection& detection : found) {
      if (detection.outcome == DetectionOutcome::kWand) ++seen.wands;
      seen.blobs = std::max(seen.blobs, static_cast<size_t>(detection.blob_count));
      if (last && last->clock_epoch == detection.observation.clock_epoch) {
        ASSERT_GT(detection.observation.time_ns, last->time_ns);
      }
      last = std::move(detection.observation);
    }
    found.clear();
  };
  for (; !bytes.empty(); bytes = bytes.subspan(std::min(kPieceBytes, bytes.size()))) {
    detector->Take(bytes.first(std::min(kPieceBytes, bytes.size())), &found);
    look();
  }
  detector->Finish(&found);
  look();
  return seen;
}

// Pixels for which `inside(x, y)` is true, all lit for the first half of each period.
template <typename Inside>
std::vector<uint8_t> Flicker(int periods, Inside inside) {
  std::vector<uint8_t> bytes;
  Evt3Writer writer;
  std::vector<CdEvent> events;
  for (int half = 0; half < 2 * periods; ++half) {
    events.clear();
    for (uint16_t y = 0; y < kHd.height; ++y) {
      for (uint16_t x = 0; x < kHd.width; ++x) {
        if (inside(x, y)) events.push_back({10'000 + 1000 * half, x, y, half % 2 == 0});
      }
    }
    writer.Write(events, &bytes);
  }
  return bytes;
}

TEST(HostileEvents, AFlickeringScreenIsNoWand) {
  BlinkWandDetector detector = Detector();
  const Seen seen = Feed(Flicker(20, [](int, int) { return true; }), &detector);
  EXPECT_GE(seen.detections, 6u);
  EXPECT_EQ(seen.wands, 0u);
  EXPECT_EQ(seen.blobs, 1u);
  EXPECT_EQ(detector.counts().by_outcome.Of(DetectionOutcome::kNoBlob), 1u);  // at the beginning
}

// Each is a blob, far more than are considered.
TEST(HostileEvents, AWallOfLampsIsLookedAtInPart) {
  BlinkWandDetector detector = Detector();
  const Seen seen =
      Feed(Flicker(20, [](int x, int y) { return x % 6 < 4 && y % 6 < 4; }), &detector);
  EXPECT_GE(seen.detections, 6u);
  EXPECT_EQ(seen.wands, 0u);
  EXPECT_EQ(seen.blobs, 256u);
}

// Each stripe's box is the whole image.
TEST(HostileEvents, StripesAreLookedAtInPart) {
  BlinkWandDetector detector = Detector();
  const Seen seen = Feed(Flicker(20, [](int x, int y) { return (x + 2 * y) % 16 < 8; }), &detector);
  EXPECT_GE(seen.detections, 6u);
  EXPECT_EQ(seen.wands, 0u);
  EXPECT_GE(seen.blobs, 1u);
  EXPECT_LE(seen.blobs, 4u);  // images' worth of pixels
}

TEST(HostileEvents, AClockThatRunsBackwardsAllTheTime) {
  BlinkWandDetectorOptions options;
  options.output.rate_hz = 1000;
  BlinkWandDetector detector = Detector(options);
  std::vector<uint8_t> bytes;
  Put(0x0000, &bytes);
  constexpr uint32_t kRounds = 100'000;
  for (uint32_t i = 0; i < kRounds; ++i) {
    for (const uint32_t word : {0x87d0, 0x87d0, 0x2801, 0x8000, 0x8000, 0x2801}) Put(word, &bytes);
  }
  const Seen seen = Feed(bytes, &detector);
  EXPECT_EQ(detector.faults().time_steps_back, kRounds);
  EXPECT_LE(seen.most_at_once, 1000 + kPieceBytes / 8);
  EXPECT_EQ(seen.wands, 0u);
}

// A few bytes for each half second: no detections beyond what the bytes allow, and all others are
// counted.
TEST(HostileEvents, AClockThatJumpsAheadDoesNotFillTheMemory) {
  BlinkWandDetectorOptions options;
  options.output.rate_hz = 1000;
  BlinkWandDetector detector = Detector(options);
  std::vector<uint8_t> bytes;
  Put(0x0000, &bytes);
  constexpr uint32_t kJumps = 20'000;
  for (uint32_t i = 0; i < kJumps; ++i) {
    const uint32_t high = (20 + i * 128) & 0xfff;  // 0.52 s; never near zero, where clocks restart
    for (const uint32_t word : {0x8000 | high, 0x8000 | high, 0x2801u}) Put(word, &bytes);
  }
  const Seen seen = Feed(bytes, &detector);
  EXPECT_LE(seen.most_at_once, 1000 + kPieceBytes / 8);
  const uint64_t asked = seen.detections + detector.counts().beyond_data;
  EXPECT_NEAR(static_cast<double>(asked), 524.288 * kJumps, 1000);
}

TEST(HostileEvents, AFaultOfTimeInEverySecondWord) {
  BlinkWandDetector detector = Detector();
  std::vector<uint8_t> bytes;
  Put(0x0000, &bytes);
  for (uint32_t i = 0; i < 200'000; ++i) {
    Put(0x8000 | (i * 1789 & 0xfff), &bytes);
    Put(0x2800 | (i & 0x3ff), &bytes);
  }
  const Seen seen = Feed(bytes, &detector);
  EXPECT_LE(seen.most_at_once, 1000 + kPieceBytes / 8);
  EXPECT_EQ(seen.wands, 0u);
}

TEST(HostileEvents, TriggersAtOneMegahertz) {
  for (const char* target : {"wand:0,0.13,0.39;hz=20", "wand:0,0.13,0.39;hz=5000"}) {
    for (const TriggerInstant instant :
         {TriggerInstant::kRising, TriggerInstant::kFalling, TriggerInstant::kMiddle}) {
      BlinkWandDetectorOptions options;
      options.output = {.rate_hz = 0, .trigger = instant};
      BlinkWandDetector detector = Detector(options, target);
      Evt3Writer writer;
      std::vector<uint8_t> bytes;
      constexpr int64_t kEdges = 400'000;
      for (int64_t i = 0; i < kEdges; ++i) {
        writer.Write(TriggerEvent{.time_us = 10'000 + i, .channel = 1, .rising = i % 2 == 0},
                     &bytes);
      }
      const Seen seen = Feed(bytes, &detector);
      // One in 0.4 ms is detected, the others are counted.
      EXPECT_NEAR(static_cast<double>(seen.detections), kEdges / 400.0, 2) << target;
      EXPECT_EQ(seen.detections + detector.counts().dense_triggers, kEdges / 2u) << target;
    }
  }
}

TEST(HostileEvents, TenThousandTriggersAreEachAnsweredOnce) {
  BlinkWandDetectorOptions options;
  options.output = {.rate_hz = 0, .trigger = TriggerInstant::kRising};
  BlinkWandDetector detector = Detector(options, "wand:0,0.13,0.39;hz=20");
  Evt3Writer writer;
  std::vector<uint8_t> bytes;
  for (int64_t i = 0; i < 10'000; ++i) {
    writer.Write(TriggerEvent{.time_us = 10'000 + 400 * i, .channel = 0, .rising = true}, &bytes);
  }
  EXPECT_EQ(Feed(bytes, &detector).detections, 10'000u);
  EXPECT_EQ(detector.counts().dense_triggers, 0u);
  EXPECT_EQ(detector.counts().out_of_order, 0u);
}

// A wand at the lowest and the highest frequency, found again behind a storm of time faults.
TEST(HostileEvents, FindsTheWandAfterAStorm) {
  for (const double hz : {20.0, 500.0, 5000.0}) {
    rigcal::testing::BlinkingWand wand;
    wand.geometry = kHd;
    wand.blink_hz = hz;
    wand.duration_s = hz < 100 ? 0.8 : 0.1;
    wand.velocity_m_s = 0;
    wand.noise_per_s = hz < 100 ? 20'000 : 100'000;
    std::vector<uint8_t> bytes;
    Put(0x0000, &bytes);
    for (uint32_t i = 0; i < 3000; ++i) {
      Put(0x8000 | (i * 1789 & 0xfff), &bytes);
      Put(0x2800 | (i & 0x3ff), &bytes);
    }
    const std::vector<uint8_t> file = wand.RawFile();
    const auto header_end =
        std::search(file.begin(), file.end(), std::begin("% end\n"), std::end("% end\n") - 1) + 6;
    bytes.insert(bytes.end(), header_end, file.end());
    BlinkWandDetectorOptions options;
    options.output.rate_hz = hz < 100 ? 10 : 200;
    CameraDescription camera = Camera();
    camera.intrinsics = wand.CameraIntrinsics();
    auto detector = BlinkWandDetector::Create(
        options, *ParseTarget("wand:0,0.13,0.39;diameter=0.04;hz=" + std::to_string(hz)), camera,
        EventFormat::kEvt3, false);
    ASSERT_THAT(detector.status(), testing::IsOk());
    // In pieces, as a piece with a storm yields none.
    std::vector<Detection> found;
    for (size_t at = 0; at < bytes.size(); at += 2048) {
      detector->Take(std::span(bytes).subspan(at, std::min<size_t>(2048, bytes.size() - at)),
                     &found);
    }
    detector->Finish(&found);
    const auto wands = std::count_if(found.begin(), found.end(), [](const Detection& detection) {
      return detection.outcome == DetectionOutcome::kWand;
    });
    EXPECT_GE(wands, hz < 100 ? 4 : 15) << hz << " Hz, " << found.size() << " detections";
  }
}

int64_t ResidentBytes() {
  std::ifstream file("/proc/self/statm");
  int64_t total = 0, resident = 0;
  file >> total >> resident;
  return resident * sysconf(_SC_PAGESIZE);
}

// Hot pixels that emit noise all the time, an event each microsecond; endless.
class HotPixels {
 public:
  HotPixels() {
    for (uint32_t& pixel : pixels_) pixel = Random() % (kHd.width * kHd.height);
  }

  void Fill(std::vector<uint8_t>* piece) {
    piece->clear();
    while (piece->size() < kPieceBytes) {
      if (time_us_ % 4096 == 0) Put(0x8000 | (time_us_ >> 12 & 0xfff), piece);
      if (time_us_ % 20'000 == 0) Put(0xa001, piece);  // a trigger
      const uint32_t random = Random(), pixel = pixels_[random % pixels_.size()];
      Put(0x6000 | (time_us_++ & 0xfff), piece);
      Put(pixel / kHd.width, piece);
      Put(0x2000 | (random & 0x800000) >> 12 | pixel % kHd.width, piece);
    }
  }

 private:
  uint32_t Random() { return state_ = (state_ * 1664525 + 1013904223) >> 3 ^ state_ << 9; }

  uint32_t state_ = 1;
  std::array<uint32_t, 200> pixels_;
  int64_t time_us_ = 0;
};

TEST(HostileEvents, AGigabyteOfHotPixelsTakesNoMemory) {
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
  constexpr size_t kBytes = size_t{1} << 26;  // these hold back what is freed
#else
  constexpr size_t kBytes = size_t{1} << 30;
#endif
  BlinkWandDetectorOptions options;
  options.output = {.rate_hz = 1000, .trigger = TriggerInstant::kRising};
  BlinkWandDetector detector = Detector(options);
  HotPixels source;
  std::vector<uint8_t> piece;
  std::vector<Detection> found;
  size_t detections = 0;
  int64_t begin_bytes = 0, most_bytes = 0;
  for (size_t taken = 0; taken < kBytes; taken += piece.size()) {
    source.Fill(&piece);
    detector.Take(piece, &found);
    detections += found.size();
    found.clear();
    if (taken % (64 * kPieceBytes) != 0) continue;
    (taken < kBytes / 16 ? begin_bytes : most_bytes) = std::max(most_bytes, ResidentBytes());
  }
  // Six bytes for each microsecond.
  EXPECT_NEAR(static_cast<double>(detections), static_cast<double>(kBytes) / 6 * 1.05e-3,
              0.01 * static_cast<double>(detections));
  EXPECT_EQ(detector.counts().by_outcome.Of(DetectionOutcome::kWand), 0u);
  EXPECT_EQ(detector.faults(), EventFaults());
#if !defined(__SANITIZE_ADDRESS__) && !defined(__SANITIZE_THREAD__)
  EXPECT_LT(most_bytes - begin_bytes, 1 << 20);
#endif
}

}  // namespace
}  // namespace rigcal::agent::hostile_events_test

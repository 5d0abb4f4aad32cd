// SPDX-License-Identifier: Apache-2.0
#include "agent/detect/light_code/light_code_decoder.h"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <random>
#include <vector>

#include "common/light_code/light_code.h"

namespace rigcal::agent {
namespace {

// A camera that looks at a wand.
struct Scene {
  uint32_t seed = 1;
  uint32_t wand = 3;
  double rate_hz = 50;
  double exposure_s = 0.005;
  double phase_s = 0.007;        // of its frames against the bits
  double on_for_s = 4321;        // the wand, when the camera begins
  double wand_rate = 1;          // of the wand's clock
  int64_t camera_origin_ns = 0;  // of the camera's clock
  double noise = 0.04;           // one sigma of ln(brightness)
  double seen = 0.9;             // share of frames
  std::function<bool(double time_s)> hidden = [](double) { return false; };

  double WandTime(double time_s) const { return on_for_s + wand_rate * time_s; }
  int64_t Stamp(double time_s) const { return camera_origin_ns + std::llround(1e9 * time_s); }
};

// ln(0.6) during a 1, and in between for a frame that sees the end of a bit.
double Level(const Scene& scene, double time_s) {
  constexpr int kParts = 10;
  double light = 0;
  for (int part = 0; part < kParts; ++part) {
    const double at_s = time_s + ((part + 0.5) / kParts - 0.5) * scene.exposure_s;
    light += LightCode::Of(scene.wand).IsDimmed(scene.WandTime(at_s)) ? 0.6 : 1;
  }
  return std::log(light / kParts);
}

std::vector<LightCodeReading> ReadAll(const Scene& scene, double duration_s,
                                      LightCodeDecoder* decoder) {
  std::mt19937 random(scene.seed);
  std::normal_distribution<double> normal;
  std::uniform_real_distribution<double> uniform;
  std::vector<LightCodeReading> readings;
  for (double time_s = scene.phase_s; time_s < duration_s; time_s += 1 / scene.rate_hz) {
    const double level = Level(scene, time_s) + scene.noise * normal(random);
    const bool seen = uniform(random) < scene.seen && !scene.hidden(time_s);
    if (!seen) continue;
    decoder->Add(scene.Stamp(time_s), level);
    for (const LightCodeReading& reading : decoder->Take()) readings.push_back(reading);
  }
  return readings;
}

double ErrorS(const Scene& scene, const LightCodeReading& reading) {
  const double time_s = 1e-9 * static_cast<double>(reading.camera_time_ns - scene.camera_origin_ns);
  return 1e-9 * static_cast<double>(reading.wand_time_ns) - scene.WandTime(time_s);
}

TEST(LightCodeDecoder, ReadsWithinTenSecondsAtEveryRate) {
  for (const double rate_hz : {24.0, 25.0, 29.97, 30.0, 50.0, 59.94, 60.0, 100.0, 120.0, 200.0}) {
    Scene scene{.rate_hz = rate_hz, .camera_origin_ns = int64_t{86'400} * 1'000'000'000};
    LightCodeDecoder decoder;
    const auto readings = ReadAll(scene, 10, &decoder);
    ASSERT_FALSE(readings.empty()) << rate_hz;
    for (const LightCodeReading& reading : readings) {
      EXPECT_EQ(reading.wand, 3u);
      EXPECT_LT(std::abs(ErrorS(scene, reading)), 1 / rate_hz) << rate_hz;
      EXPECT_LT(std::abs(ErrorS(scene, reading)), 4 * reading.sigma_s) << rate_hz;
    }
    EXPECT_EQ(decoder.state(), LightCodeState::kRead);
  }
}

// Random rates, phases, times, noise and hidden spans: read in ten seconds, never wrong.
TEST(LightCodeDecoder, OfAHundredWavesAllAreReadAndNoneIsWrong) {
  int read = 0;
  for (uint32_t seed = 1; seed <= 100; ++seed) {
    std::mt19937 random(1000 + seed);
    std::uniform_real_distribution<double> uniform;
    Scene scene{.seed = seed};
    scene.wand = 1 + static_cast<uint32_t>(8 * uniform(random)) % 8;
    scene.rate_hz = 24 + 96 * uniform(random);
    scene.phase_s = uniform(random) / scene.rate_hz;
    scene.on_for_s = 86'400 * uniform(random);
    scene.wand_rate = 1 + 0.02 * (2 * uniform(random) - 1);
    scene.seen = 0.7 + 0.3 * uniform(random);
    LightCodeDecoder decoder;
    const auto readings = ReadAll(scene, 10, &decoder);
    read += readings.empty() ? 0 : 1;
    for (const LightCodeReading& reading : readings) {
      EXPECT_EQ(reading.wand, scene.wand) << seed;
      EXPECT_LT(std::abs(ErrorS(scene, reading)), 1 / scene.rate_hz) << seed;
      // Half a frame at either end of the six seconds.
      EXPECT_NEAR(reading.wand_rate, scene.wand_rate, 1 / scene.rate_hz / 6) << seed;
    }
  }
  EXPECT_GE(read, 99);
}

TEST(LightCodeDecoder, AHalfSeenCodeWaitsForMore) {
  Scene scene;
  scene.hidden = [](double time_s) { return std::fmod(time_s, 2.0) < 1; };
  LightCodeDecoder decoder;
  EXPECT_TRUE(ReadAll(scene, 6, &decoder).empty());
  const auto readings = ReadAll(scene, 30, &decoder);
  ASSERT_FALSE(readings.empty());
  for (const LightCodeReading& reading : readings) {
    EXPECT_LT(std::abs(ErrorS(scene, reading)), 0.02);
  }
}

TEST(LightCodeDecoder, NeverReadsWhatIsNoCode) {
  std::mt19937 random(5);
  std::normal_distribution<double> normal;
  const std::function<double(double)> lights[] = {
      [&](double) { return normal(random); },                        // noise
      [&](double) { return normal(random) > 0 ? 1.0 : 0.0; },        // two levels of chance
      [](double) { return 0.0; },                                    // steady
      [](double t) { return std::fmod(t, 0.2) < 0.1 ? 1.0 : 0.0; },  // blinks
      [](double t) { return std::fmod(t, 0.7) < 0.1 ? 1.0 : 0.0; },
      [](double t) { return std::sin(2 * t); },
      [](double) { return std::nan(""); }};
  for (const auto& light : lights) {
    LightCodeDecoder decoder;
    for (double time_s = 0; time_s < 60; time_s += 0.02) {
      decoder.Add(std::llround(1e9 * time_s), light(time_s));
    }
    EXPECT_TRUE(decoder.Take().empty());
  }
}

TEST(LightCodeDecoder, SaysThatACameraIsTooSlow) {
  Scene scene{.rate_hz = 15};
  LightCodeDecoder decoder;
  EXPECT_TRUE(ReadAll(scene, 30, &decoder).empty());
  EXPECT_EQ(decoder.state(), LightCodeState::kTooSlow);
  EXPECT_NEAR(decoder.frame_rate_hz(), 15, 1);
}

// A wand without a code: its brightness is noise.
TEST(LightCodeDecoder, SaysNothingOfASlowCameraThatSeesNoCode) {
  for (uint32_t seed = 1; seed <= 50; ++seed) {
    std::mt19937 random(seed);
    std::normal_distribution<double> normal;
    LightCodeDecoder decoder;
    for (int i = 0; i < 300; ++i) {
      decoder.Add(std::llround(1e9 * i / 15), 0.2 * normal(random));
      ASSERT_NE(decoder.state(), LightCodeState::kTooSlow) << seed;
    }
  }
}

TEST(LightCodeDecoder, AWandThatStartsAnewIsReadAnew) {
  Scene scene{.rate_hz = 60};
  LightCodeDecoder decoder;
  EXPECT_FALSE(ReadAll(scene, 10, &decoder).empty());
  Scene again = scene;
  again.on_for_s = 0;
  again.camera_origin_ns = 10'500'000'000;
  const auto readings = ReadAll(again, 30, &decoder);
  ASSERT_FALSE(readings.empty());
  for (const LightCodeReading& reading : readings) {
    // Of a window with both, either.
    EXPECT_LT(
        std::min(std::abs(ErrorS(again, reading)), std::abs(ErrorS(again, reading) - 4321 - 10.5)),
        1 / 60.0);
  }
  EXPECT_LT(std::abs(ErrorS(again, readings.back())), 1 / 60.0);
}

TEST(LightCodeDecoder, AClockThatStepsBackBeginsAnew) {
  Scene scene;
  LightCodeDecoder decoder;
  EXPECT_FALSE(ReadAll(scene, 10, &decoder).empty());
  EXPECT_TRUE(ReadAll(scene, 4, &decoder).empty());
  EXPECT_EQ(decoder.state(), LightCodeState::kNone);
}

}  // namespace
}  // namespace rigcal::agent

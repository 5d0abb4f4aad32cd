// SPDX-License-Identifier: Apache-2.0
// A wand in front of a live event camera, from the notation of its source to observations.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <array>
#include <cstdint>
#include <vector>

#include "agent/capture/registry/source_registry.h"
#include "tests/agent/capture/metavision/live_event_camera.h"
#include "tests/testing/blinking_wand.h"
#include "tests/testing/fake_metavision/fake_event_camera.h"
#include "tests/testing/status_matchers.h"

namespace rigcal::agent::metavision_wand_test {
namespace {

using ::rigcal::testing::BlinkingWand;
using ::rigcal::testing::FakeBus;
using ::rigcal::testing::FakeStream;
using ::rigcal::testing::IsOk;
using ::testing::AllOf;
using ::testing::Ge;
using ::testing::Le;

constexpr int64_t kSecondNs = 1'000'000'000;

class MetavisionWandTest : public LiveEventCameraTest {
 protected:
  // What a camera sends, in pieces that cut words.
  static std::vector<std::vector<uint8_t>> Pieces(const BlinkingWand& wand) {
    const std::vector<uint8_t> file = wand.RawFile();
    std::vector<std::vector<uint8_t>> pieces;
    for (size_t at = Evt3Header(wand.geometry, "1").size(); at < file.size();) {
      const size_t size = std::min<size_t>(4097, file.size() - at);
      const auto begin = file.begin() + static_cast<std::ptrdiff_t>(at);
      pieces.emplace_back(begin, begin + static_cast<std::ptrdiff_t>(size));
      at += size;
    }
    return pieces;
  }
};

TEST_F(MetavisionWandTest, IsFoundBeforeAndAfterTheCameraWasAway) {
  BlinkingWand wand;
  wand.duration_s = 0.2;
  const std::array<int64_t, 2> first_ns = {1 * kSecondNs, 3 * kSecondNs / 2};
  testing::FakeEventCameraOptions camera;
  wand.first_s = 1;
  camera.streams.push_back({.pieces = Pieces(wand), .then = FakeStream::Then::kEnd});
  wand.first_s = 1.5;  // a clock that went on, as far as times alone tell
  camera.streams.push_back({.pieces = Pieces(wand)});
  FakeBus::Get().Plug(camera);
  ASSERT_OK_AND_ASSIGN(const auto spec, ParseSourceSpec("left=metavision:rate=200"));
  ASSERT_OK_AND_ASSIGN(const auto source, spec->Create());
  ASSERT_OK_AND_ASSIGN(const Target target, ParseTarget("wand:0,0.13,0.39;hz=500"));
  ASSERT_THAT(source->Start(target), IsOk());
  std::array<int, 2> wands = {0, 0};
  std::array<int, 2> samples = {0, 0};
  // The last ones of the second stream would be waited for.
  while (wands[1] < 25) {
    ASSERT_OK_AND_ASSIGN(const auto observation, source->Next());
    ASSERT_TRUE(observation);
    const uint32_t epoch = observation->clock_epoch;
    ASSERT_LE(epoch, 1u);
    const auto is_of_this_stream = AllOf(Ge(first_ns[epoch]), Le(first_ns[epoch] + kSecondNs / 4));
    EXPECT_THAT(observation->time_ns, is_of_this_stream);
    if (observation->VisibleCount() == 3) ++wands[epoch];
    // As the uplink sends them: with the epoch of the observation they are taken with.
    for (const ClockSample& sample : source->TakeClockSamples()) {
      EXPECT_THAT(sample.device_ns, is_of_this_stream);
      ++samples[epoch];
    }
  }
  EXPECT_GE(wands[0], 30);
  EXPECT_EQ(samples[0], 1);
  EXPECT_EQ(samples[1], 1);
  source->Stop();
  while (true) {
    ASSERT_OK_AND_ASSIGN(const auto observation, source->Next());
    if (!observation) break;
  }
}

}  // namespace
}  // namespace rigcal::agent::metavision_wand_test

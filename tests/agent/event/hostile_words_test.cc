// SPDX-License-Identifier: Apache-2.0
// Words that no sensor sends, in amounts that no corpus of a fuzz target holds.
#include <gtest/gtest.h>

#include <bit>
#include <cstdint>
#include <span>
#include <vector>

#include "agent/event/event_decoder.h"
#include "agent/event/time_high.h"

namespace rigcal::agent::hostile_words_test {
namespace {

constexpr SensorGeometry kGeometry{640, 480};

template <typename Word>
std::span<const uint8_t> Bytes(const std::vector<Word>& words) {
  return {reinterpret_cast<const uint8_t*>(words.data()), words.size() * sizeof(Word)};
}

struct CountingSink {
  uint64_t events = 0;
  uint64_t outside = 0;

  void Event(uint32_t x, uint32_t y, bool, uint32_t) {
    ++events;
    outside += x >= kGeometry.width || y >= kGeometry.height ? 1 : 0;
  }
  void Vector(uint32_t x, uint32_t y, bool, uint32_t, uint32_t mask) {
    events += static_cast<uint64_t>(std::popcount(mask));
    const uint32_t last = x + 31 - static_cast<uint32_t>(std::countl_zero(mask));
    outside += last >= kGeometry.width || y >= kGeometry.height ? 1 : 0;
  }
  void Trigger(const TriggerEvent&) {}
  void TimeStepBack(int64_t) {}

  void Events(std::span<const PackedEvent> batch) {
    for (const PackedEvent& event : batch) Event(event.x, event.y(), event.on(), 0);
  }
};

// 2^32 columns without a new base: they must not come round to the first one.
TEST(HostileWords, VectorsWithoutEndStayOutside) {
  Evt3Decoder plain(kGeometry), batched(kGeometry);
  CountingSink plain_sink, batched_sink;
  const std::vector<uint16_t> begin = {0x8001, 0x0000, 0x3000};
  plain.Decode(Bytes(begin), plain_sink);
  DecodeInBatches(batched, Bytes(begin), batched_sink);
  const std::vector<uint16_t> vectors(1 << 20, 0x4fff);
  constexpr uint64_t kRounds = (uint64_t{1} << 32) / (12 << 20) + 2;
  for (uint64_t round = 0; round < kRounds; ++round) {
    plain.Decode(Bytes(vectors), plain_sink);
    DecodeInBatches(batched, Bytes(vectors), batched_sink);
  }
  for (const CountingSink& sink : {plain_sink, batched_sink}) {
    EXPECT_EQ(sink.events, 640u);
    EXPECT_EQ(sink.outside, 0u);
  }
  EXPECT_EQ(plain.faults().outside_geometry, (kRounds << 20) * 12 - 640);
  EXPECT_EQ(batched.faults(), plain.faults());
}

TEST(HostileWords, EventsAheadOfTheFirstTimeAreCountedEach) {
  Evt21Decoder decoder(kGeometry, /*halves_swapped=*/false);
  CountingSink sink;
  decoder.Decode(Bytes(std::vector<uint64_t>{0x10000000ffff0001, 0x0000000000000000}), sink);
  EXPECT_EQ(decoder.faults().before_time, 17u);
  EXPECT_EQ(sink.events, 0u);
}

// Gaps across overflow after overflow: nanoseconds must fit 64 bits.
template <typename High>
void JumpAhead(uint32_t mask, uint64_t rounds) {
  High high;
  ASSERT_TRUE(high.Take(0));
  uint32_t value = 0;
  uint64_t steps_back = 0;
  for (uint64_t i = 0; i < rounds; ++i) {
    value = (value + mask / 3) & mask;
    if (!high.Take(value)) {
      steps_back += high.Decide(value, &value) == High::Change::kStepBack ? 1 : 0;
    }
    ASSERT_LT(high.time_us(), int64_t{1} << 53);
    ASSERT_GE(high.time_us(), 0);
  }
  EXPECT_GT(steps_back, 0u);
}

TEST(HostileWords, TimesFitNanoseconds) { JumpAhead<TimeHigh<28, 6>>((1 << 28) - 1, 1'000'000); }

}  // namespace
}  // namespace rigcal::agent::hostile_words_test

// SPDX-License-Identifier: Apache-2.0
#include "agent/event/event_decoder.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <random>
#include <tuple>
#include <vector>

namespace rigcal::agent::event_decoder_test {
namespace {

using ::testing::ElementsAre;
using ::testing::IsEmpty;

using Seen = std::tuple<uint32_t, uint32_t, bool, uint32_t>;  // x, y, on, time

struct Recorder {
  std::vector<Seen> events;
  std::vector<std::tuple<int64_t, int, bool>> triggers;
  std::vector<int64_t> steps_back;

  void Event(uint32_t x, uint32_t y, bool on, uint32_t time_us) {
    events.emplace_back(x, y, on, time_us);
  }
  void Vector(uint32_t x, uint32_t y, bool on, uint32_t time_us, uint32_t mask) {
    ASSERT_NE(mask, 0u);
    for (uint32_t k = 0; k < 32; ++k) {
      if ((mask >> k & 1) != 0) Event(x + k, y, on, time_us);
    }
  }
  void Trigger(const TriggerEvent& t) { triggers.emplace_back(t.time_us, t.channel, t.rising); }
  void TimeStepBack(int64_t time_us) { steps_back.push_back(time_us); }
};

template <typename Word>
std::vector<uint8_t> Bytes(const std::vector<Word>& words) {
  const auto* begin = reinterpret_cast<const uint8_t*>(words.data());
  return {begin, begin + words.size() * sizeof(Word)};
}

constexpr SensorGeometry kGeometry{640, 480};

uint16_t High(uint32_t value) { return static_cast<uint16_t>(0x8000 | value); }
uint16_t Low(uint32_t value) { return static_cast<uint16_t>(0x6000 | value); }
uint16_t AddressY(uint32_t y) { return static_cast<uint16_t>(y); }
uint16_t AddressX(uint32_t x, bool on) {
  return static_cast<uint16_t>(0x2000 | (on ? 0x800 : 0) | x);
}
uint16_t Base(uint32_t x, bool on) { return static_cast<uint16_t>(0x3000 | (on ? 0x800 : 0) | x); }

struct Decoded {
  Recorder seen;
  EventFaults faults;
};

Decoded Decode3(const std::vector<uint16_t>& words) {
  Decoded decoded;
  Evt3Decoder decoder(kGeometry);
  decoder.Decode(Bytes(words), decoded.seen);
  decoded.faults = decoder.faults();
  return decoded;
}

TEST(Evt3Decoder, ReadsEventsVectorsAndTriggers) {
  const Decoded decoded =
      Decode3({High(1), Low(5), AddressY(7), AddressX(3, true), AddressX(4, false), Base(100, true),
               0x4801, 0x5081, 0xA601, 0xA600});
  EXPECT_THAT(decoded.seen.events, ElementsAre(Seen{3, 7, true, 4101}, Seen{4, 7, false, 4101},
                                               Seen{100, 7, true, 4101}, Seen{111, 7, true, 4101},
                                               Seen{112, 7, true, 4101}, Seen{119, 7, true, 4101}));
  EXPECT_THAT(decoded.seen.triggers,
              ElementsAre(std::make_tuple(4101, 6, true), std::make_tuple(4101, 6, false)));
  EXPECT_EQ(decoded.faults, EventFaults{});
}

TEST(Evt3Decoder, TakesOutOverflows) {
  std::vector<uint16_t> words = {AddressY(0)};
  for (uint32_t high = 4090; high < 4106; ++high) {
    words.insert(words.end(), {High(high & 0xfff), Low(0), AddressX(1, true)});
  }
  const Decoded decoded = Decode3(words);
  ASSERT_EQ(decoded.seen.events.size(), 16u);
  for (uint32_t i = 0; i < 16; ++i)
    EXPECT_EQ(std::get<3>(decoded.seen.events[i]), (4090 + i) << 12);
  EXPECT_THAT(decoded.seen.steps_back, IsEmpty());
}

TEST(Evt3Decoder, SkipsADamagedTime) {
  const Decoded decoded = Decode3({AddressY(0), High(100), AddressX(1, true), High(2148),
                                   AddressX(2, true), High(101), AddressX(3, true)});
  EXPECT_THAT(decoded.seen.events,
              ElementsAre(Seen{1, 0, true, 100 << 12}, Seen{2, 0, true, 100 << 12},
                          Seen{3, 0, true, 101 << 12}));
  EXPECT_EQ(decoded.faults.unknown_words, 1u);
  EXPECT_THAT(decoded.seen.steps_back, IsEmpty());
}

TEST(Evt3Decoder, TellsARestartFromAGap) {
  const Decoded restarted =
      Decode3({AddressY(0), High(1200), AddressX(1, true), High(0), High(1), AddressX(2, true)});
  EXPECT_THAT(restarted.seen.steps_back, ElementsAre(0));
  EXPECT_EQ(restarted.faults.time_steps_back, 1u);
  EXPECT_EQ(std::get<3>(restarted.seen.events.back()), 1u << 12);
  const Decoded gap =
      Decode3({AddressY(0), High(1), AddressX(1, true), High(500), High(501), AddressX(2, true)});
  EXPECT_THAT(gap.seen.steps_back, IsEmpty());
  EXPECT_EQ(std::get<3>(gap.seen.events.back()), 501u << 12);
}

TEST(Evt3Decoder, CountsWhatItCannotPlace) {
  const Decoded decoded =
      Decode3({AddressY(3), AddressX(1, true), 0xA601, High(1), AddressX(640, true),
               Base(635, true), 0x4fff, AddressY(480), AddressX(1, true), Base(2040, true),
               AddressY(2), 0x4fff, 0x1000, 0x9000});
  EXPECT_EQ(decoded.faults.before_time, 2u);
  EXPECT_EQ(decoded.faults.outside_geometry, 1u + 7u + 1u + 12u);
  EXPECT_EQ(decoded.faults.unknown_words, 2u);
  EXPECT_EQ(decoded.seen.events.size(), 5u);
  for (const Seen& event : decoded.seen.events) EXPECT_LT(std::get<0>(event), 640u);
}

TEST(Evt3Decoder, CountsHalfAWord) {
  Evt3Decoder decoder(kGeometry);
  Recorder seen;
  decoder.Decode(std::vector<uint8_t>{0x01, 0x80, 0x00}, seen);
  EXPECT_EQ(decoder.faults().truncated_bytes, 1u);
}

TEST(Evt2Decoder, ReadsEventsAndTriggers) {
  Evt2Decoder decoder(kGeometry);
  Recorder seen;
  const std::vector<uint32_t> words = {0x80000002u,
                                       0x10000000u | 9u << 22 | 12u << 11 | 34u,
                                       0x00000000u | 10u << 22 | 639u << 11 | 479u,
                                       0xA0000000u | 11u << 22 | 3u << 8 | 1u,
                                       0x10000000u | 640u << 11,
                                       0x50000000u};
  decoder.Decode(Bytes(words), seen);
  EXPECT_THAT(seen.events, ElementsAre(Seen{12, 34, true, 137}, Seen{639, 479, false, 138}));
  EXPECT_THAT(seen.triggers, ElementsAre(std::make_tuple(139, 3, true)));
  EXPECT_EQ(decoder.faults().outside_geometry, 1u);
  EXPECT_EQ(decoder.faults().unknown_words, 1u);
}

TEST(Evt21Decoder, ReadsBothOrdersOfHalves) {
  const std::vector<uint64_t> words = {
      uint64_t{0x80000002} << 32,
      (uint64_t{1} << 60) | (uint64_t{9} << 54) | (uint64_t{624} << 43) | (uint64_t{34} << 32) |
          0x80008001u,
      (uint64_t{0xA} << 60) | (uint64_t{11} << 54) | (uint64_t{3} << 40) | (uint64_t{1} << 32)};
  std::vector<uint64_t> swapped;
  for (const uint64_t word : words) swapped.push_back(std::rotl(word, 32));
  for (const bool halves_swapped : {false, true}) {
    Evt21Decoder decoder(kGeometry, halves_swapped);
    Recorder seen;
    decoder.Decode(Bytes(halves_swapped ? swapped : words), seen);
    EXPECT_THAT(seen.events, ElementsAre(Seen{624, 34, true, 137}, Seen{639, 34, true, 137}));
    EXPECT_THAT(seen.triggers, ElementsAre(std::make_tuple(139, 3, true)));
    EXPECT_EQ(decoder.faults().outside_geometry, 1u);
  }
}

// Random words never reach a pixel that is not there; AddressSanitizer watches the rest.
template <typename Decoder>
void FeedNoise(Decoder decoder) {
  struct Bounds {
    void Event(uint32_t x, uint32_t y, bool, uint32_t) {
      EXPECT_LT(x, 640u);
      EXPECT_LT(y, 480u);
    }
    void Vector(uint32_t x, uint32_t y, bool, uint32_t, uint32_t mask) {
      EXPECT_NE(mask, 0u);
      EXPECT_LT(x + 31 - static_cast<uint32_t>(std::countl_zero(mask)), 640u);
      EXPECT_LT(y, 480u);
    }
    void Trigger(const TriggerEvent&) {}
    void TimeStepBack(int64_t) {}
  } bounds;
  std::mt19937_64 random(7);
  for (int round = 0; round < 50; ++round) {
    std::vector<uint64_t> words(1000);
    for (uint64_t& word : words) word = random();
    decoder.Decode(Bytes(words), bounds);
  }
}

TEST(EventDecoders, StayInsideTheGeometryOnNoise) {
  FeedNoise(Evt3Decoder(kGeometry));
  FeedNoise(Evt2Decoder(kGeometry));
  FeedNoise(Evt21Decoder(kGeometry, false));
}

}  // namespace
}  // namespace rigcal::agent::event_decoder_test

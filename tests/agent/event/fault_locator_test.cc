// SPDX-License-Identifier: Apache-2.0
#include "agent/event/fault_locator.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <random>
#include <vector>

#include "agent/event/event_decoder.h"
#include "agent/event/plain_events.h"

namespace rigcal::agent::fault_locator_test {
namespace {

using ::testing::Contains;
using ::testing::Pair;

struct NoSink {
  void Event(uint32_t, uint32_t, bool, uint32_t) {}
  void Vector(uint32_t, uint32_t, bool, uint32_t, uint32_t) {}
  void Trigger(const TriggerEvent&) {}
  void TimeStepBack(int64_t) {}
};

template <typename Word>
std::vector<uint8_t> Bytes(const std::vector<Word>& words) {
  const auto* const first = reinterpret_cast<const uint8_t*>(words.data());
  return {first, first + words.size() * sizeof(Word)};
}

template <typename Decoder>
FaultPlaces Find(Decoder decoder, const std::vector<uint8_t>& bytes, size_t chunk) {
  FaultLocator finder;
  NoSink sink;
  for (size_t at = 0; at < bytes.size(); at += chunk) {
    const auto piece = std::span(bytes).subspan(at, std::min(chunk, bytes.size() - at));
    const Decoder before = decoder;
    decoder.Decode(piece, sink);
    finder.Look(before, piece, decoder.faults());
  }
  return finder.places();
}

// High bits of time; row; column.
uint16_t High(uint32_t value) { return static_cast<uint16_t>(0x8000 | value); }
uint16_t Row(uint32_t y) { return static_cast<uint16_t>(y); }
uint16_t Column(uint32_t x) { return static_cast<uint16_t>(0x2000 | x); }

TEST(FaultLocator, NothingWrongHasNoPlace) {
  const auto places =
      Find(Evt3Decoder({640, 480}), Bytes<uint16_t>({High(1), Row(3), Column(5), High(2)}), 1024);
  EXPECT_TRUE(places.empty());
}

TEST(FaultLocator, NamesTheFirstWordOfEachKind) {
  auto bytes = Bytes<uint16_t>({
      Column(5),  // 0: ahead of the first time
      High(100),
      Row(3),       // 2
      Column(700),  // 6: outside
      0x1000,       // 8: no such word
      0x1000,
      Column(800),  // 10
      High(5),
      High(5),  // 14: a step back
      Column(1),
  });
  bytes.push_back(0);  // 20
  for (const size_t chunk : {size_t{1024}, size_t{8}}) {
    const FaultPlaces places = Find(Evt3Decoder({640, 480}), bytes, chunk);
    EXPECT_THAT(places, Contains(Pair("before_time", 0u))) << chunk;
    EXPECT_THAT(places, Contains(Pair("outside_geometry", 6u))) << chunk;
    EXPECT_THAT(places, Contains(Pair("unknown_words", 8u))) << chunk;
    EXPECT_THAT(places, Contains(Pair("time_steps_back", 14u))) << chunk;
    EXPECT_THAT(places, Contains(Pair("truncated_bytes", 20u))) << chunk;
  }
}

// Seen only with the next word of its kind, which is far behind it.
TEST(FaultLocator, NamesADamagedTimeAndNotTheWordThatProvesIt) {
  std::vector<uint16_t> words = {High(100), Row(3)};
  words.push_back(High(3000));  // 4
  for (int i = 0; i < 50; ++i) words.push_back(Column(5));
  words.push_back(High(101));
  const FaultPlaces places = Find(Evt3Decoder({640, 480}), Bytes(words), 1024);
  EXPECT_THAT(places, Contains(Pair("unknown_words", 4u)));
  EXPECT_FALSE(places.contains("time_steps_back"));
}

TEST(FaultLocator, OtherFormats) {
  const uint32_t high2 = 0x8u << 28;
  const FaultPlaces evt2 =
      Find(Evt2Decoder({640, 480}),
           Bytes<uint32_t>({high2 | 500, 700u << 11, 0x5u << 28, high2 | 501}), 1024);
  EXPECT_THAT(evt2, Contains(Pair("outside_geometry", 4u)));
  EXPECT_THAT(evt2, Contains(Pair("unknown_words", 8u)));
  const uint64_t high21 = uint64_t{0x8} << 60;
  std::vector<uint64_t> words = {high21 | uint64_t{500'000} << 32, high21 | uint64_t{9} << 32,
                                 uint64_t{0x1} << 60 | uint64_t{600} << 43 | 1, uint64_t{0x5} << 60,
                                 high21 | uint64_t{500'001} << 32};
  for (const bool swapped : {false, true}) {
    std::vector<uint64_t> stream = words;
    if (swapped) {
      for (uint64_t& word : stream) word = word << 32 | word >> 32;
    }
    const FaultPlaces evt21 = Find(Evt21Decoder({500, 480}, swapped), Bytes(stream), 1024);
    EXPECT_THAT(evt21, Contains(Pair("unknown_words", 8u)));  // the damaged time
    EXPECT_THAT(evt21, Contains(Pair("outside_geometry", 16u)));
    EXPECT_FALSE(evt21.contains("time_steps_back"));
  }
}

TEST(FaultLocator, PlainRecords) {
  std::vector<PlainEvent> events(6);
  for (size_t i = 0; i < events.size(); ++i) events[i].time_us = 5'000'000;
  events[1].time_us = 9;  // damaged
  events[2].x = 640;
  events[3].time_us = events[4].time_us = events[5].time_us = 0;
  const FaultPlaces places = Find(PlainEventDecoder({640, 480}), Bytes(events), 1 << 20);
  EXPECT_THAT(places, Contains(Pair("unknown_words", 1 * sizeof(PlainEvent))));
  EXPECT_THAT(places, Contains(Pair("outside_geometry", 2 * sizeof(PlainEvent))));
  EXPECT_THAT(places, Contains(Pair("time_steps_back", 3 * sizeof(PlainEvent))));
}

// Whatever the words: with the place's word taken out, the faults are fewer, and the words ahead of
// it have none of that kind.
template <typename Decoder, typename Word>
void CheckRandomStreams(Decoder decoder, Word harmless, int seed) {
  SCOPED_TRACE(seed);
  std::mt19937_64 random(static_cast<uint64_t>(seed));
  std::vector<Word> words(400);
  for (Word& word : words) word = static_cast<Word>(random());
  const FaultPlaces places = Find(decoder, Bytes(words), 1 << 20);
  NoSink sink;
  Decoder all = decoder;
  all.Decode(Bytes(words), sink);
  for (const auto& [name, text, count] : kEventFaultKinds) {
    ASSERT_EQ(all.faults().*count != 0, places.contains(name));
    if (!places.contains(name)) continue;
    const size_t index = places.at(name) / sizeof(Word);
    ASSERT_LT(index, words.size());
    if (count == &EventFaults::time_steps_back) continue;  // the next one may step back instead
    if (count == &EventFaults::unknown_words) continue;    // neighbours decide on times
    std::vector<Word> ahead(words.begin(), words.begin() + static_cast<std::ptrdiff_t>(index));
    Decoder head = decoder;
    head.Decode(Bytes(ahead), sink);
    Decoder with = head, without = head;
    with.Decode(Bytes<Word>({words[index]}), sink);
    without.Decode(Bytes<Word>({harmless}), sink);
    EXPECT_GT(with.faults().*count, without.faults().*count);
  }
}

TEST(FaultLocator, RandomWords) {
  for (int seed = 1; seed <= 200; ++seed) {
    CheckRandomStreams<Evt3Decoder, uint16_t>(Evt3Decoder({640, 480}), 0xE000, seed);
    CheckRandomStreams<Evt2Decoder, uint32_t>(Evt2Decoder({640, 480}), 0xE0000000, seed);
    CheckRandomStreams<Evt21Decoder, uint64_t>(Evt21Decoder({640, 480}, false), uint64_t{0xE} << 60,
                                               seed);
  }
}

}  // namespace
}  // namespace rigcal::agent::fault_locator_test

// SPDX-License-Identifier: Apache-2.0
#include "agent/event/evt3_writer.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <bit>
#include <random>
#include <tuple>

#include "agent/event_files/raw_header.h"
#include "tests/testing/status_matchers.h"
#include "tests/testing/word_by_word_decoders.h"

namespace rigcal::agent::evt3_writer_test {
namespace {

struct Collector {
  int64_t base_us = 0;
  std::vector<CdEvent> events;
  std::vector<TriggerEvent> triggers;

  void Event(uint32_t x, uint32_t y, bool on, uint32_t time_us) {
    events.push_back({time_us, static_cast<uint16_t>(x), static_cast<uint16_t>(y), on});
  }
  void Vector(uint32_t x, uint32_t y, bool on, uint32_t time_us, uint32_t mask) {
    for (; mask != 0; mask &= mask - 1) {
      Event(x + static_cast<uint32_t>(std::countr_zero(mask)), y, on, time_us);
    }
  }
  void Trigger(const TriggerEvent& trigger) { triggers.push_back(trigger); }
  void TimeStepBack(int64_t) { ADD_FAILURE() << "time stepped back"; }
};

Collector Decode(const std::vector<uint8_t>& bytes) {
  Evt3Decoder decoder({1280, 720});
  Collector collector;
  decoder.Decode(bytes, collector);
  EXPECT_EQ(decoder.faults(), EventFaults{});
  return collector;
}

TEST(Evt3Writer, ComesBackFromTheDecoder) {
  std::mt19937 random(3);
  for (const double density : {0.01, 0.3, 0.95}) {
    std::vector<CdEvent> events;
    std::bernoulli_distribution fires(density);
    int64_t time_us = 5'000'000;
    for (int row = 0; row < 400; ++row) {
      time_us += static_cast<int64_t>(random() % 3000);
      const auto y = static_cast<uint16_t>(random() % 720);
      const bool on = random() % 2 == 0;
      for (uint16_t x = 0; x < 1280; ++x) {
        if (fires(random)) events.push_back({time_us, x, y, on});
      }
    }
    std::vector<uint8_t> bytes;
    Evt3Writer().Write(events, &bytes);
    EXPECT_EQ(Decode(bytes).events, events) << density;
  }
}

TEST(Evt3Writer, WritesVectorsWhereTheyAreShorter) {
  std::vector<CdEvent> row;
  for (uint16_t x = 100; x < 132; ++x) row.push_back({4096, x, 3, true});
  std::vector<uint8_t> bytes;
  Evt3Writer().Write(row, &bytes);
  EXPECT_EQ(bytes.size(), 2 * (2 + 1 + 4u));  // time, row, base and three vectors
}

TEST(Evt3Writer, IsReadByDecodersThatKnowVectorsByThreesAlone) {
  std::mt19937 random(4);
  std::vector<CdEvent> events;
  for (int row = 0; row < 300; ++row) {
    std::bernoulli_distribution fires(0.01 * (row % 100));
    for (uint16_t x = 0; x < 1280; ++x) {
      if (fires(random)) {
        events.push_back({1000 + 50 * row, x, static_cast<uint16_t>(row), row % 3 == 0});
      }
    }
  }
  std::vector<uint8_t> bytes;
  Evt3Writer().Write(events, &bytes);
  const testing::WordByWord read = testing::DecodeEvt3ByThrees(bytes);
  EXPECT_EQ(read.fault, "");
  std::vector<CdEvent> read_events;
  for (const PlainEvent& event : read.events) {
    read_events.push_back({event.time_us, event.x, event.y, event.kind == PlainEvent::kOn});
  }
  EXPECT_EQ(read_events, events);
}

TEST(Evt3Writer, KeepsTimeOverOverflowsAndSilence) {
  std::vector<uint8_t> bytes;
  Evt3Writer writer;
  std::vector<CdEvent> events;
  for (int64_t time_us = 0; time_us < 40'000'000; time_us += 50'000) {
    events.push_back({time_us, 1, 2, true});
    writer.Write({&events.back(), 1}, &bytes);
    writer.Write(TriggerEvent{time_us + 10, 3, true}, &bytes);
    writer.WriteTime(time_us + 25'000, &bytes);
  }
  const Collector collector = Decode(bytes);
  EXPECT_EQ(collector.events, events);
  ASSERT_EQ(collector.triggers.size(), events.size());
  EXPECT_EQ(collector.triggers.back().time_us, events.back().time_us + 10);
  EXPECT_EQ(collector.triggers.back().channel, 3);
}

TEST(Evt3Header, IsReadBack) {
  const std::string text = Evt3Header({1280, 720}, "sim_4");
  ASSERT_OK_AND_ASSIGN(
      const EventFileHeader header,
      ParseRawHeader({reinterpret_cast<const uint8_t*>(text.data()), text.size()}));
  EXPECT_EQ(header.format, EventFormat::kEvt3);
  EXPECT_EQ(header.geometry, (SensorGeometry{1280, 720}));
  EXPECT_EQ(header.fields.at("serial_number"), "sim_4");
  EXPECT_EQ(header.byte_count, text.size());
}

}  // namespace
}  // namespace rigcal::agent::evt3_writer_test

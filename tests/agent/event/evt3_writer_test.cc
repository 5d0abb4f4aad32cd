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

// A decoder of its own, that knows vectors only as 12, 12 and 8 columns behind their base.
std::vector<CdEvent> DecodeByThrees(const std::vector<uint8_t>& bytes) {
  std::vector<CdEvent> events;
  uint32_t low = 0, high = 0, y = 0, base = 0;
  bool on = false;
  const auto word = [&bytes](size_t i) {
    return static_cast<uint32_t>(bytes[2 * i] | bytes[2 * i + 1] << 8);
  };
  const auto add = [&](uint32_t x) {
    events.push_back({static_cast<int64_t>(high << 12 | low), static_cast<uint16_t>(x),
                      static_cast<uint16_t>(y), on});
  };
  for (size_t i = 0; i < bytes.size() / 2; ++i) {
    const uint32_t value = word(i) & 0xfff;
    switch (word(i) >> 12) {
      case 0x0:
        y = value & 0x7ff;
        break;
      case 0x2:
        on = (value & 0x800) != 0;
        add(value & 0x7ff);
        break;
      case 0x3:
        on = (value & 0x800) != 0;
        base = value & 0x7ff;
        break;
      case 0x4: {
        EXPECT_EQ(word(i + 1) >> 12, 0x4u);
        EXPECT_EQ(word(i + 2) >> 12, 0x5u);
        const uint32_t mask = value | (word(i + 1) & 0xfff) << 12 | (word(i + 2) & 0xff) << 24;
        for (uint32_t k = 0; k < 32; ++k) {
          if ((mask >> k & 1) != 0) add(base + k);
        }
        base += 32;
        i += 2;
        break;
      }
      case 0x6:
        low = value;
        break;
      case 0x8:
        high = value;
        break;
      default:
        ADD_FAILURE() << "word " << word(i);
    }
  }
  return events;
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
  EXPECT_EQ(DecodeByThrees(bytes), events);
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

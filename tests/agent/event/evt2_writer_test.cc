// SPDX-License-Identifier: Apache-2.0
#include "agent/event/evt2_writer.h"

#include <gtest/gtest.h>

#include <bit>
#include <random>

#include "agent/event/event_decoder.h"
#include "agent/event_files/raw_header.h"
#include "tests/testing/status_matchers.h"

namespace rigcal::agent::evt2_writer_test {
namespace {

struct Collector {
  std::vector<CdEvent> events;
  std::vector<TriggerEvent> triggers;

  void Event(uint32_t x, uint32_t y, bool on, uint32_t time_us) {
    events.push_back({time_us, static_cast<uint16_t>(x), static_cast<uint16_t>(y), on});
  }
  void Vector(uint32_t x, uint32_t y, bool on, uint32_t time_us, uint32_t mask) {
    EXPECT_EQ(mask, 1u);
    Event(x, y, on, time_us);
  }
  void Trigger(const TriggerEvent& trigger) { triggers.push_back(trigger); }
  void TimeStepBack(int64_t) { ADD_FAILURE() << "time stepped back"; }
};

TEST(Evt2Writer, ComesBackFromTheDecoder) {
  std::mt19937 random(5);
  std::vector<CdEvent> events;
  std::vector<uint8_t> bytes;
  Evt2Writer writer;
  int64_t time_us = 3'000'000'000;
  // Steps within a word's time, of some milliseconds, and silence of up to twenty seconds.
  for (const int64_t longest_us : {20, 5'000, 20'000'000}) {
    for (int i = 0; i < 500 && time_us < 4'000'000'000; ++i) {
      time_us += static_cast<int64_t>(random()) % (longest_us + 1);
      events.push_back({time_us, static_cast<uint16_t>(random() % 1280),
                        static_cast<uint16_t>(random() % 720), random() % 2 == 0});
      writer.Write({&events.back(), 1}, &bytes);
      if (i % 10 == 0) writer.Write(TriggerEvent{time_us, 31, i % 20 == 0}, &bytes);
    }
  }
  Evt2Decoder decoder({1280, 720});
  Collector collector;
  decoder.Decode(bytes, collector);
  EXPECT_EQ(decoder.faults(), EventFaults{});
  EXPECT_EQ(collector.events, events);
  ASSERT_GT(collector.triggers.size(), 50u);
  EXPECT_EQ(collector.triggers.front().channel, 31);
  EXPECT_TRUE(collector.triggers.front().rising);
  EXPECT_FALSE(collector.triggers[1].rising);
}

// After the format's documentation: type, six bits of time, 11 of column, 11 of row.
TEST(Evt2Writer, WritesTheDocumentedBits) {
  std::vector<uint8_t> bytes;
  const CdEvent event = {64 * 5 + 3, 0x123, 0x45, true};
  Evt2Writer().Write({&event, 1}, &bytes);
  ASSERT_EQ(bytes.size(), 12u);  // two words of time and the event
  EXPECT_EQ(LoadWord<uint32_t>(bytes.data()), 0x80000005u);
  EXPECT_EQ(LoadWord<uint32_t>(bytes.data() + 8), 1u << 28 | 3u << 22 | 0x123u << 11 | 0x45u);
}

TEST(Evt2Header, IsReadBack) {
  const std::string text = Evt2Header({640, 480}, "sim_4");
  ASSERT_OK_AND_ASSIGN(
      const EventFileHeader header,
      ParseRawHeader({reinterpret_cast<const uint8_t*>(text.data()), text.size()}));
  EXPECT_EQ(header.format, EventFormat::kEvt2);
  EXPECT_EQ(header.geometry, (SensorGeometry{640, 480}));
  EXPECT_EQ(header.byte_count, text.size());
}

}  // namespace
}  // namespace rigcal::agent::evt2_writer_test

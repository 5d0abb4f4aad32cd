// SPDX-License-Identifier: Apache-2.0
// The real recordings, decoded: every count and sum as their description states.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <bit>
#include <fstream>
#include <iterator>
#include <vector>

#include "agent/event/event_decoder.h"
#include "agent/event_files/raw_header.h"
#include "tests/testing/recorded_data.h"
#include "tests/testing/status_matchers.h"

namespace rigcal::agent::recorded_events_test {
namespace {

struct Sums {
  uint64_t events = 0, on = 0, x = 0, y = 0;
  uint32_t first_us = 0, last_us = 0;
  std::vector<TriggerEvent> triggers;
  int steps_back = 0;

  void Event(uint32_t column, uint32_t row, bool is_on, uint32_t time_us) {
    Vector(column, row, is_on, time_us, 1);
  }
  void Vector(uint32_t column, uint32_t row, bool is_on, uint32_t time_us, uint32_t mask) {
    for (; mask != 0; mask &= mask - 1) {
      if (events++ == 0) first_us = time_us;
      on += is_on ? 1 : 0;
      x += column + static_cast<uint32_t>(std::countr_zero(mask));
      y += row;
    }
    last_us = time_us;
  }
  void Events(std::span<const PackedEvent> batch) {
    for (const PackedEvent& event : batch) Event(event.x, event.y(), event.on(), event.time_us);
  }
  void Trigger(const TriggerEvent& trigger) { triggers.push_back(trigger); }
  void TimeStepBack(int64_t) { ++steps_back; }
};

std::vector<uint8_t> ReadFile(const std::filesystem::path& path) {
  std::ifstream file(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(file), {}};
}

// In pieces of `piece` bytes, a multiple of every word.
template <typename Decoder>
Sums DecodeInPieces(Decoder* decoder, std::span<const uint8_t> bytes, size_t piece) {
  Sums sums;
  for (size_t at = 0; at < bytes.size(); at += piece) {
    decoder->Decode(bytes.subspan(at, std::min(piece, bytes.size() - at)), sums);
  }
  return sums;
}

template <typename Decoder>
Sums DecodeInBatchesOfPieces(Decoder* decoder, std::span<const uint8_t> bytes, size_t piece) {
  Sums sums;
  for (size_t at = 0; at < bytes.size(); at += piece) {
    DecodeInBatches(*decoder, bytes.subspan(at, std::min(piece, bytes.size() - at)), sums);
  }
  return sums;
}

void ExpectKnown(const Sums& sums, const EventFaults& faults) {
  EXPECT_EQ(sums.events, 343474u);
  EXPECT_EQ(sums.x, 116731888u);
  EXPECT_EQ(sums.y, 80879209u);
  EXPECT_EQ(sums.on, 125183u);
  EXPECT_EQ(sums.last_us, 9218023u);
  ASSERT_EQ(sums.triggers.size(), 4157u);
  EXPECT_EQ(sums.triggers.front().time_us, 7139840);
  int64_t last_rising_us = 0;
  for (const TriggerEvent& trigger : sums.triggers) {
    EXPECT_EQ(trigger.channel, 6);
    if (!trigger.rising) continue;
    if (last_rising_us != 0) {
      EXPECT_EQ(trigger.time_us - last_rising_us, 1000);
    }
    last_rising_us = trigger.time_us;
  }
  EXPECT_EQ(faults, EventFaults{});
}

TEST(RecordedEvents, Evt3WithTriggers) {
  RIGCAL_REQUIRE_RECORDED_DATA(data);
  const std::vector<uint8_t> file = ReadFile(data / "events/evt3_640x480_trigger_1khz.raw");
  ASSERT_OK_AND_ASSIGN(const EventFileHeader header, ParseRawHeader(file));
  EXPECT_EQ(header.format, EventFormat::kEvt3);
  ASSERT_TRUE(header.geometry);
  EXPECT_EQ(*header.geometry, (SensorGeometry{640, 480}));
  for (const size_t piece : {file.size(), size_t{40000}, size_t{8}}) {
    Evt3Decoder decoder(*header.geometry);
    const std::span<const uint8_t> words = std::span(file).subspan(header.byte_count);
    const Sums sums = DecodeInPieces(&decoder, words, piece);
    ExpectKnown(sums, decoder.faults());
    for (const Evt3Kernel* kernel : AvailableEvt3Kernels()) {
      SCOPED_TRACE(kernel->name);
      Evt3Decoder batched(*header.geometry, *kernel);
      const Sums batched_sums = DecodeInBatchesOfPieces(&batched, words, piece);
      ExpectKnown(batched_sums, batched.faults());
    }
  }
}

TEST(RecordedEvents, Evt2OfTheThirdGeneration) {
  RIGCAL_REQUIRE_RECORDED_DATA(data);
  const std::vector<uint8_t> file = ReadFile(data / "events/evt2_gen3.raw");
  ASSERT_OK_AND_ASSIGN(const EventFileHeader header, ParseRawHeader(file));
  EXPECT_EQ(header.format, EventFormat::kEvt2);
  ASSERT_TRUE(header.geometry);
  for (const size_t piece : {file.size(), size_t{40000}, size_t{8}}) {
    Evt2Decoder decoder(*header.geometry);
    const Sums sums = DecodeInPieces(&decoder, std::span(file).subspan(header.byte_count), piece);
    EXPECT_EQ(sums.events, 521252u);
    EXPECT_EQ(sums.on, 185861u);
    EXPECT_EQ(sums.x, 128979953u);
    EXPECT_EQ(sums.y, 216346680u);
    EXPECT_EQ(sums.first_us, 913716224u);
    EXPECT_EQ(sums.last_us, 913812095u);
    EXPECT_EQ(decoder.faults(), EventFaults{});
  }
}

}  // namespace
}  // namespace rigcal::agent::recorded_events_test

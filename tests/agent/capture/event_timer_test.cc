// SPDX-License-Identifier: Apache-2.0
#include "agent/capture/event_timer.h"

#include <gtest/gtest.h>

#include <cstdint>
#include <vector>

#include "agent/event/evt3_writer.h"

namespace rigcal::agent::event_timer_test {
namespace {

constexpr SensorGeometry kGeometry{640, 480};

template <typename Word>
std::vector<uint8_t> LittleEndian(std::initializer_list<Word> words) {
  std::vector<uint8_t> bytes;
  for (const Word word : words) {
    for (size_t i = 0; i < sizeof(Word); ++i) bytes.push_back(static_cast<uint8_t>(word >> 8 * i));
  }
  return bytes;
}

TEST(EventTimer, FollowsEvt3OverItsOverflow) {
  EventTimer timer(MakeEventDecoder(EventFormat::kEvt3, false, kGeometry));
  Evt3Writer writer;
  for (int64_t time_us = 16'700'000; time_us < 16'900'000; time_us += 2000) {
    std::vector<uint8_t> bytes;
    writer.WriteTime(time_us, &bytes);
    timer.Take(bytes);
    ASSERT_EQ(timer.time_us(), time_us);
  }
}

TEST(EventTimer, FollowsEvt2) {
  EventTimer timer(MakeEventDecoder(EventFormat::kEvt2, false, kGeometry));
  timer.Take(LittleEndian<uint32_t>({0x80000010u}));
  EXPECT_EQ(timer.time_us(), 16 << 6);
}

TEST(EventTimer, FollowsBothOrdersOfEvt21) {
  for (const bool swapped : {false, true}) {
    EventTimer timer(MakeEventDecoder(EventFormat::kEvt21, swapped, kGeometry));
    timer.Take(
        LittleEndian<uint64_t>({swapped ? uint64_t{0x80000010u} : uint64_t{0x80000010u} << 32}));
    EXPECT_EQ(timer.time_us(), 16 << 6) << swapped;
  }
}

}  // namespace
}  // namespace rigcal::agent::event_timer_test

// SPDX-License-Identifier: Apache-2.0
#include "agent/event/plain_events.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <limits>
#include <string>
#include <vector>

#include "absl/strings/str_cat.h"

namespace rigcal::agent::plain_events_test {
namespace {

using ::testing::ElementsAre;
using ::testing::IsEmpty;

struct Script {
  std::vector<std::string> said;

  void Event(uint32_t x, uint32_t y, bool on, uint32_t time_us) {
    said.push_back(absl::StrCat(x, ",", y, on ? ",on,@" : ",off,@", time_us));
  }
  void Vector(uint32_t, uint32_t, bool, uint32_t, uint32_t) { said.emplace_back("vector"); }
  void Trigger(const TriggerEvent& trigger) {
    said.push_back(absl::StrCat(trigger.rising ? "rise " : "fall ", int{trigger.channel}, " @",
                                trigger.time_us));
  }
  void TimeStepBack(int64_t time_us) { said.push_back(absl::StrCat("anew @", time_us)); }
};

std::span<const uint8_t> Bytes(const std::vector<PlainEvent>& events) {
  return {reinterpret_cast<const uint8_t*>(events.data()), events.size() * sizeof(PlainEvent)};
}

std::vector<std::string> Decode(const std::vector<PlainEvent>& events, EventFaults* faults,
                                size_t per_chunk = 1000) {
  PlainEventDecoder decoder({640, 480});
  Script script;
  const auto bytes = Bytes(events);
  for (size_t at = 0; at < bytes.size(); at += per_chunk * sizeof(PlainEvent)) {
    decoder.Decode(bytes.subspan(at, std::min(per_chunk * sizeof(PlainEvent), bytes.size() - at)),
                   script);
  }
  *faults = decoder.faults();
  return script.said;
}

PlainEvent At(int64_t time_us, uint16_t x = 1) { return {.time_us = time_us, .x = x, .y = 2}; }

TEST(PlainEventDecoder, TellsEventsAndTriggersWithTheirWholeTimes) {
  const int64_t late_us = int64_t{5} << 32;
  EventFaults faults;
  EXPECT_THAT(Decode({{.time_us = late_us, .x = 639, .y = 479, .kind = PlainEvent::kOn},
                      {.time_us = late_us + 7, .x = 0, .y = 0, .kind = PlainEvent::kOff},
                      {.time_us = late_us + 9, .kind = PlainEvent::kTriggerRising, .channel = 6},
                      {.time_us = late_us + 9, .kind = PlainEvent::kTriggerFalling, .channel = 0}},
                     &faults),
              ElementsAre("639,479,on,@0", "0,0,off,@7", absl::StrCat("rise 6 @", late_us + 9),
                          absl::StrCat("fall 0 @", late_us + 9)));
  EXPECT_EQ(faults, EventFaults{});
}

TEST(PlainEventDecoder, CountsPixelsThatTheSensorDoesNotHave) {
  EventFaults faults;
  EXPECT_THAT(Decode({{.time_us = 1, .x = 640, .y = 0},
                      {.time_us = 1, .x = 0, .y = 480},
                      {.time_us = 1, .x = 65535, .y = 65535}},
                     &faults),
              IsEmpty());
  EXPECT_EQ(faults, (EventFaults{.outside_geometry = 3}));
}

TEST(PlainEventDecoder, LetsAMillisecondOfDisorderThrough) {
  EventFaults faults;
  EXPECT_THAT(Decode({At(5000), At(4000), At(5001), At(4001)}, &faults),
              ElementsAre("1,2,off,@5000", "1,2,off,@4000", "1,2,off,@5001", "1,2,off,@4001"));
  EXPECT_EQ(faults, EventFaults{});
  // A slow drift backwards is no disorder.
  EXPECT_THAT(Decode({At(5000), At(4500), At(3999)}, &faults),
              ElementsAre("1,2,off,@5000", "1,2,off,@4500", "anew @3999", "1,2,off,@3999"));
  EXPECT_EQ(faults, (EventFaults{.time_steps_back = 1}));
}

TEST(PlainEventDecoder, AStepBackBeginsAnEpochOnce) {
  EventFaults faults;
  for (const size_t per_chunk : {1, 2, 1000}) {
    EXPECT_THAT(Decode({At(9'000'000), At(9'000'010), At(100), At(110)}, &faults, per_chunk),
                ElementsAre("1,2,off,@9000000", "1,2,off,@9000010", "anew @100", "1,2,off,@100",
                            "1,2,off,@110"));
    EXPECT_EQ(faults, (EventFaults{.time_steps_back = 1}));
  }
}

TEST(PlainEventDecoder, AGapIsNoEpochButALeapIs) {
  const int64_t gap_us = PlainClock::kLeapUs;
  EventFaults faults;
  EXPECT_THAT(Decode({At(0), At(gap_us), At(2 * gap_us + 1)}, &faults),
              ElementsAre("1,2,off,@0", absl::StrCat("1,2,off,@", gap_us),
                          absl::StrCat("anew @", 2 * gap_us + 1),
                          absl::StrCat("1,2,off,@", 2 * gap_us + 1)));
  EXPECT_EQ(faults, (EventFaults{.time_steps_back = 1}));
}

TEST(PlainEventDecoder, LeavesOutATimeThatTheNextOneContradicts) {
  for (const int64_t damaged :
       {int64_t{0}, int64_t{9'000'000'000}, std::numeric_limits<int64_t>::max(),
        std::numeric_limits<int64_t>::min()}) {
    EventFaults faults;
    EXPECT_THAT(Decode({At(5'000'000), At(damaged), At(5'000'001)}, &faults),
                ElementsAre("1,2,off,@5000000", "1,2,off,@5000001"))
        << damaged;
    EXPECT_EQ(faults, (EventFaults{.unknown_words = 1})) << damaged;
  }
}

TEST(PlainEventDecoder, LeavesOutRowsThatCannotBeRead) {
  PlainEvent unreadable = At(123);
  unreadable.kind = PlainEvent::kUnreadable;
  EventFaults faults;
  EXPECT_THAT(Decode({At(5), unreadable, At(6)}, &faults), ElementsAre("1,2,off,@5", "1,2,off,@6"));
  EXPECT_EQ(faults, (EventFaults{.unknown_words = 1}));
  // Nanoseconds since 1970, taken for microseconds, would not fit 64 bits of nanoseconds.
  EXPECT_THAT(Decode({At(1'700'000'000'000'000'000), At(1'700'000'000'000'000'001)}, &faults),
              IsEmpty());
  EXPECT_EQ(faults, (EventFaults{.unknown_words = 2}));
}

}  // namespace
}  // namespace rigcal::agent::plain_events_test

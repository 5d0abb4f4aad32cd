// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>

namespace rigcal::agent {

// One change of brightness at one pixel, eight bytes.
struct PackedEvent {
  uint32_t time_us;     // the sensor's clock, modulo 2^32
  uint16_t x;           // column
  uint16_t y_polarity;  // row in bits 0 to 14; bit 15: brighter
  uint16_t y() const { return y_polarity & 0x7fff; }
  bool on() const { return (y_polarity & 0x8000) != 0; }
};
static_assert(sizeof(PackedEvent) == 8);

// An edge at an external-trigger input of the sensor.
struct TriggerEvent {
  int64_t time_us = 0;  // the sensor's clock, overflows taken out
  uint8_t channel = 0;
  bool rising = false;
};

// Encoding of a stream of events. Words are little-endian.
enum class EventFormat : uint8_t {
  kEvt2 = 1,   // 32-bit words, Prophesee EVT 2.0
  kEvt21 = 2,  // 64-bit words, Prophesee EVT 2.1
  kEvt3 = 3,   // 16-bit words, Prophesee EVT 3.0
  kPlain = 4,  // 128-bit records of this project (plain_events.h), from CSV and HDF5
};

// Bytes of one word of a format.
constexpr size_t WordBytes(EventFormat format) {
  constexpr size_t kBytes[] = {0, 4, 8, 2, 16};
  return kBytes[static_cast<size_t>(format)];
}

// Faults of a stream; everything good around them is kept.
struct EventFaults {
  uint64_t unknown_words = 0;     // of a type the format does not have
  uint64_t outside_geometry = 0;  // pixels the sensor does not have
  uint64_t before_time = 0;       // events before the first TIME_HIGH word
  uint64_t time_steps_back = 0;   // the sensor's clock stepped backwards: a new clock epoch
  uint64_t truncated_bytes = 0;   // at the end, less than a word

  friend bool operator==(const EventFaults&, const EventFaults&) = default;
  EventFaults& operator+=(const EventFaults& other);
};

struct EventFaultKind {
  const char* name;
  const char* text;  // for people
  uint64_t EventFaults::*count;
};
inline constexpr EventFaultKind kEventFaultKinds[] = {
    {"unknown_words", "unknown words", &EventFaults::unknown_words},
    {"outside_geometry", "outside of the geometry", &EventFaults::outside_geometry},
    {"before_time", "before the time is told", &EventFaults::before_time},
    {"time_steps_back", "time steps back", &EventFaults::time_steps_back},
    {"truncated_bytes", "truncated bytes", &EventFaults::truncated_bytes},
};

inline EventFaults& EventFaults::operator+=(const EventFaults& other) {
  for (const EventFaultKind& kind : kEventFaultKinds) this->*kind.count += other.*kind.count;
  return *this;
}

}  // namespace rigcal::agent

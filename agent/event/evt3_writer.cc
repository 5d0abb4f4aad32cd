// SPDX-License-Identifier: Apache-2.0
#include "agent/event/evt3_writer.h"

#include "absl/strings/str_cat.h"

namespace rigcal::agent {
namespace {

// Of neighbours within so many columns of the first, a base and its three vectors are shorter.
constexpr uint32_t kVectorSpan = 32;
constexpr size_t kMinVectorEvents = 5;

void Append(uint32_t type, uint32_t value, std::vector<uint8_t>* bytes) {
  const uint32_t word = type << 12 | value;
  const uint8_t both[] = {static_cast<uint8_t>(word), static_cast<uint8_t>(word >> 8)};
  bytes->insert(bytes->end(), both, both + 2);
}

// One time, row and polarity, columns rising.
bool Continues(const CdEvent& run, const CdEvent& last, const CdEvent& event) {
  return event.time_us == run.time_us && event.y == run.y && event.on == run.on && event.x > last.x;
}

}  // namespace

std::string Evt3Header(SensorGeometry geometry, const std::string& serial_number) {
  return absl::StrCat("% evt 3.0\n% format EVT3;height=", geometry.height,
                      ";width=", geometry.width, "\n% geometry ", geometry.width, "x",
                      geometry.height, "\n% serial_number ", serial_number, "\n% end\n");
}

void Evt3Writer::WriteTime(int64_t time_us, std::vector<uint8_t>* bytes) {
  const int64_t high = time_us >> 12;
  const auto low = static_cast<uint32_t>(time_us & 0xfff);
  const bool first = !high_;
  if (first || *high_ != high) Append(0x8, static_cast<uint32_t>(high & 0xfff), bytes);
  if (first || low_ != low) Append(0x6, low, bytes);
  high_ = high;
  low_ = low;
}

void Evt3Writer::WriteRun(std::span<const CdEvent> run, std::vector<uint8_t>* bytes) {
  const uint32_t polarity = run.front().on ? 0x800 : 0;
  while (!run.empty()) {
    const uint32_t base = run.front().x;
    size_t count = 0;
    uint32_t mask = 0;
    for (; count < run.size() && run[count].x < base + kVectorSpan; ++count) {
      mask |= 1u << (run[count].x - base);
    }
    if (count < kMinVectorEvents) {
      Append(0x2, polarity | base, bytes);
      run = run.subspan(1);
      continue;
    }
    Append(0x3, polarity | base, bytes);
    // Always all three: there are decoders that read vectors by threes alone.
    Append(0x4, mask & 0xfff, bytes);
    Append(0x4, mask >> 12 & 0xfff, bytes);
    Append(0x5, mask >> 24, bytes);
    run = run.subspan(count);
  }
}

void Evt3Writer::Write(std::span<const CdEvent> events, std::vector<uint8_t>* bytes) {
  for (size_t begin = 0; begin < events.size();) {
    size_t end = begin + 1;
    while (end < events.size() && Continues(events[begin], events[end - 1], events[end])) ++end;
    WriteTime(events[begin].time_us, bytes);
    if (y_ != events[begin].y) Append(0x0, events[begin].y, bytes);
    y_ = events[begin].y;
    WriteRun(events.subspan(begin, end - begin), bytes);
    begin = end;
  }
}

void Evt3Writer::Write(const TriggerEvent& trigger, std::vector<uint8_t>* bytes) {
  WriteTime(trigger.time_us, bytes);
  Append(0xA, static_cast<uint32_t>(trigger.channel & 0xf) << 8 | (trigger.rising ? 1u : 0u),
         bytes);
}

}  // namespace rigcal::agent

// SPDX-License-Identifier: Apache-2.0
#include "agent/event/evt2_writer.h"

#include "absl/strings/str_cat.h"

namespace rigcal::agent {
namespace {

constexpr uint32_t kOff = 0x0, kOn = 0x1, kTimeHigh = 0x8, kTrigger = 0xA;

void AppendWord(uint32_t type, uint32_t value, std::vector<uint8_t>* bytes) {
  const uint32_t word = type << 28 | value;
  for (int shift = 0; shift < 32; shift += 8) {
    bytes->push_back(static_cast<uint8_t>(word >> shift));
  }
}

}  // namespace

std::string Evt2Header(SensorGeometry geometry, const std::string& serial_number) {
  return absl::StrCat("% evt 2.0\n% format EVT2;height=", geometry.height,
                      ";width=", geometry.width, "\n% geometry ", geometry.width, "x",
                      geometry.height, "\n% serial_number ", serial_number, "\n% end\n");
}

uint32_t Evt2Writer::WriteTime(int64_t time_us, std::vector<uint8_t>* bytes) {
  const int64_t high = time_us >> 6;
  if (high_ != high) {
    const auto value = static_cast<uint32_t>(high & 0xfffffff);
    AppendWord(kTimeHigh, value, bytes);
    // A second one confirms a step that could be damage.
    if (!high_ || high - *high_ > 1) AppendWord(kTimeHigh, value, bytes);
    high_ = high;
  }
  return static_cast<uint32_t>(time_us & 0x3f) << 22;
}

void Evt2Writer::Write(std::span<const CdEvent> events, std::vector<uint8_t>* bytes) {
  for (const CdEvent& event : events) {
    const uint32_t low = WriteTime(event.time_us, bytes);
    AppendWord(event.on ? kOn : kOff, low | static_cast<uint32_t>(event.x) << 11 | event.y, bytes);
  }
}

void Evt2Writer::Write(const TriggerEvent& trigger, std::vector<uint8_t>* bytes) {
  const uint32_t low = WriteTime(trigger.time_us, bytes);
  AppendWord(kTrigger,
             low | static_cast<uint32_t>(trigger.channel & 0x1f) << 8 | (trigger.rising ? 1u : 0u),
             bytes);
}

}  // namespace rigcal::agent

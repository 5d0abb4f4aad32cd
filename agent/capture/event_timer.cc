// SPDX-License-Identifier: Apache-2.0
#include "agent/capture/event_timer.h"

namespace rigcal::agent {
namespace {

struct NoSink {
  void Event(uint32_t, uint32_t, bool, uint32_t) {}
  void Vector(uint32_t, uint32_t, bool, uint32_t, uint32_t) {}
  void Trigger(const TriggerEvent&) {}
  void TimeStepBack(int64_t) {}
};

}  // namespace

EventTimer::EventTimer(EventFormat format, bool halves_swapped, const SensorGeometry& geometry)
    : decoder_([&]() -> Decoder {
        if (format == EventFormat::kPlain) return PlainEventDecoder(geometry);
        if (format == EventFormat::kEvt2) return Evt2Decoder(geometry);
        if (format == EventFormat::kEvt21) return Evt21Decoder(geometry, halves_swapped);
        return Evt3Decoder(geometry);
      }()) {}

void EventTimer::Take(std::span<const uint8_t> bytes) {
  NoSink sink;
  std::visit([&](auto& decoder) { decoder.Decode(bytes, sink); }, decoder_);
}

int64_t EventTimer::time_us() const {
  return std::visit([](const auto& decoder) { return decoder.time_us(); }, decoder_);
}

}  // namespace rigcal::agent

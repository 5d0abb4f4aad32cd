// SPDX-License-Identifier: Apache-2.0
#include "agent/event/fault_locator.h"

#include <algorithm>
#include <array>

#include "agent/event/event_decoder.h"
#include "agent/event/plain_events.h"

namespace rigcal::agent {
namespace {

struct NoSink {
  void Event(uint32_t, uint32_t, bool, uint32_t) {}
  void Vector(uint32_t, uint32_t, bool, uint32_t, uint32_t) {}
  void Trigger(const TriggerEvent&) {}
  void TimeStepBack(int64_t) {}
};

}  // namespace

template <typename Decoder>
[[gnu::cold]] void FaultLocator::Find(const Decoder& before, std::span<const uint8_t> bytes,
                                      const EventFaults& after) {
  constexpr size_t kWord = Decoder::kWordBytes;
  const size_t end = bytes.size() / kWord * kWord;
  if (after.truncated_bytes != before.faults().truncated_bytes) {
    places_.try_emplace("truncated_bytes", offset_ + end);
  }
  const auto is_wanted = [&](const EventFaultKind& kind) {
    return after.*kind.count != before.faults().*kind.count && !places_.contains(kind.name);
  };
  auto wanted = std::count_if(std::begin(kEventFaultKinds), std::end(kEventFaultKinds), is_wanted);
  Decoder decoder = before;
  NoSink sink;
  size_t ahead = 0;  // the next word that asks ahead, or one that has been passed
  for (size_t at = 0; at < end && wanted > 0; at += kWord) {
    const uint64_t unknown = decoder.faults().unknown_words;
    std::array<uint8_t, 2 * kWord> pair;
    std::copy_n(bytes.begin() + static_cast<std::ptrdiff_t>(at), kWord, pair.begin());
    bool damaged = false;
    if (decoder.AsksAhead(pair.data())) {
      // The whole chunk's decoder saw the next such word: with it alone behind this one the verdict
      // is the same.
      for (ahead = std::max(ahead, at + kWord);
           ahead < end && !decoder.AsksAhead(bytes.data() + ahead);) {
        ahead += kWord;
      }
      if (ahead < end) {
        std::copy_n(bytes.begin() + static_cast<std::ptrdiff_t>(ahead), kWord,
                    pair.begin() + kWord);
        Decoder trial = decoder;
        trial.Decode(pair, sink);
        damaged = trial.faults().unknown_words != unknown;
      }
    }
    const EventFaults last = decoder.faults();
    if (!damaged) decoder.Decode(std::span(pair).first(kWord), sink);
    for (const EventFaultKind& kind : kEventFaultKinds) {
      const bool rose = decoder.faults().*kind.count != last.*kind.count ||
                        (damaged && kind.count == &EventFaults::unknown_words);
      if (rose && places_.try_emplace(kind.name, offset_ + at).second) --wanted;
    }
  }
}

template void FaultLocator::Find(const Evt2Decoder&, std::span<const uint8_t>, const EventFaults&);
template void FaultLocator::Find(const Evt21Decoder&, std::span<const uint8_t>, const EventFaults&);
template void FaultLocator::Find(const Evt3Decoder&, std::span<const uint8_t>, const EventFaults&);
template void FaultLocator::Find(const PlainEventDecoder&, std::span<const uint8_t>,
                                 const EventFaults&);

}  // namespace rigcal::agent

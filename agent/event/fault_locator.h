// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string_view>
#include <utility>
#include <vector>

#include "agent/event/event.h"
#include "agent/event/event_decoder.h"
#include "agent/event/plain_events.h"

namespace rigcal::agent {

// Where in a stream the first fault of each kind is: the offset of its word's first byte.
struct FaultPlaces {
  std::optional<uint64_t> unknown_words, outside_geometry, before_time, time_steps_back,
      truncated_bytes;

  // Those that are known, by the name of their count.
  std::vector<std::pair<std::string_view, uint64_t>> Named() const;
};

// Finds the places of faults that a decoder has counted, without slowing its loop: a chunk whose
// counts rose in a new kind is decoded again, word by word.
class FaultLocator {
 public:
  // Of the stream's words, see Evt21Decoder.
  explicit FaultLocator(bool halves_swapped = false) : halves_swapped_(halves_swapped) {}

  // For every chunk in order. `before`: the decoder as it was before `bytes`; `after`: its faults
  // behind them.
  template <typename Decoder>
  void Look(const Decoder& before, std::span<const uint8_t> bytes, const EventFaults& after) {
    if (after != before.faults()) [[unlikely]]
      Find(before, bytes, after);
    offset_ += bytes.size();
  }

  // Offsets count from the first byte looked at.
  const FaultPlaces& places() const { return places_; }

 private:
  template <typename Decoder>
  void FindIn(const Decoder& before, std::span<const uint8_t> bytes, const EventFaults& after);
  void Find(const Evt2Decoder&, std::span<const uint8_t> bytes, const EventFaults& after);
  void Find(const Evt21Decoder&, std::span<const uint8_t> bytes, const EventFaults& after);
  void Find(const Evt3Decoder&, std::span<const uint8_t> bytes, const EventFaults& after);
  void Find(const PlainEventDecoder&, std::span<const uint8_t> bytes, const EventFaults& after);
  // Whether a decoder may look ahead to the next such word before it believes this one.
  bool AsksAhead(const Evt2Decoder&, const uint8_t* word) const;
  bool AsksAhead(const Evt21Decoder&, const uint8_t* word) const;
  bool AsksAhead(const Evt3Decoder&, const uint8_t* word) const;
  bool AsksAhead(const PlainEventDecoder&, const uint8_t* word) const;

  bool halves_swapped_;
  uint64_t offset_ = 0;
  FaultPlaces places_;
};

}  // namespace rigcal::agent

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

// Offsets of the first fault of each kind: of its word's first byte.
struct FaultPlaces {
  std::optional<uint64_t> unknown_words, outside_geometry, before_time, time_steps_back,
      truncated_bytes;

  // Those that are known, by the name of their count.
  std::vector<std::pair<std::string_view, uint64_t>> Named() const;
};

// Locates the faults that a decoder has counted, without slowing its loop: a chunk in which a new
// kind was counted is decoded again, word by word.
class FaultLocator {
 public:
  // For every chunk in order. `before`: the decoder as it was before `bytes`; `after`: its faults
  // behind them.
  template <typename Decoder>
  void Look(const Decoder& before, std::span<const uint8_t> bytes, const EventFaults& after) {
    if (after != before.faults()) [[unlikely]]
      Find(before, bytes, after);
    offset_ += bytes.size();
  }

  // Offsets count from the first byte passed to Look.
  const FaultPlaces& places() const { return places_; }

 private:
  template <typename Decoder>
  void Find(const Decoder& before, std::span<const uint8_t> bytes, const EventFaults& after);

  uint64_t offset_ = 0;
  FaultPlaces places_;
};

}  // namespace rigcal::agent

// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <map>
#include <span>
#include <string>

#include "agent/event/event.h"

namespace rigcal::agent {

// Offset of the first fault of each kind, by its name: of its word's first byte.
using FaultPlaces = std::map<std::string, uint64_t>;

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

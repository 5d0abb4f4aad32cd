// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "agent/event/event.h"
#include "common/camera/camera_description.h"
#include "common/status/refusal.h"
#include "common/target/target.h"
#include "common/time/clock.h"

namespace rigcal::agent {

// A piece of an encoded stream, cut between words. Decoding and filtering are one pass over it, so
// sources deliver bytes, not events. Valid until the source's next Next or Start.
struct EventChunk {
  EventFormat format = EventFormat::kEvt3;
  bool halves_swapped = false;  // EVT 2.1 as an IMX636 sends it
  std::span<const uint8_t> bytes;
  uint64_t byte_offset = 0;  // of the first byte in its file or stream, for messages
  // The camera was disconnected before this piece: its clock began anew.
  bool clock_began_anew = false;
};

// One event camera's stream in capture order. Start, Next and the getters are called by one thread;
// Stop by any.
class EventSource {
 public:
  virtual ~EventSource() = default;

  // Valid from construction on, never changes.
  virtual const CameraDescription& description() const = 0;
  // Begins a capture, from the beginning where there is one. The target is for simulated
  // cameras; the others ignore it.
  virtual absl::Status Start(const Target& target) = 0;
  // The next piece, at most a few milliseconds or one megabyte of it; waits for it. None: the
  // source has ended or was stopped.
  virtual absl::StatusOr<std::optional<EventChunk>> Next() = 0;
  // Makes a waiting and every later Next return none, until the next Start.
  virtual void Stop() = 0;
  // Place of a word of the last piece, for messages.
  virtual std::string PlaceOf(uint64_t byte_offset) const {
    return "byte " + std::to_string(byte_offset);
  }
  virtual std::vector<ClockSample> TakeClockSamples() { return {}; }
  // Since Start, by reason. `camera` is left empty.
  virtual std::vector<Refusal> Refused() const { return {}; }
};

}  // namespace rigcal::agent

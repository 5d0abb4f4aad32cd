// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "absl/status/status.h"
#include "common/target/colour_range.h"

namespace rigcal {

enum class DetectorCommand : uint8_t {
  kGet = 1,
  kLearnMask = 2,
  kClearMask = 3,
  kTune = 4,
  kSetColour = 5,
};

// Asks an agent for the detector of a camera, or to change it.
struct DetectorRequest {
  uint32_t request_id = 0;  // >= 1
  std::string camera;
  DetectorCommand command = DetectorCommand::kGet;
  uint32_t frame_count = 0;           // to learn from; 0: the agent's default
  std::optional<ColourRange> colour;  // of kSetColour; none: that of the agent's configuration
};

// A mask or a colour being learnt from a camera's frames.
struct DetectorLearning {
  enum class Kind : uint8_t { kMask = 1, kColour = 2 };
  enum class State : uint8_t { kRunning = 1, kSucceeded = 2, kFailed = 3 };

  Kind kind = Kind::kMask;
  State state = State::kRunning;
  uint32_t frame_count = 0;
  uint32_t wanted_frame_count = 0;
  uint32_t wand_count = 0;  // frames with the wand
  std::string message;      // the result, or why there is none and what to do

  friend bool operator==(const DetectorLearning&, const DetectorLearning&) = default;
};

struct DetectorState {
  ColourRange colour;          // in use
  bool colour_learnt = false;  // it replaces that of the agent's configuration
  bool mask_learnt = false;    // besides that of the agent's configuration
  uint32_t ignored_pixel_count = 0;
  double ignored_share = 0;                  // of the image, 0 to 1
  std::optional<DetectorLearning> learning;  // that runs, or the last one

  friend bool operator==(const DetectorState&, const DetectorState&) = default;
};

// The answer to a DetectorRequest.
struct DetectorAnswer {
  uint32_t request_id = 0;
  // NOT_FOUND: no such camera; FAILED_PRECONDITION: not now, or not with this camera;
  // INVALID_ARGUMENT: a value; INTERNAL: it could not be done.
  absl::Status status;
  DetectorState state;  // with OK
};

}  // namespace rigcal

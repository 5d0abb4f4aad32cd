// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <memory>
#include <string>

#include "absl/status/statusor.h"
#include "agent/capture/detector_control.h"
#include "agent/capture/preview/preview_tap.h"
#include "common/session/detector.h"

namespace rigcal::agent {

// Something that is learnt from frames of one camera. One thread at a time.
class LearningTask {
 public:
  virtual ~LearningTask() = default;

  // Any error ends the learning.
  virtual absl::Status Add(const PreviewFrame& frame) = 0;
  // Once enough frames are added: changes the detector and says what was learnt.
  // FAILED_PRECONDITION: nothing can be learnt from these frames; says what to do.
  virtual absl::StatusOr<std::string> Finish(DetectorControl* detector) = 0;
};

// Static bright spots in frames without the wand, or with one that moves. Fails where the mask
// would hide a wand that the frames show, or more than half of the image.
absl::StatusOr<std::unique_ptr<LearningTask>> MakeMaskTask(const DetectorControl& detector);

// The colour of the wand, which the frames show. FAILED_PRECONDITION: the target of the capture has
// less than three markers.
absl::StatusOr<std::unique_ptr<LearningTask>> MakeColourTask(const DetectorControl& detector,
                                                             const Target& target);

}  // namespace rigcal::agent

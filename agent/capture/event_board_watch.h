// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "agent/detect/event_board/event_board_detector.h"
#include "agent/event/event_source.h"
#include "agent/identify/detection.h"
#include "common/board/board.h"
#include "common/camera/camera_description.h"
#include "common/target/target.h"

namespace rigcal::agent {

// INVALID_ARGUMENT: a board without circles, which events show badly; says what to take.
absl::Status CheckShownByEvents(const Board& board, const std::string& camera);

// A board of circles as the target of a session, in the events of one camera: a detection for each
// picture of EventBoardDetector, at the picture's time; marker m is point m of the board. Of a
// camera whose lens is known, centres are the images of the circles' centres.
class EventBoardWatch {
 public:
  // INVALID_ARGUMENT: target or camera not valid, or a board without circles.
  static absl::StatusOr<EventBoardWatch> Create(const Target& target,
                                                const CameraDescription& camera);

  absl::Status Take(const EventChunk& chunk, std::vector<Detection>* found);
  absl::Status Finish(std::vector<Detection>* found);

  EventFaults faults() const;
  const DetectionCounts& by_outcome() const { return by_outcome_; }

 private:
  EventBoardWatch(const Target& target, const CameraDescription& camera, const Board& board)
      : target_(target), camera_(camera), board_(board) {}
  absl::Status EndDetector(std::vector<Detection>* found);
  void Tell(const std::vector<EventBoardPicture>& pictures, std::vector<Detection>* found);

  Target target_;
  CameraDescription camera_;
  Board board_;
  std::optional<EventBoardDetector> detector_;  // from the first chunk on, which has the format
  EventFaults past_faults_;
  DetectionCounts by_outcome_;
  uint32_t first_epoch_ = 0, last_epoch_ = 0;
  std::optional<int64_t> last_ns_;  // of the clock epoch
};

}  // namespace rigcal::agent

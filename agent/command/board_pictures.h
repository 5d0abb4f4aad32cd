// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "agent/capture/frame_source.h"
#include "agent/detect/board/board_detector.h"
#include "agent/detect/event_board/event_board_detector.h"
#include "agent/event/event_source.h"
#include "common/board/board.h"
#include "common/camera/camera_description.h"
#include "common/status/refusal.h"

namespace rigcal::agent {

// A picture of a camera that was searched for the board. Valid until the next one.
struct BoardPicture {
  ImageView image;
  std::optional<SeenBoard> seen;
  bool is_blurred = false;  // by motion
  std::string file;         // that it was read from; empty: it has none of its own
};

// The pictures of one camera, in capture order, each searched for the board.
class BoardPictures {
 public:
  virtual ~BoardPictures() = default;

  virtual const CameraDescription& description() const = 0;
  virtual absl::Status Start() = 0;
  // Null: there are no more.
  virtual absl::StatusOr<const BoardPicture*> Next() = 0;
  virtual void Stop() = 0;
  // Pictures that could not be taken, by reason.
  virtual std::vector<Refusal> Refused() const { return {}; }
  // Of the events that made the pictures; none: of a frame camera.
  virtual std::optional<EventBoardCounts> event_counts() const { return std::nullopt; }
};

std::unique_ptr<BoardPictures> PicturesOfFrames(const Board& board,
                                                std::unique_ptr<FrameSource> frames);
// INVALID_ARGUMENT: a board without circles, which events show badly.
absl::StatusOr<std::unique_ptr<BoardPictures>> PicturesOfEvents(
    const Board& board, std::unique_ptr<EventSource> events);

}  // namespace rigcal::agent

// SPDX-License-Identifier: Apache-2.0
#include "agent/command/board_pictures.h"

#include <utility>
#include <vector>

#include "agent/capture/event_board_watch.h"
#include "agent/capture/image_file.h"
#include "common/status/status_macros.h"
#include "common/target/target.h"

namespace rigcal::agent {
namespace {

// A disc that moves further while a screen changes (about 20 ms) is smeared.
constexpr double kBurstSpeedPxS = 80;

// What a simulated camera shows; others ignore it.
Target TargetOf(const Board& board) {
  Target target;
  target.kind = TargetKind::kRigid;
  target.board = FormatBoard(board);
  return target;
}

class FramePictures : public BoardPictures {
 public:
  FramePictures(const Board& board, std::unique_ptr<FrameSource> frames)
      : board_(board), frames_(std::move(frames)) {}

  const CameraDescription& description() const override { return frames_->description(); }
  absl::Status Start() override { return frames_->Start(TargetOf(board_)); }
  absl::StatusOr<const BoardPicture*> Next() override {
    RIGCAL_ASSIGN_OR_RETURN(const std::optional<Frame> frame, frames_->Next());
    if (!frame) return nullptr;
    picture_.image = frame->image;
    picture_.file = frame->file;
    RIGCAL_ASSIGN_OR_RETURN(picture_.seen, FindBoard(board_, frame->image));
    return &picture_;
  }
  void Stop() override { frames_->Stop(); }
  std::vector<Refusal> Refused() const override { return frames_->Refused(); }

 private:
  const Board board_;
  const std::unique_ptr<FrameSource> frames_;
  BoardPicture picture_;
};

class EventPictures : public BoardPictures {
 public:
  EventPictures(const Board& board, std::unique_ptr<EventSource> events)
      : board_(board), events_(std::move(events)) {}

  const CameraDescription& description() const override { return events_->description(); }
  absl::Status Start() override { return events_->Start(TargetOf(board_)); }
  absl::StatusOr<const BoardPicture*> Next() override {
    while (next_ == pictures_.size()) {
      pictures_.clear();
      next_ = 0;
      if (has_ended_) return nullptr;
      RIGCAL_RETURN_IF_ERROR(TakeChunk());
    }
    EventBoardPicture& picture = pictures_[next_++];
    const bool is_burst = picture.kind == EventBoardPicture::Kind::kBurst;
    picture_.image = ViewOf(picture.grey);
    picture_.seen = std::move(picture.seen);
    picture_.is_blurred = is_burst && picture.speed_px_s > kBurstSpeedPxS;
    return &picture_;
  }
  void Stop() override { events_->Stop(); }
  std::optional<EventBoardCounts> event_counts() const override {
    return detector_ ? detector_->counts() : EventBoardCounts();
  }

 private:
  absl::Status TakeChunk() {
    RIGCAL_ASSIGN_OR_RETURN(const std::optional<EventChunk> chunk, events_->Next());
    if (!chunk) {
      has_ended_ = true;
      return detector_ ? detector_->Finish(&pictures_) : absl::OkStatus();
    }
    if (!detector_) {
      const ImageSize& size = description().image_size_px;
      detector_.emplace(board_, SensorGeometry{size.width, size.height}, chunk->format,
                        chunk->halves_swapped);
    }
    return detector_->Take(chunk->bytes, &pictures_);
  }

  const Board board_;
  const std::unique_ptr<EventSource> events_;
  std::optional<EventBoardDetector> detector_;
  std::vector<EventBoardPicture> pictures_;
  size_t next_ = 0;
  BoardPicture picture_;
  bool has_ended_ = false;
};

}  // namespace

std::unique_ptr<BoardPictures> PicturesOfFrames(const Board& board,
                                                std::unique_ptr<FrameSource> frames) {
  return std::make_unique<FramePictures>(board, std::move(frames));
}

absl::StatusOr<std::unique_ptr<BoardPictures>> PicturesOfEvents(
    const Board& board, std::unique_ptr<EventSource> events) {
  RIGCAL_RETURN_IF_ERROR(CheckShownByEvents(board, events->description().camera));
  return std::make_unique<EventPictures>(board, std::move(events));
}

}  // namespace rigcal::agent

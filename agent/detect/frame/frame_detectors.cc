// SPDX-License-Identifier: Apache-2.0
#include "absl/strings/str_cat.h"
#include "agent/detect/frame/board_frame_detector.h"
#include "agent/detect/frame/frame_detector.h"
#include "agent/detect/frame/wand_detector.h"
#include "common/status/status_macros.h"

namespace rigcal::agent {
namespace {

absl::StatusOr<std::unique_ptr<FrameDetector>> MakeWandDetector(const WandDetectorOptions& options,
                                                                const Target& target,
                                                                const CameraDescription& camera) {
  RIGCAL_ASSIGN_OR_RETURN(WandDetector detector, WandDetector::Create(options, target, camera));
  return std::make_unique<WandDetector>(std::move(detector));
}

absl::StatusOr<std::unique_ptr<FrameDetector>> MakeBoardDetector(const WandDetectorOptions&,
                                                                 const Target& target,
                                                                 const CameraDescription& camera) {
  RIGCAL_ASSIGN_OR_RETURN(BoardFrameDetector detector, BoardFrameDetector::Create(target, camera));
  return std::make_unique<BoardFrameDetector>(std::move(detector));
}

constexpr FrameDetectorKind kKinds[] = {
    {"wand", [](const Target& target) { return target.IsLine(); }, MakeWandDetector},
    {"board", [](const Target& target) { return !target.board.empty(); }, MakeBoardDetector},
};

}  // namespace

absl::Status CheckImage(const CameraDescription& camera, const ImageView& image) {
  const ImageSize size = camera.image_size_px;
  if (image.data != nullptr && image.width == static_cast<int>(size.width) &&
      image.height == static_cast<int>(size.height)) {
    return absl::OkStatus();
  }
  return absl::InvalidArgumentError(absl::StrCat(
      "camera ", camera.camera, ": an image of ", image.width, "x", image.height, " pixels",
      image.data == nullptr ? " without data" : "", ", its description says ", size.width, "x",
      size.height, "; set the camera's region or its calibration right"));
}

absl::Span<const FrameDetectorKind> FrameDetectorKinds() { return kKinds; }

absl::StatusOr<std::unique_ptr<FrameDetector>> MakeFrameDetector(const WandDetectorOptions& options,
                                                                 const Target& target,
                                                                 const CameraDescription& camera) {
  for (const FrameDetectorKind& kind : kKinds) {
    if (kind.finds(target)) return kind.make(options, target, camera);
  }
  return absl::FailedPreconditionError(
      absl::StrCat("camera ", camera.camera, ": ", std::string(CheckDetectable(target).message())));
}

}  // namespace rigcal::agent

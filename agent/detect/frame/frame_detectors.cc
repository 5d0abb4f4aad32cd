// SPDX-License-Identifier: Apache-2.0
#include "absl/strings/str_cat.h"
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

constexpr FrameDetectorKind kKinds[] = {
    {"wand", [](const Target& target) { return target.IsLine(); }, MakeWandDetector},
};

}  // namespace

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

// SPDX-License-Identifier: Apache-2.0
// The part of AravisFrameSource that keeps a camera going: finding it again, and asking it for
// pictures.
#include <spdlog/spdlog.h>

#include <algorithm>

#include "absl/strings/str_cat.h"
#include "agent/capture/genicam/aravis_frame_source.h"
#include "common/status/status_macros.h"

namespace rigcal::agent {
namespace {

constexpr std::chrono::milliseconds kShortestPause(200);
constexpr std::chrono::milliseconds kLongestPause(5000);
constexpr std::chrono::milliseconds kLongestWait(
    200);  // then it is asked whether it is still there

}  // namespace

bool AravisFrameSource::Reconnect() {
  using Clock = std::chrono::steady_clock;
  spdlog::warn("camera {}: {} was lost; looking for it until it is back", options_.camera,
               options_.device);
  refused_.Add("", "camera_lost", 1, absl::StrCat(options_.device, " was unplugged or taken"));
  EndStream();
  camera_.reset();
  const Clock::time_point began = Clock::now();
  std::string last_reason;
  for (auto pause = kShortestPause; !stopped_; pause = std::min(2 * pause, kLongestPause)) {
    const absl::Status status = OpenAgain();
    if (status.ok()) {
      ++counts_.reconnects;
      clock_.Reconnected();
      spdlog::info("camera {}: {} is back after {:.1f} s", options_.camera, options_.device,
                   std::chrono::duration<double>(Clock::now() - began).count());
      return true;
    }
    const std::string reason(status.message());
    if (reason != last_reason) spdlog::info("camera {}: not yet: {}", options_.camera, reason);
    last_reason = reason;
    if (!Pause(pause)) break;
  }
  return false;
}

absl::Status AravisFrameSource::OpenAgain() {
  RIGCAL_ASSIGN_OR_RETURN(camera_, AravisCamera::Open(options_, /*list_others=*/false));
  absl::Status status;
  // What was told about this camera must still hold.
  if (camera_->image_size_px() != description_.image_size_px) {
    status = CheckImageSize(options_.camera, camera_->image_size_px(), description_.image_size_px,
                            "this capture");
  } else if (const std::string& clock_id =
                 camera_->ptp_clock_id().empty() ? camera_->device_id() : camera_->ptp_clock_id();
             clock_id != description_.clock.clock_id) {
    status = absl::FailedPreconditionError(
        absl::StrCat("camera ", options_.camera, ": another camera or clock answers: ", clock_id,
                     " instead of ", description_.clock.clock_id));
  } else {
    status = BeginStream();
  }
  if (!status.ok()) camera_.reset();
  return status;
}

bool AravisFrameSource::Pause(std::chrono::milliseconds time) {
  const auto deadline = std::chrono::steady_clock::now() + time;
  while (!stopped_) {
    const auto left = std::chrono::duration_cast<std::chrono::milliseconds>(
        deadline - std::chrono::steady_clock::now());
    if (left.count() <= 0) return true;
    bell_.Wait(left);
  }
  return false;
}

std::chrono::milliseconds AravisFrameSource::TriggerIfDue() {
  using Clock = std::chrono::steady_clock;
  if (options_.trigger != "software") return kLongestWait;
  const Clock::time_point now = Clock::now();
  if (now >= next_trigger_) {
    GErrorSlot error;
    arv_camera_software_trigger(camera_->get(), error.out());
    if (!error.ok()) spdlog::debug("camera {}: trigger: {}", options_.camera, error.message());
    const auto period = std::chrono::duration_cast<Clock::duration>(
        std::chrono::duration<double>(1 / options_.frame_rate_hz.value_or(1)));
    // What was late is not made up for: two pictures at once help nobody.
    next_trigger_ = std::max(next_trigger_ + period, now);
  }
  const auto left = std::chrono::ceil<std::chrono::milliseconds>(next_trigger_ - now);
  return std::min(left, kLongestWait);
}

}  // namespace rigcal::agent

// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <atomic>
#include <chrono>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "agent/capture/device_clock.h"
#include "agent/capture/frame_source.h"
#include "agent/capture/genicam/aravis_camera.h"
#include "agent/capture/genicam/aravis_frame_ids.h"
#include "agent/capture/genicam/aravis_options.h"
#include "agent/capture/genicam/aravis_stream.h"

namespace rigcal::agent {

// A GenICam camera, GigE Vision or USB3 Vision, through Aravis. Under our control from Create to
// the end of the object.
//
// Time: a GenICam timestamp is the start of the exposure by the camera's clock, or by PTP if that
// was requested and has locked (then all such cameras share one clock). A frame's time is its
// timestamp plus half the exposure that the camera reports; AravisSourceOptions::latency_s corrects
// cameras that timestamp at another instant.
//
// Counts: received frames; damaged ones (missing packets, wrong size); lost ones (ids never seen,
// or no free buffer). Frames that had arrived when the capture stopped count as received. A camera
// that is unplugged is reopened, with growing pauses, until Stop; frames lost meanwhile are not
// counted. Reasons in Refused: frame_incomplete, frame_lost, frame_no_buffer, frame_wrong_size,
// camera_lost.
class AravisFrameSource : public FrameSource {
 public:
  // As AravisCamera::Open; FAILED_PRECONDITION also if the frame size is not that of the
  // calibration; NOT_FOUND or INVALID_ARGUMENT for the calibration file.
  static absl::StatusOr<std::unique_ptr<AravisFrameSource>> Create(AravisSourceOptions options);
  ~AravisFrameSource() override { EndStream(); }

  const CameraDescription& description() const override { return description_; }
  absl::Status Start(const Target& target) override;
  absl::StatusOr<std::optional<Frame>> Next() override;
  void Stop() override;
  std::vector<ClockSample> TakeClockSamples() override { return clock_.Take(); }
  FrameCounts counts() const override { return counts_; }
  std::vector<Refusal> Refused() const override { return refused_.List(); }

 private:
  AravisFrameSource(AravisSourceOptions options, CameraDescription description)
      : options_(std::move(options)), description_(std::move(description)) {}

  absl::Status BeginStream();
  void EndStream();  // counts frames that have arrived
  bool Reconnect();  // false: stopped
  absl::Status OpenAgain();
  bool Pause(std::chrono::milliseconds time);  // false: stopped
  // Counts the frame; true if it is complete.
  bool Count(ArvBuffer* buffer);
  std::optional<Frame> ToFrame(ArvBuffer* buffer);
  void FollowClock(ArvBuffer* buffer, Frame* frame);
  void Damaged(RefusalReason reason, const std::string& example);
  // Requests a frame when one is due (trigger=software); the time until the next.
  std::chrono::milliseconds TriggerIfDue();

  const AravisSourceOptions options_;
  const CameraDescription description_;
  CaptureBell bell_;
  std::atomic<bool> stopped_ = true;

  std::unique_ptr<AravisCamera> camera_;
  std::unique_ptr<AravisStream> stream_;
  std::chrono::steady_clock::time_point next_trigger_;
  ArvBuffer* held_ = nullptr;  // of the last Frame
  std::vector<uint8_t> converted_;
  FrameIdTracker frame_ids_;
  uint64_t lost_by_id_ = 0;   // of this stream
  uint64_t lost_before_ = 0;  // of earlier streams of this capture
  double exposure_s_ = 0;
  int64_t next_exposure_ns_ = 0;  // next time to read it, host monotonic
  DeviceClock clock_;
  bool clock_can_be_read_ = false;
  FrameCounts counts_;
  RefusalCounter refused_;
};

}  // namespace rigcal::agent

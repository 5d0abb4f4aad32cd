// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <atomic>
#include <chrono>
#include <condition_variable>
#include <cstdint>
#include <memory>
#include <mutex>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "agent/capture/device_clock.h"
#include "agent/capture/event_timer.h"
#include "agent/capture/metavision/byte_aligner.h"
#include "agent/capture/metavision/metavision_device.h"
#include "agent/capture/metavision/metavision_options.h"
#include "agent/event/event_source.h"

namespace rigcal::agent {

// A live event camera, through OpenEB or the Metavision SDK. Under our control from Create to the
// end of the object.
//
// Time: the sensor's clock starts at zero with each Start, or with the primary's for a secondary
// camera. It is related to the host's clocks by the arrival of events, to about 5 ms. A camera that
// is unplugged is reopened, with growing pauses, until Stop; its clock then restarts
// (EventChunk::clock_began_anew). Refused counts camera_lost. The SDK does not report events that
// it drops.
class MetavisionEventSource : public EventSource {
 public:
  // As OpenMetavisionDevice; NOT_FOUND or INVALID_ARGUMENT also for the files of settings and
  // calibration; FAILED_PRECONDITION if the sensor size is not that of the calibration.
  static absl::StatusOr<std::unique_ptr<MetavisionEventSource>> Create(
      MetavisionSourceOptions options);
  ~MetavisionEventSource() override;

  const CameraDescription& description() const override { return description_; }
  absl::Status Start(const Target& target) override;
  absl::StatusOr<std::optional<EventChunk>> Next() override;
  void Stop() override;
  std::vector<ClockSample> TakeClockSamples() override { return clock_.Take(); }
  std::vector<Refusal> Refused() const override { return refused_.List(); }

  // The pause before the next attempt to reopen a lost camera.
  static std::chrono::milliseconds NextPause(std::chrono::milliseconds pause,
                                             const MetavisionSourceOptions& options);

 private:
  using SteadyTime = std::chrono::steady_clock::time_point;

  MetavisionEventSource(MetavisionSourceOptions options, MetavisionRequest request,
                        CameraDescription description, std::unique_ptr<MetavisionDevice> device);

  void BeginStream();  // or waits for its time, or reopens a lost camera
  absl::Status OpenAgain();
  void Lose(const absl::Status& why);
  void EndStream();
  bool WaitUntil(SteadyTime deadline);  // false: stopped

  void TakeBytes(std::span<const uint8_t> bytes);
  EventChunk TakePiece();
  void FollowClock();
  void WarnOfSilence();

  const MetavisionSourceOptions options_;
  const MetavisionRequest request_;  // with the serial number of the camera that was opened
  const CameraDescription description_;
  std::unique_ptr<MetavisionDevice> device_;  // none: lost
  MetavisionIdentity identity_;

  std::mutex mutex_;
  std::condition_variable stop_changed_;
  std::atomic<bool> stopped_ = true;

  bool streaming_ = false;
  SteadyTime begins_at_;     // not before
  SteadyTime silent_since_;  // no byte since the stream began
  bool silence_is_logged_ = true;
  bool clock_began_anew_ = false;  // passed on with the next piece
  std::chrono::milliseconds pause_{0};
  std::string logged_reason_;  // why a lost camera cannot be reopened
  std::optional<ByteAligner> joiner_;
  std::span<const uint8_t> pending_;  // whole words not yet passed on
  uint64_t byte_offset_ = 0;          // of pending_ in the capture
  std::optional<EventTimer> timer_;
  std::optional<FrameArrival> arrival_;  // of the last piece
  int64_t last_time_us_ = 0;
  DeviceClock clock_;
  RefusalCounter refused_;
};

}  // namespace rigcal::agent

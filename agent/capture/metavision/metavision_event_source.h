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
// Time: the sensor's clock begins with each Start, at zero, or for a secondary camera with that of
// its primary. It is compared with the host's by when events arrive, to about 5 ms. A camera that
// is unplugged is looked for again, with growing pauses, until Stop; its clock then begins anew
// (EventChunk::clock_began_anew). Refused counts camera_lost. What the SDK throws away because
// nobody fetched it in time it does not tell.
class MetavisionEventSource : public EventSource {
 public:
  // As OpenMetavisionDevice; NOT_FOUND or INVALID_ARGUMENT too for the file of settings and the
  // calibration; FAILED_PRECONDITION where the sensor is not as large as that says.
  static absl::StatusOr<std::unique_ptr<MetavisionEventSource>> Create(
      MetavisionSourceOptions options);
  ~MetavisionEventSource() override;

  const CameraDescription& description() const override { return description_; }
  absl::Status Start(const Target& target) override;
  absl::StatusOr<std::optional<EventChunk>> Next() override;
  void Stop() override;
  std::vector<ClockSample> TakeClockSamples() override { return clock_.Take(); }
  std::vector<Refusal> Refused() const override { return refused_.List(); }

  // How long to wait before a camera that was lost is looked for once more.
  static std::chrono::milliseconds NextPause(std::chrono::milliseconds pause,
                                             const MetavisionSourceOptions& options);

 private:
  using SteadyTime = std::chrono::steady_clock::time_point;

  MetavisionEventSource(MetavisionSourceOptions options, MetavisionRequest request,
                        CameraDescription description, std::unique_ptr<MetavisionDevice> device);

  void BeginStream();  // or waits for the time to, or looks for a lost camera
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
  bool silence_is_told_ = true;
  bool clock_began_anew_ = false;  // tell it with the next piece
  std::chrono::milliseconds pause_{0};
  std::string told_reason_;  // why a lost camera is not back yet
  std::optional<ByteAligner> joiner_;
  std::span<const uint8_t> pending_;  // whole words that are not told yet
  uint64_t byte_offset_ = 0;          // of pending_ in the capture
  std::optional<EventTimer> timer_;
  std::optional<FrameArrival> arrival_;  // of the piece that was told last
  int64_t last_time_us_ = 0;
  DeviceClock clock_;
  RefusalCounter refused_;
};

}  // namespace rigcal::agent

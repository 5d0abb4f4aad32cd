// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <atomic>
#include <memory>
#include <string>

#include "absl/status/statusor.h"
#include "agent/capture/genicam/aravis_objects.h"
#include "agent/capture/genicam/aravis_options.h"
#include "common/camera/camera_description.h"
#include "common/camera/intrinsics.h"
#include "common/time/clock.h"

namespace rigcal::agent {

// One connection to a camera: found, under our control, and set. Not safe for several threads,
// except control_lost.
class AravisCamera {
 public:
  // NOT_FOUND: no such camera; lists the cameras found. FAILED_PRECONDITION: another program
  // controls it; names the host if known. INVALID_ARGUMENT: the camera does not take a setting.
  // UNAVAILABLE: it does not answer.
  // `list_others`: search for other cameras if it does not answer, which takes up to a second.
  static absl::StatusOr<std::unique_ptr<AravisCamera>> Open(const AravisSourceOptions& options,
                                                            bool list_others);
  ~AravisCamera();
  AravisCamera(const AravisCamera&) = delete;
  AravisCamera& operator=(const AravisCamera&) = delete;

  ArvCamera* get() const { return camera_.get(); }
  bool is_gige() const { return arv_camera_is_gv_device(camera_.get()) != 0; }
  const std::string& device_id() const { return device_id_; }  // vendor and serial number
  const CameraSettings& settings() const { return settings_; }
  ImageSize image_size_px() const { return image_size_px_; }
  const std::string& ptp_clock_id() const { return ptp_clock_id_; }  // empty: its own clock
  bool exposure_is_automatic() const { return exposure_is_automatic_; }
  // It was unplugged, or another program took control. Any thread may call.
  bool control_lost() const { return control_lost_; }

  // Bytes of one frame.
  absl::StatusOr<uint32_t> PayloadBytes() const;
  bool CanReadClock() const { return latch_command_ != nullptr; }
  // Latches the camera's clock between two readings of the host's. Only if it can be read.
  absl::StatusOr<ClockSample> ReadClock() const;

 private:
  AravisCamera() = default;
  absl::Status Connect(const AravisSourceOptions& options, bool list_others);
  absl::Status Configure(const AravisSourceOptions& options);
  void FindClock();
  static void OnControlLost(ArvDevice* device, void* self);

  std::atomic<bool> control_lost_ = false;
  GObjectPtr<ArvCamera> camera_;
  unsigned long handler_ = 0;
  std::string device_id_;
  CameraSettings settings_;
  ImageSize image_size_px_;
  std::string ptp_clock_id_;
  bool exposure_is_automatic_ = false;
  const char* latch_command_ = nullptr;
  const char* latch_value_ = nullptr;
  double ns_per_tick_ = 1;
};

}  // namespace rigcal::agent

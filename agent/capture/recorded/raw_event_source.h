// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <atomic>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "agent/capture/event_timer.h"
#include "agent/capture/pacer.h"
#include "agent/event/event_decoder.h"
#include "agent/event/event_source.h"
#include "agent/event_files/event_file.h"
#include "common/options/option_table.h"

namespace rigcal::agent {

struct RawSourceOptions {
  std::string camera;                      // name within the rig
  std::string path;                        // RAW (EVT 2.0, 2.1, 3.0), HDF5 or CSV
  std::string calibration_path;            // OpenCV YAML; empty: none
  std::optional<SensorGeometry> geometry;  // if the file has none; 1 to 2048 each way
  std::string clock_id;    // of the sensor; sensors on one sync cable share one; empty: the camera
  PlainFileOptions plain;  // how an HDF5 or CSV file is read
  double speed = 1;        // multiple of the recorded pace, > 0; kMaxSpeed: no waiting

  // INVALID_ARGUMENT with every fault.
  absl::Status Validate() const;
};

void AddOptions(RawSourceOptions* options, OptionTable* table);

// The events of a RAW, HDF5 or CSV file, in order, in pieces of some milliseconds. The decoder
// counts damage.
class RawEventSource : public EventSource {
 public:
  // NOT_FOUND, FAILED_PRECONDITION: the file does not exist or cannot be read. INVALID_ARGUMENT:
  // not a file of events (OpenEventFile), no geometry, or one that contradicts the options or the
  // calibration. Each names the camera, the file and what to do.
  static absl::StatusOr<std::unique_ptr<RawEventSource>> Create(RawSourceOptions options);

  const CameraDescription& description() const override { return description_; }
  absl::Status Start(const Target& target) override;
  absl::StatusOr<std::optional<EventChunk>> Next() override;
  void Stop() override;
  std::string PlaceOf(uint64_t byte_offset) const override;
  std::vector<Refusal> Refused() const override;

 private:
  RawEventSource(RawSourceOptions options, CameraDescription description);
  absl::StatusOr<std::optional<EventChunk>> NextPaced();

  const RawSourceOptions options_;
  const CameraDescription description_;
  Pacer pacer_;
  std::atomic<bool> stopped_ = true;
  std::unique_ptr<EventFile> file_;
  std::optional<EventTimer> timer_;  // follows the time of the file
  std::vector<uint8_t> piece_;
};

}  // namespace rigcal::agent

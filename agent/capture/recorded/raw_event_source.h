// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "agent/capture/event_timer.h"
#include "agent/capture/paced_source.h"
#include "agent/capture/recorded/recording_options.h"
#include "agent/event/event_source.h"
#include "agent/event_files/event_file.h"

namespace rigcal::agent {

struct RawSourceOptions;
void AddOptions(RawSourceOptions* options, OptionTable* table);

// RAW (EVT 2.0, 2.1, 3.0), HDF5 or CSV.
struct RawSourceOptions : RecordingOptions {
  std::optional<SensorGeometry> geometry;  // if the file has none; 1 to 2048 each way
  std::string clock_id;    // of the sensor; sensors on one sync cable share one; empty: the camera
  EventFileOptions plain;  // how an HDF5 or CSV file is read

  // INVALID_ARGUMENT with every fault.
  absl::Status Validate() const { return ValidateRecording(*this); }
};

// The events of a RAW, HDF5 or CSV file, in order, in pieces of some milliseconds. The decoder
// counts damage.
class RawEventSource : public PacedSource<EventSource, RawSourceOptions> {
 public:
  using PacedSource::PacedSource;
  // NOT_FOUND, FAILED_PRECONDITION: the file does not exist or cannot be read. INVALID_ARGUMENT:
  // not a file of events (OpenEventFile), no geometry, or one that contradicts the options or the
  // calibration. Each names the camera, the file and what to do.
  static absl::StatusOr<std::unique_ptr<RawEventSource>> Create(RawSourceOptions options);

  absl::Status Start(const Target& target) override;
  absl::StatusOr<std::optional<EventChunk>> Next() override;
  std::string PlaceOf(uint64_t byte_offset) const override;
  std::vector<Refusal> Refused() const override;

 private:
  std::unique_ptr<EventFile> file_;
  std::optional<EventTimer> timer_;  // follows the time of the file
  std::vector<uint8_t> piece_;
};

}  // namespace rigcal::agent

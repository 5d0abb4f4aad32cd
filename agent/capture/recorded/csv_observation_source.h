// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "agent/capture/observation_source.h"
#include "agent/capture/paced_source.h"
#include "agent/capture/recorded/recording_options.h"
#include "common/status/refusal.h"
#include "common/target/csv_layout.h"
#include "common/text/line_reader.h"
#include "common/time/clock.h"

namespace rigcal::agent {

// Lines `timestamp_ns;x0;y0;x1;y1;...`, or another table of markers (csv_layout.h).
struct CsvSourceOptions : RecordingOptions {
  double sigma_px = 0.5;  // one sigma of each coordinate of every centre, > 0
  // The kind of the centres; `rigcal-agent detect` writes sphere centres if it has the camera's
  // intrinsics and the spheres' diameter.
  CentreKind centre_kind = CentreKind::kImageBlob;
  double exposure_s = 0;  // of every frame; 0: not known
  StampMoment stamps = StampMoment::kMiddle;

  // INVALID_ARGUMENT with every fault.
  absl::Status Validate() const;
};

void AddOptions(CsvSourceOptions* options, OptionTable* table);

// A recorded camera: marker centres from a CSV file, in the order of its lines. The camera is its
// own clock, of time base "recording". A bad line is refused with its reason, file and line number,
// and skipped. A timestamp before the previous one begins a new clock epoch and is logged; equal
// ones are passed on.
class CsvObservationSource : public PacedSource<ObservationSource, CsvSourceOptions> {
 public:
  using PacedSource::PacedSource;
  // NOT_FOUND, INVALID_ARGUMENT, ...: the CSV file or the calibration is missing or malformed; the
  // message names camera, file and what to do.
  static absl::StatusOr<std::unique_ptr<CsvObservationSource>> Create(CsvSourceOptions options);

  // INVALID_ARGUMENT: the recording has another number of markers than `target`.
  absl::Status Start(const Target& target) override;
  absl::StatusOr<std::optional<Observation>> Next() override;
  std::vector<Refusal> Refused() const override { return refused_.List(); }

 private:
  void Refuse(RefusalReason reason, uint64_t line, const std::string& what);
  void AssignClockEpoch(uint64_t line, Observation* observation);

  std::optional<LineReader> reader_;
  CsvLayout layout_;
  int marker_count_ = 0;
  bool has_content_ = false;  // a line that is not blank has been read
  ClockEpochCounter clock_epochs_;
  uint32_t clock_epoch_ = 0;
  int64_t last_time_ns_ = 0;
  RefusalCounter refused_;
};

}  // namespace rigcal::agent

// SPDX-License-Identifier: Apache-2.0
#include "agent/capture/recorded/csv_observation_source.h"

#include <spdlog/spdlog.h>

#include <utility>

#include "absl/strings/str_cat.h"
#include "agent/capture/camera_status.h"
#include "common/status/status_macros.h"
#include "common/target/csv_line.h"

namespace rigcal::agent {
namespace {

bool IsBlank(std::string_view text) { return text.find_first_not_of(" \t\r") == text.npos; }

}  // namespace

absl::Status CsvSourceOptions::Validate() const {
  FaultList faults;
  if (calibration_path.empty()) faults.Add("the path of the calibration is empty");
  CheckStamps(stamps, exposure_s, &faults);
  return ValidateRecording(*this, std::move(faults));
}

absl::StatusOr<std::unique_ptr<CsvObservationSource>> CsvObservationSource::Create(
    CsvSourceOptions options) {
  RIGCAL_RETURN_IF_ERROR(options.Validate());
  RIGCAL_RETURN_IF_ERROR(OfCamera(options.camera, LineReader::Open(options.path).status()));
  RIGCAL_ASSIGN_OR_RETURN(CameraDescription description,
                          DescribeRecording("csv", options, SensorKind::kFrame));
  RIGCAL_RETURN_IF_ERROR(description.Validate());
  return std::make_unique<CsvObservationSource>(std::move(options), std::move(description));
}

absl::Status CsvObservationSource::Start(const Target& target) {
  refused_ = {};
  reader_.reset();
  absl::StatusOr<CsvLayout> layout = FindCsvLayoutOfFile(options_.path);
  RIGCAL_RETURN_IF_ERROR(OfCamera(options_.camera, layout.status()));
  layout_ = *std::move(layout);
  const auto marker_count = static_cast<size_t>(target.marker_count());
  if (layout_.markers.empty()) {
    // No line is valid: every one will be refused by itself.
    layout_ = CsvLayout::Of(target.marker_count());
  } else if (layout_.markers.size() != marker_count) {
    return absl::InvalidArgumentError(absl::StrCat(
        "camera ", options_.camera, ": ", options_.path, " shows ", layout_.markers.size(),
        " markers (", layout_.columns, " fields), but the session's target has ", marker_count,
        "; start a session whose target is the one that was recorded"));
  }
  RIGCAL_ASSIGN_OR_RETURN(reader_, LineReader::Open(options_.path));
  marker_count_ = target.marker_count();
  has_content_ = false;
  clock_epochs_ = {};
  clock_epoch_ = 0;
  pacer_.Start();
  return absl::OkStatus();
}

absl::StatusOr<std::optional<Observation>> CsvObservationSource::Next() {
  while (reader_) {
    RIGCAL_ASSIGN_OR_RETURN(const std::optional<LineReader::Line> line, reader_->Next());
    if (!line) {
      if (!has_content_) {
        Refuse(RefusalReason::kCsvEmpty, 0,
               absl::StrCat("the file holds no line, or only empty ones; expected lines like ",
                            CsvLineExample(marker_count_)));
      }
      reader_.reset();
      break;
    }
    if (IsBlank(line->text)) continue;
    const bool is_header = layout_.has_header && !has_content_;
    has_content_ = true;
    if (is_header) continue;
    if (line->too_long) {
      Refuse(RefusalReason::kCsvLineTooLong, line->number,
             absl::StrCat("longer than ", LineReader::kMaxLineBytes, " bytes"));
      continue;
    }
    Observation observation;
    if (const auto fault = ParseCsvLine(line->text, layout_, options_.sigma_px, &observation)) {
      Refuse(fault->reason, line->number, fault->what);
      continue;
    }
    for (MarkerObservation& marker : observation.markers) {
      marker.centre_kind = options_.centre_kind;
    }
    observation.time_ns =
        MiddleOfExposureNs(observation.time_ns, options_.stamps, options_.exposure_s);
    AssignClockEpoch(line->number, &observation);
    if (!pacer_.Wait(observation.time_ns)) break;
    return observation;
  }
  return std::nullopt;
}

void CsvObservationSource::AssignClockEpoch(uint64_t line, Observation* observation) {
  observation->clock_epoch = clock_epochs_.EpochOf(observation->time_ns);
  if (observation->clock_epoch != clock_epoch_) {
    clock_epoch_ = observation->clock_epoch;
    spdlog::warn(
        "camera {}: {}:{}: the clock steps back from {} ns to {} ns; a new clock epoch {} begins: "
        "stored, but used only if its own time offset can be found",
        options_.camera, options_.path, line, last_time_ns_, observation->time_ns, clock_epoch_);
  }
  last_time_ns_ = observation->time_ns;
}

void CsvObservationSource::Refuse(RefusalReason reason, uint64_t line, const std::string& what) {
  const std::string place = line == 0 ? "" : absl::StrCat(":", line);
  const std::string example = absl::StrCat(options_.path, place, ": ", what);
  spdlog::debug("camera {}: {}: {}", options_.camera, NameOf(reason), example);
  refused_.Add("", reason, 1, example);
}

}  // namespace rigcal::agent

// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "absl/status/statusor.h"
#include "common/export/archive.h"
#include "common/export/rig_model.h"
#include "rigcal/v1/calibration.pb.h"

namespace rigcal {

struct ExportOptions {
  // The most by which a lens that a format can say may show a point of the image wrong where it
  // cannot say ours.
  double max_error_px = 0.5;
  UpAxis up = UpAxis::kAsItIs;
};

// A lens that is written as another one.
struct LensNote {
  std::string camera;
  double error_px = 0;  // the largest one over the image
};

// A format of exported calibrations. A new one is a row of the table in calibration_export.cc, and
// then known to the server, the dashboard and the command line.
struct CalibrationExportFormat {
  const char* name;  // "opencv"
  const char* help;  // what it writes
  // The type of each file, as in HTTP.
  const char* content_type;
  // It also holds lenses without poses.
  bool lenses_alone;
  // FAILED_PRECONDITION: the calibration has no result, or lacks what the format needs. DATA_LOSS:
  // a camera of it cannot be written; it is named.
  absl::StatusOr<std::vector<ExportFile>> (*make_with)(const rigcal::v1::Calibration& calibration,
                                                       const ExportOptions& options,
                                                       std::vector<LensNote>* notes);

  // `notes`: the cameras whose lens had to be refitted.
  absl::StatusOr<std::vector<ExportFile>> make(const rigcal::v1::Calibration& calibration,
                                               const ExportOptions& options = {},
                                               std::vector<LensNote>* notes = nullptr) const {
    return make_with(calibration, options, notes);
  }
};
std::span<const CalibrationExportFormat> CalibrationExportFormats();

// INVALID_ARGUMENT: there is none of that name; the message lists them.
absl::StatusOr<const CalibrationExportFormat*> FindCalibrationExportFormat(std::string_view name);

// A file for somebody who downloads it.
struct ExportDownload {
  std::string file_name;
  std::string content_type;
  std::string content;
};

// In one file: several are packed into a ZIP archive. `variant` is put behind the format's name in
// the name of the file. The errors are those of the format.
absl::StatusOr<ExportDownload> MakeDownload(const CalibrationExportFormat& format,
                                            const rigcal::v1::Calibration& calibration,
                                            std::string_view variant = {},
                                            const ExportOptions& options = {});

// FAILED_PRECONDITION unless it has succeeded.
absl::Status CheckHasResult(const rigcal::v1::Calibration& calibration);

}  // namespace rigcal

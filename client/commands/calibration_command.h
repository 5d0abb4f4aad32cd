// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "client/commands/command_context.h"
#include "client/net/paging.h"
#include "common/export/calibration_export.h"
#include "rigcal/v1/calibration_service.pb.h"

namespace rigcal::client {

struct CalibrationExportOptions {
  std::string id;
  std::string format;        // a name of CalibrationExportFormats
  std::string output;        // folder, made where missing; "-" (JSON only): standard output
  bool undistorted = false;  // for images without lens distortion
  ExportOptions options;
  bool force = false;  // replace files that are there
};

struct CalibrationImportOptions {
  std::string path;    // file or folder of another program
  std::string format;  // a name of CalibrationExportFormats
  std::string output;  // folder, made where missing
  bool undistorted = false;
  ExportOptions options;
  bool force = false;  // replace files that are there
  std::string units;  // of the file's lengths, a name of LengthUnits; empty: as its format has them
};

// Ids, or paths of other programs' files (client/results/calibration_import.h).
struct CalibrationPair {
  std::string a;
  std::string b;
};

// `rigcal calibration ...`. Each returns the exit code.

ExitCode ListCalibrations(const ListOptions& options, CommandContext& context);
struct CalibrationGetOptions {
  std::string id;
  bool all = false;  // every camera, however many there are
};
ExitCode GetCalibration(const CalibrationGetOptions& options, CommandContext& context);
ExitCode CancelCalibration(const std::string& id, CommandContext& context);
struct CalibrationDeleteOptions {
  std::string id;
  bool yes = false;  // without asking
};
ExitCode DeleteCalibration(const CalibrationDeleteOptions& options, CommandContext& context);
// Prints the files it wrote.
ExitCode ExportCalibration(const CalibrationExportOptions& options, CommandContext& context);
// Reads another program's file and writes it in a format of ours. Prints the files it wrote.
// kIncomplete where a camera of the file is not in them, or may be misread; each is named.
ExitCode ConvertCalibration(const CalibrationImportOptions& options, CommandContext& context);
// Prints how B differs from A.
ExitCode CompareCalibrations(const CalibrationPair& ids, CommandContext& context);

struct AccuracyCommandOptions {
  std::string id;
  std::vector<std::string> points;  // "x,y,z" in the rig frame, metres
  double grid_step_m = 0;           // 0: the server's choice without points, none with points
  double sigma_px = 0;              // 0: the server's default
};

// Reads "x,y,z". INVALID_ARGUMENT quotes the text and shows a right one.
absl::StatusOr<rigcal::v1::Vector3> ParsePoint(const std::string& text);

// The points asked for, and a summary over them and the grid, in millimetres.
std::string FormatAccuracy(const rigcal::v1::GetAccuracyResponse& accuracy,
                           const rigcal::v1::Calibration& calibration);

// `rigcal calibration accuracy`: prints the expected triangulation error. Returns the exit code.
ExitCode ShowAccuracy(const AccuracyCommandOptions& options, CommandContext& context);

struct ResidualCommandOptions {
  std::string id;
  std::string camera;  // empty: all
};

// `rigcal calibration explain`: which part of the data holds which parameter. Returns the exit
// code.
ExitCode ExplainCalibration(const std::string& id, CommandContext& context);

// `rigcal calibration residuals`: prints them camera by camera. Returns the exit code.
ExitCode ShowResiduals(const ResidualCommandOptions& options, CommandContext& context);

}  // namespace rigcal::client

// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include "client/commands/command_context.h"

namespace rigcal::client {

enum class ExportFormat { kOpenCv, kJson };

struct CalibrationExportOptions {
  std::string id;
  ExportFormat format = ExportFormat::kOpenCv;
  std::string output;  // folder, made where missing; "-" (JSON only): standard output
};

// `rigcal calibration ...`. Each returns the exit code.

// `rig` empty: every rig.
ExitCode ListCalibrations(const std::string& rig, CommandContext& context);
ExitCode GetCalibration(const std::string& id, CommandContext& context);
ExitCode CancelCalibration(const std::string& id, CommandContext& context);
// Prints the files it wrote.
ExitCode ExportCalibration(const CalibrationExportOptions& options, CommandContext& context);
// Prints how B differs from A.
ExitCode CompareCalibrations(const std::string& a, const std::string& b, CommandContext& context);

}  // namespace rigcal::client

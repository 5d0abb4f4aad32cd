// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include "client/commands/command_context.h"
#include "client/commands/list_options.h"

namespace rigcal::client {

enum class ExportFormat { kOpenCv, kJson };

struct CalibrationExportOptions {
  std::string id;
  ExportFormat format = ExportFormat::kOpenCv;
  std::string output;  // folder, made where missing; "-" (JSON only): standard output
};

// `rigcal calibration ...`. Each returns the exit code.

ExitCode ListCalibrations(const ListOptions& options, CommandContext& context);
ExitCode GetCalibration(const std::string& id, CommandContext& context);
ExitCode CancelCalibration(const std::string& id, CommandContext& context);
ExitCode DeleteCalibration(const std::string& id, CommandContext& context);
// Prints the files it wrote.
ExitCode ExportCalibration(const CalibrationExportOptions& options, CommandContext& context);
// Prints how B differs from A.
ExitCode CompareCalibrations(const std::string& a, const std::string& b, CommandContext& context);

}  // namespace rigcal::client

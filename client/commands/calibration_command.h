// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include "client/commands/command_context.h"
#include "client/net/paging.h"

namespace rigcal::client {

struct CalibrationExportOptions {
  std::string id;
  std::string format;  // a name of ExportFormats
  std::string output;  // folder, made where missing; "-" (JSON only): standard output
};

struct CalibrationPair {
  std::string a;
  std::string b;
};

// `rigcal calibration ...`. Each returns the exit code.

ExitCode ListCalibrations(const ListOptions& options, CommandContext& context);
ExitCode GetCalibration(const std::string& id, CommandContext& context);
ExitCode CancelCalibration(const std::string& id, CommandContext& context);
ExitCode DeleteCalibration(const std::string& id, CommandContext& context);
// Prints the files it wrote.
ExitCode ExportCalibration(const CalibrationExportOptions& options, CommandContext& context);
// Prints how B differs from A.
ExitCode CompareCalibrations(const CalibrationPair& ids, CommandContext& context);

}  // namespace rigcal::client

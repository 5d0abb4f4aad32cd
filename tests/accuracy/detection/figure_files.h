// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>
#include <string>

#include "absl/status/status.h"
#include "tests/accuracy/experiment.h"

namespace rigcal::accuracy {

// --csv and --png.
void AddFigureOptions(OptionList* options, std::string* csv_path, std::string* png_path);

// Writes a table and draws its figure, each if it has a path. Prints failures to the standard
// error; returns the exit code.
int WriteFigure(const std::string& csv, const std::string& csv_path, const std::string& png_path,
                const std::function<absl::Status(const std::string& path)>& draw);

}  // namespace rigcal::accuracy

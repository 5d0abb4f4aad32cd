// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "common/calibration/calibration.h"
#include "server/solve/calibrate.h"
#include "tests/accuracy/paper/paper_run.h"

namespace rigcal::accuracy {

// The paper's own recording: published figures beside two solves of ours. px, by camera.
struct PaperRealRow {
  std::string method;
  std::vector<double> mean_px, sd_px;  // sd_px is empty where it was not published
};
// Errors of the two solves.
absl::StatusOr<std::vector<PaperRealRow>> RunPaperRecording(const server::CalibrationInput& input);

// A line for each figure: table,condition,method,camera,unit,mean,standard_deviation,count. Three
// decimals of px and mm: what other compilers and CPUs change is beyond them.
std::string PaperCsv(const std::vector<PaperRow>& rows);
// SHA-256 of PaperCsv, in hexadecimal digits.
std::string PaperDigest(const std::vector<PaperRow>& rows);

// The tables as text for a terminal.
std::string PaperText(const PaperOptions& options, const std::vector<PaperRow>& rows,
                      const std::vector<PaperRealRow>& real);

// The tables as a page, each row with its command, with what is simulated and what is missing.
// `figure`: the path of what DrawPaper has drawn, as seen from the page; empty: none.
std::string PaperPage(const PaperOptions& options, const std::vector<PaperRow>& rows,
                      const std::vector<PaperRealRow>& real, const std::string& figure = "");

}  // namespace rigcal::accuracy

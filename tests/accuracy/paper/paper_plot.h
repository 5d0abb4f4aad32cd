// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

#include "absl/status/status.h"
#include "tests/accuracy/paper/paper_run.h"

namespace rigcal::accuracy {

// Error of the calibration alone in 3-D, mm, against seconds of waving: a curve for each row that
// has a course. As a PNG file. UNAVAILABLE: it cannot be written; FAILED_PRECONDITION: no row has a
// course.
absl::Status DrawPaper(const std::vector<PaperRow>& rows, const std::string& png_path);

}  // namespace rigcal::accuracy

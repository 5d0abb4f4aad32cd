// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <string>
#include <string_view>

#include "common/status/refusal_reason.h"
#include "common/target/observation.h"

namespace rigcal {

// Why a line was refused.
struct CsvLineFault {
  RefusalReason reason;
  std::string what;
};

// What a good line looks like, for messages.
std::string CsvLineExample(int marker_count);

// Number of ';'-separated fields; a line of n markers has 1 + 2 n.
int CsvFieldCount(std::string_view line);

// Reads `timestamp_ns;x0;y0;x1;y1;...` (pixels; -1;-1 = not seen) into `observation`: its time and
// markers, each visible one with covariance sigma_px^2 in both directions. The timestamp is a whole
// number of nanoseconds; a decimal point is accepted where only zeros follow. Blanks around a field
// are accepted. `clock_epoch` is left alone. With a fault, `observation` is unspecified.
std::optional<CsvLineFault> ParseCsvLine(std::string_view line, int marker_count, double sigma_px,
                                         Observation* observation);

}  // namespace rigcal

// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <string>
#include <string_view>

#include "common/status/refusal_reason.h"
#include "common/target/csv_layout.h"
#include "common/target/observation.h"

namespace rigcal {

// Why a line was refused.
struct CsvLineFault {
  RefusalReason reason;
  std::string what;
};

// What a good line looks like, for messages.
std::string CsvLineExample(int marker_count);

// Reads a row of a table of markers into `observation`: its time and markers, each visible one with
// covariance sigma_px^2 in both directions. A pair of -1;-1, of NaN or of two empty cells is a
// marker that was not seen. The stamp is a whole number in the layout's unit, nanoseconds where no
// header says otherwise; a decimal point or an exponent is accepted where the number is whole all
// the same. Blanks around a field are accepted. `clock_epoch` is left alone. With a fault,
// `observation` is unspecified.
std::optional<CsvLineFault> ParseCsvLine(std::string_view line, const CsvLayout& layout,
                                         double sigma_px, Observation* observation);
// Of `timestamp_ns;x0;y0;x1;y1;...`.
std::optional<CsvLineFault> ParseCsvLine(std::string_view line, int marker_count, double sigma_px,
                                         Observation* observation);

}  // namespace rigcal

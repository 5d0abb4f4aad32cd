// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

#include "common/target/csv_layout.h"

namespace rigcal {

// Why rows of a table that has no header are not those of moving markers as this layout reads them,
// and what to do; empty: nothing is wrong with them. Looked at are numbers with a decimal comma
// between commas, all x before all y, and columns that never change.
std::string ImplausibleColumns(const CsvLayout& layout, const std::vector<std::string>& lines);

}  // namespace rigcal

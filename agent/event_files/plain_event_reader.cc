// SPDX-License-Identifier: Apache-2.0
#include "agent/event_files/plain_event_reader.h"

#include <utility>

#include "agent/event_files/csv_event_line.h"

namespace rigcal::agent {

std::string TimeUnitName(TimeUnit unit) {
  switch (unit) {
    case TimeUnit::kSeconds:
      return "seconds";
    case TimeUnit::kMicroseconds:
      return "microseconds";
    case TimeUnit::kNanoseconds:
      return "nanoseconds";
    case TimeUnit::kAuto:
      break;
  }
  return "an unknown unit";
}

void AddOptions(PlainFileOptions* options, OptionTable* table) {
  table->AddChoice("time", &options->time_unit,
                   std::vector<std::pair<std::string, TimeUnit>>{{"auto", TimeUnit::kAuto},
                                                                 {"s", TimeUnit::kSeconds},
                                                                 {"us", TimeUnit::kMicroseconds},
                                                                 {"ns", TimeUnit::kNanoseconds}},
                   "unit of times in CSV or HDF5; auto: fractions are seconds, whole numbers "
                   "microseconds");
  const auto read = [columns = &options->columns](const std::string& text) {
    if (!ParseCsvEventOrder(text).ok()) {
      return absl::InvalidArgumentError("must be an order of x, y, p and t, such as txyp");
    }
    *columns = text;
    return absl::OkStatus();
  };
  table->Add("columns", "ORDER", "of CSV without a header line", read,
             [columns = &options->columns] { return *columns; });
}

}  // namespace rigcal::agent

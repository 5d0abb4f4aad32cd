// SPDX-License-Identifier: Apache-2.0
#include "agent/command/event_file_flags.h"

#include <utility>

#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_split.h"

namespace rigcal::agent {

void EventFileFlags::AddTo(CLI::App& command) {
  command.add_option("--geometry", geometry,
                     "WIDTHxHEIGHT of a sensor that the file does not tell");
  command
      .add_option("--time", time,
                  "What the times of CSV or HDF5 are: s, us, ns or auto: fractions are seconds, "
                  "whole numbers microseconds [auto]")
      ->check(CLI::IsMember({"s", "us", "ns", "auto"}));
  command.add_option("--columns", columns, "Order of a CSV file without a header line [xypt]");
}

absl::StatusOr<std::optional<SensorGeometry>> EventFileFlags::Geometry() const {
  if (geometry.empty()) return std::nullopt;
  const std::pair<std::string, std::string> sides =
      absl::StrSplit(geometry, absl::MaxSplits('x', 1));
  SensorGeometry read;
  if (absl::SimpleAtoi(sides.first, &read.width) && absl::SimpleAtoi(sides.second, &read.height) &&
      read.width >= 1 && read.width <= 2048 && read.height >= 1 && read.height <= 2048) {
    return read;
  }
  return absl::InvalidArgumentError(
      absl::StrCat("--geometry ", geometry, " is not WIDTHxHEIGHT, such as 1280x720"));
}

PlainFileOptions EventFileFlags::Plain() const {
  return {.time_unit = ParseTimeUnit(time).value_or(TimeUnit::kAuto), .columns = columns};
}

}  // namespace rigcal::agent

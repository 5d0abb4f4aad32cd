// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <CLI/CLI.hpp>
#include <optional>
#include <string>

#include "absl/status/statusor.h"
#include "agent/event/event_decoder.h"
#include "agent/event_files/plain_event_reader.h"

namespace rigcal::agent {

// What a subcommand is told about a file of events that does not say it itself.
struct EventFileFlags {
  std::string geometry;
  std::string time = "auto";
  std::string columns = "xypt";

  void AddTo(CLI::App& command);
  // INVALID_ARGUMENT quotes the flag.
  absl::StatusOr<std::optional<SensorGeometry>> Geometry() const;
  PlainFileOptions Plain() const;
};

}  // namespace rigcal::agent

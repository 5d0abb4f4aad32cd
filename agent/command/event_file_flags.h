// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <CLI/CLI.hpp>
#include <optional>

#include "agent/event_files/event_file.h"
#include "agent/event_files/sensor_geometry.h"
#include "common/options/option_table.h"

namespace rigcal::agent {

// How a file of events is to be read where it does not say so itself: --geometry, --time,
// --columns, --endianness.
class EventFileFlags {
 public:
  EventFileFlags();
  EventFileFlags(const EventFileFlags&) = delete;
  EventFileFlags& operator=(const EventFileFlags&) = delete;
  void AddTo(CLI::App& command);

  std::optional<SensorGeometry> geometry;
  EventFileOptions plain;

 private:
  OptionTable table_;
};

}  // namespace rigcal::agent

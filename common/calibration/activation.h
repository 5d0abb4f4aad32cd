// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <string>

namespace rigcal {

// A calibration became the active one of its rig.
struct Activation {
  std::string rig;
  uint32_t number = 0;  // counts up within the rig, from 1
  std::string calibration_id;
  uint32_t version = 0;                 // of the calibration
  std::string previous_calibration_id;  // active before; empty: none
  int64_t utc_ns = 0;
  std::string operator_name;  // who; empty: the server's own PC
  std::string reason;
  bool forced = false;    // it was bad, or had other cameras
  bool rollback = false;  // by a rollback

  friend bool operator==(const Activation&, const Activation&) = default;
};

}  // namespace rigcal

// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <optional>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"

namespace rigcal {

// One [[camera]] of an agent's configuration. What is not set is as the source's own notation says.
struct CameraConfig {
  std::string source;              // `csv:PATH` or `sim:camera=INDEX`, as for --source
  std::string name;                // within the rig; empty: from the source
  std::string calibration;         // OpenCV YAML with the intrinsics; empty: from the source
  std::optional<double> speed;     // times the recorded pace; infinity for "max"
  std::optional<double> sigma_px;  // of each centre, pixels
  std::string where;               // "agent.toml:12", for messages
};

// What an agent's TOML file holds:
//
//   server = "127.0.0.1:7420"
//   rig = "rig"
//   agent_id = "pc-1"
//   state_dir = "/var/lib/rigcal-agent"
//   log_level = "info"
//   spool_limit_mb = 256
//
//   [[camera]]
//   name = "left"
//   source = "csv:left.csv"
//   calibration = "left.yaml"
//   speed = "max"            # or a factor
//   sigma = 0.5
//
// Every key may be left out, except a camera's source. Paths are relative to the file's folder.
struct AgentConfig {
  std::string server = "127.0.0.1:7420";  // HOST:PORT
  std::string rig = "rig";                // of all cameras
  std::string agent_id;                   // empty: as kept in the state directory
  std::string state_dir;                  // empty: the user's default
  std::string log_level = "info";         // trace, debug, info, warn, error, off
  size_t spool_limit_mb = 256;            // MiB of observations that are not acknowledged
  std::vector<CameraConfig> cameras;

  // Also what flags have put over the file: INVALID_ARGUMENT with every fault.
  absl::Status Validate() const;
};

// NOT_FOUND: no such file. INVALID_ARGUMENT: every unknown key and every bad value at once, each
// with file and line.
absl::StatusOr<AgentConfig> ReadAgentConfig(const std::string& path);

}  // namespace rigcal

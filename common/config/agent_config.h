// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"

namespace rigcal {

// What a source can begin with.
struct SourceKindName {
  std::string_view prefix;
  bool is_path = false;  // what follows is a path, up to the first ';'
};
inline constexpr std::array kSourceKindNames = {
    SourceKindName{"csv:", true},   SourceKindName{"sim:"},    SourceKindName{"images:", true},
    SourceKindName{"video:", true}, SourceKindName{"aravis:"}, SourceKindName{"raw:", true},
    SourceKindName{"metavision:"},
};
// "csv:, sim:, ...": for messages.
std::string ListOfSourceKinds();

// One `key=value` for a source, as text whatever its type was.
struct SourceOption {
  std::string key;
  std::string value;
  std::string where;  // "agent.toml:12", for messages; empty: typed behind --source

  friend bool operator==(const SourceOption&, const SourceOption&) = default;
};

// One [[camera]] of an agent's configuration. What is not set is as the source's own notation says.
struct CameraConfig {
  std::string source;              // `csv:PATH`, `sim:camera=INDEX`, ..., as for --source
  std::string name;                // within the rig; empty: from the source
  std::string calibration;         // OpenCV YAML with the intrinsics, or "none"; empty: from the
                                   // source
  std::optional<double> speed;     // times the recorded pace; infinity for "max"
  std::optional<double> sigma_px;  // of each centre, pixels
  // The tables [camera.settings] and [camera.detector]. Which keys there are is the source's to
  // say: making it refuses the others with their file and line.
  std::vector<SourceOption> options;
  std::string where;  // "agent.toml:12", for messages
};

// [preview]: pictures for people, with what the detector sees drawn in.
struct PreviewConfig {
  bool enabled = false;    // pictures leave the PC only where somebody allowed it
  double max_rate_hz = 1;  // per camera, above 0 to 10
  int64_t max_kb = 256;    // KiB of one picture, 8 to 1024
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
//   [preview]
//   enabled = true
//   max_rate_hz = 1           # of each camera
//   max_kb = 256              # of one picture
//
//   [[camera]]
//   name = "left"
//   source = "csv:left.csv"
//   calibration = "left.yaml"
//   speed = "max"            # or a factor
//   sigma = 0.5
//
//   [[camera]]
//   source = "aravis:192.168.1.5"
//   [camera.settings]         # of the camera itself
//   exposure = 0.004          # s
//   [camera.detector]         # how the wand is found in its pictures
//   hue_min = 345             # degrees
//   mask = "left_mask.png"
//
// deploy/agent.toml shows every key of the two tables. Every key may be left out, except a camera's
// source. Paths are relative to the file's folder.
struct AgentConfig {
  std::string server = "127.0.0.1:7420";  // HOST:PORT
  std::string rig = "rig";                // of all cameras
  std::string agent_id;                   // empty: as kept in the state directory
  std::string state_dir;                  // empty: the user's default
  std::string log_level = "info";         // trace, debug, info, warn, error, off
  size_t spool_limit_mb = 256;            // MiB of observations that are not acknowledged
  PreviewConfig preview;
  std::vector<CameraConfig> cameras;

  // Also what flags have put over the file: INVALID_ARGUMENT with every fault.
  absl::Status Validate() const;
};

// NOT_FOUND: no such file. INVALID_ARGUMENT: every unknown key and every bad value at once, each
// with file and line.
absl::StatusOr<AgentConfig> ReadAgentConfig(const std::string& path);

}  // namespace rigcal

// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "common/options/option_table.h"

namespace rigcal {

// One [[camera]] of an agent's configuration. Which options there are is the source's to say:
// making it refuses the others with their file and line.
struct CameraConfig {
  std::string source;  // `csv:PATH`, `sim:camera=INDEX`, ..., as for --source
  std::string name;    // within the rig; empty: from the source
  // calibration, speed and sigma, and the tables [camera.settings] and [camera.detector]; they
  // override the options behind `source`.
  std::vector<OptionText> options;
  std::string folder;  // of the file, which paths are relative to
  std::string where;   // "agent.toml:12", for messages
};

// [preview]: frames for people, with the detections drawn in.
struct PreviewConfig {
  bool enabled = false;    // frames leave the PC only where somebody allowed it
  double max_rate_hz = 1;  // per camera, above 0 to 10
  int64_t max_kb = 256;    // KiB of one JPEG, 8 to 1024
};

// [spool]: where observations wait for the server.
struct SpoolConfig {
  enum class Kind : uint8_t { kDisk, kMemory };
  enum class Full : uint8_t { kBlock, kDropOldest };
  enum class DurableOn : uint8_t { kServer, kStandby };

  Kind kind = Kind::kDisk;
  size_t limit_mb = 2048;                     // MiB of observations that are not acknowledged
  Full full = Full::kBlock;                   // of the disk; a full spool in memory always blocks
  int64_t sync_interval_ms = 200;             // 0: every observation before the next one is taken
  DurableOn durable_on = DurableOn::kServer;  // who must have rows before they are forgotten here
};

// An agent's TOML file. deploy/agent.toml shows every key; each may be left out, except a camera's
// source. Paths are relative to the file's folder.
struct AgentConfig {
  std::string server = "127.0.0.1:7420";  // HOST:PORT, or unix:/PATH
  std::string rig = "rig";                // of all cameras
  std::string agent_id;                   // empty: as kept in the state directory
  std::string state_dir;                  // empty: the user's default
  std::string log_level = "info";         // trace, debug, info, warn, error, off
  std::string log_format = "auto";        // auto, text, json, journal
  SpoolConfig spool;
  PreviewConfig preview;
  std::vector<CameraConfig> cameras;

  // After flags have overridden the file. INVALID_ARGUMENT with every fault.
  absl::Status Validate() const;
};

void AddOptions(AgentConfig* config, OptionTable* table);
void AddOptions(PreviewConfig* config, OptionTable* table);
void AddOptions(SpoolConfig* config, OptionTable* table);

// NOT_FOUND: no such file. INVALID_ARGUMENT: every unknown key and every bad value at once, each
// with file and line.
absl::StatusOr<AgentConfig> ReadAgentConfig(const std::string& path);

}  // namespace rigcal

// SPDX-License-Identifier: Apache-2.0
// The TOML files of agents, servers and event cameras. The first byte, modulo 3, says which.
#include <cstdint>
#include <string>
#include <string_view>

#include "common/config/agent_config.h"
#include "common/config/event_camera_config.h"
#include "common/config/server_config.h"
#include "tests/fuzz/fuzz_check.h"
#include "tests/fuzz/fuzz_folder.h"

namespace {

// A file that is refused says which, and why.
void CheckRefusal(const absl::Status& status, const std::string& path) {
  FUZZ_CHECK(status.code() == absl::StatusCode::kInvalidArgument);
  const std::string message(status.message());
  FUZZ_CHECK(message.find(path) != std::string::npos);
  FUZZ_CHECK(message.size() > path.size() + 3);
}

void CheckAgentConfig(const std::string& path) {
  const auto config = rigcal::ReadAgentConfig(path);
  if (!config.ok()) return CheckRefusal(config.status(), path);
  FUZZ_CHECK(config->preview.max_rate_hz > 0 && config->preview.max_rate_hz <= 10);
  FUZZ_CHECK(config->preview.max_kb >= 8 && config->preview.max_kb <= 1024);
  FUZZ_CHECK(config->spool.sync_interval_ms >= 0);
  for (const rigcal::CameraConfig& camera : config->cameras) {
    FUZZ_CHECK(!camera.source.empty());
    FUZZ_CHECK(camera.where.find(path) == 0);
  }
  const absl::Status valid = config->Validate();
  FUZZ_CHECK(valid.ok() || valid.code() == absl::StatusCode::kInvalidArgument);
}

void CheckServerConfig(const std::string& path) {
  const auto config = rigcal::ReadServerConfig(path);
  if (!config.ok()) return CheckRefusal(config.status(), path);
  const rigcal::ServerLimits& limits = config->limits;
  for (const uint32_t limit :
       {limits.max_agents, limits.max_cameras_per_agent, limits.max_sessions,
        limits.max_cameras_per_session, limits.max_watches, limits.max_readers,
        limits.max_queued_calibrations, limits.max_calibration_observations,
        limits.calibration_memory_mb, limits.ingest_queue_mb, limits.send_window_rows,
        limits.rpc_memory_mb, limits.max_connections, limits.max_connections_per_address,
        limits.disk_reserve_mb}) {
    FUZZ_CHECK(limit >= 1);
  }
  FUZZ_CHECK(config->listen.find(':') != std::string::npos);
}

void CheckEventCameraConfig(const std::string& path) {
  const auto config = rigcal::ReadEventCameraConfig(path);
  if (!config.ok()) return CheckRefusal(config.status(), path);
  if (config->event_rate_limit) {
    FUZZ_CHECK(*config->event_rate_limit >= 0 && *config->event_rate_limit <= UINT32_MAX);
  }
  FUZZ_CHECK(config->trigger_in.size() <= 3);
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  static const rigcal::testing::FuzzFolder folder;
  if (size == 0) return 0;
  const std::string path =
      folder.WriteFile("file.toml", {reinterpret_cast<const char*>(data) + 1, size - 1});
  switch (data[0] % 3) {
    case 0:
      CheckAgentConfig(path);
      break;
    case 1:
      CheckServerConfig(path);
      break;
    default:
      CheckEventCameraConfig(path);
  }
  return 0;
}

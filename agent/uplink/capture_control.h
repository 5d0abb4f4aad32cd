// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "agent/capture/preview/preview_worker.h"
#include "agent/stamp/camera_pipeline.h"

namespace rigcal::agent {

// The agent's cameras, each with its pipeline. Any thread may call.
class CaptureControl {
 public:
  // INVALID_ARGUMENT: no camera, or two of one name. `spool` outlives this object. `on_progress` as
  // for CameraPipeline.
  static absl::StatusOr<std::unique_ptr<CaptureControl>> Create(
      std::vector<std::unique_ptr<ObservationSource>> sources, MemorySpool* spool,
      std::function<void()> on_progress);

  void Start();
  void Shutdown();

  // By name.
  std::vector<CameraDescription> cameras() const;

  // As CameraPipeline::Begin. NOT_FOUND: the agent has no such camera.
  absl::Status Begin(const StreamKey& stream, const Target& target, uint32_t first_seq);
  void End(const std::string& session_id);
  void EndStream(const StreamKey& stream);
  void EndAll();
  // As CameraPipeline::Sessions; empty for an unknown camera.
  std::vector<std::string> SessionsOf(const std::string& camera) const;
  // The subject of a preview of this camera.
  PreviewSubject PreviewSubjectOf(const std::string& camera) const;
  // Of the captures that run.
  std::vector<CameraReport> RunningReports() const;

 private:
  CaptureControl() = default;
  std::map<std::string, std::unique_ptr<CameraPipeline>> pipelines_;
};

}  // namespace rigcal::agent

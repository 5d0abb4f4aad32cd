// SPDX-License-Identifier: Apache-2.0
#include "agent/uplink/capture_control.h"

#include <utility>

#include "absl/strings/str_cat.h"

namespace rigcal::agent {

absl::StatusOr<std::unique_ptr<CaptureControl>> CaptureControl::Create(
    std::vector<std::unique_ptr<ObservationSource>> sources, MemorySpool* spool,
    std::function<void()> on_progress) {
  if (sources.empty()) {
    return absl::InvalidArgumentError(
        "there is no camera: give --source, or [[camera]] in the configuration file");
  }
  std::unique_ptr<CaptureControl> control(new CaptureControl);
  for (std::unique_ptr<ObservationSource>& source : sources) {
    const std::string name = source->description().camera;
    const auto [where, is_new] = control->pipelines_.try_emplace(name, nullptr);
    if (!is_new) {
      return absl::InvalidArgumentError(
          absl::StrCat("two cameras are named ", name,
                       ": give each source a name, NAME=csv:... or NAME=sim:..."));
    }
    where->second = std::make_unique<CameraPipeline>(std::move(source), spool, on_progress);
  }
  return control;
}

void CaptureControl::Start() {
  for (const auto& [name, pipeline] : pipelines_) pipeline->Start();
}

void CaptureControl::Shutdown() {
  EndAll();
  for (const auto& [name, pipeline] : pipelines_) pipeline->Shutdown();
}

std::vector<CameraDescription> CaptureControl::cameras() const {
  std::vector<CameraDescription> cameras;
  for (const auto& [name, pipeline] : pipelines_) cameras.push_back(pipeline->description());
  return cameras;
}

absl::Status CaptureControl::Begin(const StreamKey& stream, const Target& target,
                                   uint32_t first_seq) {
  const auto found = pipelines_.find(stream.camera);
  if (found == pipelines_.end()) {
    return absl::NotFoundError(absl::StrCat("this agent has no camera ", stream.camera));
  }
  return found->second->Begin(stream, target, first_seq);
}

void CaptureControl::End(const std::string& session_id) {
  for (const auto& [name, pipeline] : pipelines_) pipeline->End(session_id);
}

void CaptureControl::EndStream(const StreamKey& stream) {
  const auto found = pipelines_.find(stream.camera);
  if (found != pipelines_.end()) found->second->End(stream.session_id);
}

void CaptureControl::EndAll() {
  for (const auto& [name, pipeline] : pipelines_) pipeline->EndAll();
}

std::vector<std::string> CaptureControl::SessionsOf(const std::string& camera) const {
  const auto found = pipelines_.find(camera);
  return found == pipelines_.end() ? std::vector<std::string>() : found->second->Sessions();
}

PreviewSubject CaptureControl::PreviewSubjectOf(const std::string& camera) const {
  const auto found = pipelines_.find(camera);
  if (found == pipelines_.end()) return {};
  return {.known = true,
          .capturing = !found->second->Sessions().empty(),
          .tap = found->second->preview_tap()};
}

std::vector<CameraReport> CaptureControl::RunningReports() const {
  std::vector<CameraReport> reports;
  for (const auto& [name, pipeline] : pipelines_) {
    if (auto report = pipeline->RunningReport()) reports.push_back(*std::move(report));
  }
  return reports;
}

}  // namespace rigcal::agent

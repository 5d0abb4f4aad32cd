// SPDX-License-Identifier: Apache-2.0
#include "client/tables/notable_cameras.h"

#include <algorithm>
#include <set>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "client/output/console.h"

namespace rigcal::client {
namespace {

constexpr size_t kNamesInSummary = 8;
constexpr size_t kListedOfGood = 4;

const std::string& CameraName(const v1::CalibratedCamera& camera) { return camera.camera(); }
const std::string& CameraName(const v1::SessionCamera& camera) {
  return camera.description().camera();
}

bool NeedsSomething(const v1::SessionCamera& camera, v1::Session::State state) {
  const v1::FrameCounts& frames = camera.frames();
  if (camera.refused_size() > 0 || frames.damaged() + frames.lost() > 0) return true;
  if (camera.ended()) return false;
  return state == v1::Session::STATE_FINISHED || !camera.connected();
}

// Of all cameras those of these names, or the first few; the line about it.
template <typename Cameras>
std::string Keep(const std::vector<std::string>& needing, Cameras* cameras) {
  const auto count = static_cast<size_t>(cameras->size());
  std::set<std::string> kept(needing.begin(), needing.end());
  for (size_t i = 0; needing.empty() && i < kListedOfGood; ++i) {
    kept.insert(CameraName((*cameras)[static_cast<int>(i)]));
  }
  const auto gone = std::remove_if(cameras->begin(), cameras->end(), [&](const auto& camera) {
    return !kept.contains(CameraName(camera));
  });
  cameras->erase(gone, cameras->end());
  return Printable(absl::StrCat("cameras            ", NeedsSummary(count, needing),
                                needing.empty()
                                    ? absl::StrCat("; listed are the first ", kept.size())
                                    : std::string("; listed are those"),
                                ", with --all every one\n"));
}

}  // namespace

std::string NeedsSummary(size_t count, const std::vector<std::string>& needing) {
  if (needing.empty()) return absl::StrCat("all ", count, " good");
  const size_t named = std::min(needing.size(), kNamesInSummary);
  return absl::StrCat(
      count - needing.size(), " good, ", needing.size(),
      needing.size() == 1 ? " needs something: " : " need something: ",
      absl::StrJoin(needing.begin(), needing.begin() + static_cast<std::ptrdiff_t>(named), ", "),
      named < needing.size() ? ", ..." : "");
}

std::vector<std::string> CamerasInNeed(const v1::Calibration& calibration) {
  std::set<std::string> named;
  for (const v1::Finding& finding : calibration.findings()) {
    if (!finding.candidate() && finding.severity() >= v1::FINDING_SEVERITY_WARNING) {
      named.insert(finding.camera());
    }
  }
  std::vector<std::string> names;
  for (const v1::CalibratedCamera& camera : calibration.cameras()) {
    if (named.contains(camera.camera())) names.push_back(camera.camera());
  }
  return names;
}

std::vector<std::string> CamerasInNeed(const v1::Session& session) {
  std::vector<std::string> names;
  for (const v1::SessionCamera& camera : session.cameras()) {
    if (NeedsSomething(camera, session.state())) names.push_back(CameraName(camera));
  }
  return names;
}

std::string KeepNotableCameras(v1::Calibration* calibration) {
  if (static_cast<size_t>(calibration->cameras_size()) <= kFewCameras) return "";
  const std::string line = Keep(CamerasInNeed(*calibration), calibration->mutable_cameras());
  auto* const findings = calibration->mutable_findings();
  findings->erase(std::remove_if(findings->begin(), findings->end(),
                                 [](const v1::Finding& finding) {
                                   return !finding.camera().empty() &&
                                          finding.severity() < v1::FINDING_SEVERITY_WARNING;
                                 }),
                  findings->end());
  return line;
}

std::string KeepNotableCameras(v1::Session* session) {
  if (static_cast<size_t>(session->cameras_size()) <= kFewCameras) return "";
  return Keep(CamerasInNeed(*session), session->mutable_cameras());
}

}  // namespace rigcal::client

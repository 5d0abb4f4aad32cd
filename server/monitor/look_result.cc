// SPDX-License-Identifier: Apache-2.0
#include "server/monitor/look_result.h"

#include <algorithm>
#include <cmath>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "common/statistics/robust_statistics.h"

namespace rigcal::server {
namespace {

// Smaller changes of a clock move no marker by a pixel.
constexpr double kLeastChangeS = 2e-4;
constexpr double kChangeSigmas = 6;
constexpr double kLeastTimeS = 1;  // for a rate

const CalibratedCamera* FindCamera(const CalibrationResult& result, const std::string& name) {
  const auto found = std::ranges::find(result.cameras, name, &CalibratedCamera::camera);
  return found == result.cameras.end() ? nullptr : &*found;
}

LiveMonitoredCamera& CameraOf(const std::string& name, LiveMonitor* monitor) {
  const auto found = std::ranges::find(monitor->cameras, name, &LiveMonitoredCamera::camera);
  if (found != monitor->cameras.end()) return *found;
  LiveMonitoredCamera& added = monitor->cameras.emplace_back();
  added.camera = name;
  return added;
}

}  // namespace

std::map<std::string, ClockChange> CompareClocks(const CalibrationResult& first,
                                                 const CalibrationResult& now) {
  std::map<std::string, ClockChange> changes;
  std::map<std::string, double> times_s;
  std::vector<double> all_s;
  for (const CalibratedCamera& before : first.cameras) {
    const CalibratedCamera* const after = FindCamera(now, before.camera);
    if (after == nullptr || after->clock_id != before.clock_id || !before.uncertainty ||
        !after->uncertainty || !before.time_offset_estimated || !after->time_offset_estimated) {
      continue;
    }
    const double time_s = after->time_epoch_s - before.time_epoch_s;
    ClockChange change;
    change.change_s =
        after->time_offset_s - before.time_offset_s - 1e-6 * before.time_rate_ppm * time_s;
    change.sigma_s =
        std::hypot(before.uncertainty->time_offset_sigma_s, after->uncertainty->time_offset_sigma_s,
                   1e-6 * before.uncertainty->time_rate_sigma_ppm * time_s);
    if (!(change.sigma_s > 0)) continue;
    all_s.push_back(change.change_s);
    times_s[before.camera] = time_s;
    changes[before.camera] = change;
  }
  if (all_s.size() < 2) return {};
  const double median_s = Median(all_s);
  for (auto& [camera, change] : changes) {
    change.change_s -= median_s;
    const double time_s = times_s[camera];
    if (time_s >= kLeastTimeS) change.ppm = 1e6 * change.change_s / time_s;
    const double size_s = std::abs(change.change_s);
    change.changed = size_s >= kLeastChangeS && size_s >= kChangeSigmas * change.sigma_s;
  }
  return changes;
}

std::set<std::string> MovedWithin(const CalibrationResult& look) {
  std::set<std::string> moved;
  for (const Finding& finding : look.findings) {
    if (finding.kind == FindingKind::kCameraMoved && !finding.candidate) {
      moved.insert(finding.camera);
    }
  }
  return moved;
}

void TakeVerdicts(const RigDifference& difference, const std::set<std::string>& moved_within,
                  int64_t utc_ns, LiveMonitor* monitor) {
  monitor->problem = difference.problem;
  monitor->all_moved = !difference.problem.empty();
  if (!moved_within.empty()) {
    monitor->problem =
        absl::StrCat(absl::StrJoin(moved_within, ", "), moved_within.size() == 1 ? " has" : " have",
                     " moved while the wand was waved; what comes after that says "
                     "by how much");
  }
  for (const CameraDifference& found : difference.cameras) {
    LiveMonitoredCamera& camera = CameraOf(found.camera, monitor);
    camera.time_offset_s = found.time_offset_s;
    camera.time_offset_sigma_s = found.time_offset_sigma_s;
    const bool within = moved_within.contains(found.camera);
    MonitorVerdict verdict = MonitorVerdict::kUnknown;
    if (within || found.verdict == CameraDifference::Verdict::kMoved) {
      verdict = MonitorVerdict::kMoved;
    } else if (found.verdict == CameraDifference::Verdict::kSame) {
      verdict = MonitorVerdict::kGood;
    }
    const bool dragged = !moved_within.empty() && !within && verdict == MonitorVerdict::kMoved;
    if (verdict == MonitorVerdict::kUnknown || dragged) continue;
    camera.verdict = verdict;
    camera.time_utc_ns = utc_ns;
    camera.translation_m = found.translation_m;
    camera.translation_sigma_m = found.translation_sigma_m;
    camera.rotation_rad = found.rotation_rad;
    camera.rotation_sigma_rad = found.rotation_sigma_rad;
    camera.centre_px = found.centre_px;
    camera.centre_sigma_px = found.centre_sigma_px;
    camera.sigmas = found.sigmas;
  }
}

}  // namespace rigcal::server

// SPDX-License-Identifier: Apache-2.0
#include "server/solve/bad_rows.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <optional>
#include <set>
#include <utility>

#include "absl/strings/str_format.h"
#include "common/statistics/robust_statistics.h"
#include "server/solve/bundle/marker_residual_px.h"
#include "server/solve/geometry/marker_rays.h"
#include "server/solve/geometry/triangulation.h"

namespace rigcal::server {
namespace {

constexpr size_t kFewestBad = 20;
constexpr double kBadShare = 0.1;
constexpr double kFarPx = 15, kFarTimes = 20;  // and of the camera's median error
constexpr double kFarShare = 0.03;             // of the image's width: the median of bad rows
constexpr int kFewestOthers = 2;
// From rows that fit to rows that do not and back.
constexpr int kFewestChanges = 8;
constexpr double kThirdShare = 1.0 / 12;  // of the bad rows, in each third of the recording
// Of a second wand: how well two cameras' rays meet, its lengths, and how many bad rows show it.
constexpr double kMeetPx = 4, kLengthShare = 0.05, kSecondShare = 0.3;

struct RowOfCamera {
  size_t instant = 0;
  const BundleObservation* observation = nullptr;
  bool is_bad = false;
  double error_px = 0;
};

double MedianErrorPx(const BundleProblem& problem, const BundleInstant& instant,
                     const BundleObservation& observation) {
  std::vector<double> errors_px;
  for (const BundleMarker& marker : problem.MarkersOf(observation)) {
    const auto residual = MarkerResidualPx(problem, instant, observation, marker);
    errors_px.push_back(residual ? residual->norm() : 1e4);
  }
  return errors_px.empty() ? 0 : UpperMedian(&errors_px);
}

bool Fits(const BundleProblem& problem, const BundleObservation& observation) {
  return std::ranges::any_of(problem.MarkersOf(observation), &BundleMarker::used);
}

// By camera, the rows beside which two others have placed the target.
std::vector<std::vector<RowOfCamera>> JudgedRows(const BundleProblem& problem) {
  std::vector<std::vector<RowOfCamera>> rows(problem.cameras.size());
  for (size_t i = 0; i < problem.instants.size(); ++i) {
    const BundleInstant& instant = problem.instants[i];
    if (!instant.used || instant.is_rigid) continue;
    const auto observations = problem.ObservationsOf(instant);
    const auto fitting = std::ranges::count_if(
        observations, [&problem](const BundleObservation& o) { return Fits(problem, o); });
    for (const BundleObservation& observation : observations) {
      const bool fits = Fits(problem, observation);
      if (fitting - (fits ? 1 : 0) < kFewestOthers) continue;
      rows[static_cast<size_t>(observation.camera)].push_back(
          {i, &observation, !fits, MedianErrorPx(problem, instant, observation)});
    }
  }
  for (std::vector<RowOfCamera>& own : rows) {
    std::vector<double> fitting_px;
    for (const RowOfCamera& row : own) {
      if (!row.is_bad) fitting_px.push_back(row.error_px);
    }
    const double far_px =
        fitting_px.empty() ? 0 : std::max(kFarPx, kFarTimes * UpperMedian(&fitting_px));
    for (RowOfCamera& row : own) row.is_bad = row.is_bad && row.error_px > far_px;
  }
  return rows;
}

// In every third of the rows there are some: what begins or ends is another cause.
bool AreThroughout(const std::vector<RowOfCamera>& rows, size_t bad_count) {
  for (size_t third = 0; third < 3; ++third) {
    const size_t begin = third * rows.size() / 3, end = (third + 1) * rows.size() / 3;
    size_t own = 0;
    for (size_t i = begin; i < end; ++i) own += rows[i].is_bad ? 1 : 0;
    if (static_cast<double>(own) < kThirdShare * static_cast<double>(bad_count)) return false;
  }
  return true;
}

// Enough of them, among those that fit, and far off.
bool IsNamed(const std::vector<RowOfCamera>& rows, double width_px) {
  std::vector<double> bad_px;
  int changes = 0;
  for (size_t i = 0; i < rows.size(); ++i) {
    if (rows[i].is_bad) bad_px.push_back(rows[i].error_px);
    changes += i > 0 && rows[i].is_bad != rows[i - 1].is_bad ? 1 : 0;
  }
  return bad_px.size() >= kFewestBad && changes >= kFewestChanges &&
         static_cast<double>(bad_px.size()) > kBadShare * static_cast<double>(rows.size()) &&
         AreThroughout(rows, bad_px.size()) && UpperMedian(&bad_px) > kFarShare * width_px;
}

// Where two cameras' markers of one label meet, if they do.
std::optional<Eigen::Vector3d> Meet(const CameraRay& a, double focal_a_px, const CameraRay& b,
                                    double focal_b_px) {
  const auto point = Triangulate({a, b});
  if (!point || RayError(a, *point) * focal_a_px > kMeetPx ||
      RayError(b, *point) * focal_b_px > kMeetPx) {
    return std::nullopt;
  }
  return point;
}

// Two rows show one target with the right lengths.
bool ShowOneTarget(const BundleProblem& problem, const std::vector<Eigen::Vector2d>& rays,
                   const BundleObservation& a, const BundleObservation& b) {
  std::vector<std::pair<int, Eigen::Vector3d>> points;
  const BundleCamera &camera_a = problem.CameraOf(a), &camera_b = problem.CameraOf(b);
  for (const BundleMarker& one : problem.MarkersOf(a)) {
    for (const BundleMarker& other : problem.MarkersOf(b)) {
      if (one.marker != other.marker) continue;
      const auto point =
          Meet({camera_a.cam_from_rig, rays[problem.IndexOf(one)]}, camera_a.intrinsics[0],
               {camera_b.cam_from_rig, rays[problem.IndexOf(other)]}, camera_b.intrinsics[0]);
      if (!point) return false;
      points.emplace_back(one.marker, *point);
    }
  }
  if (points.empty()) return false;
  for (size_t i = 1; i < points.size(); ++i) {
    const std::vector<double>& at_m = problem.target.marker_positions_m;
    const double given_m = std::abs(at_m[static_cast<size_t>(points[i].first)] -
                                    at_m[static_cast<size_t>(points[0].first)]);
    const double found_m = (points[i].second - points[0].second).norm();
    if (std::abs(found_m - given_m) > kLengthShare * given_m) return false;
  }
  return true;
}

// Of a camera's bad rows, those in which another camera's bad row of that instant shows the same
// target; and which cameras those are.
size_t CountSecondWand(const BundleProblem& problem, const std::vector<Eigen::Vector2d>& rays,
                       const std::vector<std::vector<RowOfCamera>>& rows, size_t camera,
                       std::set<std::string>* partners) {
  size_t count = 0;
  for (const RowOfCamera& row : rows[camera]) {
    if (!row.is_bad) continue;
    bool is_seen = false;
    for (const BundleObservation& other : problem.ObservationsOf(problem.instants[row.instant])) {
      if (&other == row.observation || Fits(problem, other)) continue;
      if (!ShowOneTarget(problem, rays, *row.observation, other)) continue;
      is_seen = true;
      partners->insert(problem.CameraOf(other).name);
    }
    count += is_seen ? 1 : 0;
  }
  return count;
}

Finding FindingFor(const std::string& camera, size_t bad, size_t all, size_t second,
                   const std::set<std::string>& partners) {
  const double share = static_cast<double>(bad) / static_cast<double>(all);
  const bool is_wand = second >= kFewestBad / 2 &&
                       static_cast<double>(second) > kSecondShare * static_cast<double>(bad);
  if (!is_wand) {
    return {FindingKind::kOutliersInCamera, camera, 100 * share, "%",
            absl::StrFormat("in %d of its %d wand views that other cameras can check, by chance "
                            "over the recording, its markers are something else, far from where "
                            "the others put the wand; these rows were left out. Look at what its "
                            "detector takes for the wand: lamps, reflections, clothes",
                            bad, all)};
  }
  std::string others;
  for (const std::string& partner : partners) others += (others.empty() ? "" : ", ") + partner;
  return {FindingKind::kSecondWandSeen, camera, 100 * share, "%",
          absl::StrFormat("in %d of its %d wand views that other cameras can check it sees another "
                          "wand, or the lamps of one: in %d of these it and %s see one of the same "
                          "lengths where the others see none. These rows were left out; wave one "
                          "wand at a time",
                          bad, all, second, others)};
}

RigObservations WithoutRows(RigObservations rig, const std::vector<std::vector<size_t>>& gone) {
  for (size_t t = 0; t < rig.tracks.size(); ++t) {
    if (gone[t].empty()) continue;
    ObservationTable& table = rig.tracks[t].track.observations;
    std::vector<uint32_t> kept;
    for (size_t row = 0; row < table.size(); ++row) {
      if (!std::ranges::binary_search(gone[t], row)) kept.push_back(static_cast<uint32_t>(row));
    }
    table = table.Select(kept);
  }
  return rig;
}

}  // namespace

BadRows FindBadRows(const RigObservations& rig, const RigSolution& solution) {
  const BundleProblem& problem = solution.built.problem;
  BadRows bad;
  bad.rows.resize(rig.tracks.size());
  const std::vector<std::vector<RowOfCamera>> rows = JudgedRows(problem);
  std::vector<Eigen::Vector2d> rays;
  const auto take = [&](const BundleObservation& observation) {
    if (observation.marker_count == 0) return;
    const MarkerSource& source =
        solution.built.sources[static_cast<size_t>(observation.first_marker)];
    bad.rows[static_cast<size_t>(source.track)].push_back(static_cast<size_t>(source.observation));
  };
  for (size_t c = 0; c < rows.size(); ++c) {
    if (!IsNamed(rows[c], rig.index.cameras[c].image_size_px.width)) continue;
    if (rays.empty()) rays = UndistortMarkers(problem);
    std::set<std::string> partners;
    const size_t second = CountSecondWand(problem, rays, rows, c, &partners);
    const auto count = static_cast<size_t>(std::ranges::count(rows[c], true, &RowOfCamera::is_bad));
    bad.findings.push_back(
        FindingFor(problem.cameras[c].name, count, rows[c].size(), second, partners));
    for (const RowOfCamera& row : rows[c]) {
      if (row.is_bad) take(*row.observation);
    }
  }
  for (std::vector<size_t>& own : bad.rows) {
    std::ranges::sort(own);
    own.erase(std::ranges::unique(own).begin(), own.end());
  }
  return bad;
}

absl::Status LeaveOutBadRows(const std::vector<ClockCorrection>& clocks,
                             const CalibrationOptions& options, const CalibrationHooks& hooks,
                             const std::map<std::string, CameraCounts>& counts,
                             const std::shared_ptr<const HeldRig>& held, RefusalCounter* refused,
                             RigObservations* rig, Solved* solved, LeftOutRows* left_out) {
  BadRows bad = FindBadRows(*rig, solved->evaluated.solution);
  if (bad.findings.empty()) return absl::OkStatus();
  if (solved->result.quality.grade != QualityGrade::kBad) {
    // As outliers they are left out already, each for itself.
    left_out->findings = std::move(bad.findings);
    return absl::OkStatus();
  }
  RigObservations rest = WithoutRows(*rig, bad.rows);
  RefusalCounter with = *refused;
  LeftOutRows gone;
  for (size_t t = 0; t < rig->tracks.size(); ++t) {
    const ObservationTable& table = rig->tracks[t].track.observations;
    uint32_t markers = 0;
    for (const size_t row : bad.rows[t]) markers += static_cast<uint32_t>(table.VisibleCount(row));
    gone.markers[rig->tracks[t].track.camera.camera] += markers;
    with.Add(rig->tracks[t].track.camera.camera, RefusalReason::kOutlier, markers,
             "rows in which it sees something else (see findings)");
  }
  absl::StatusOr<Solved> again = SolveAndReport(
      rest, clocks, SolveOptionsOf(rest, options, hooks, counts, held), options, counts, with);
  if (absl::IsCancelled(again.status())) return again.status();
  if (!again.ok()) return absl::OkStatus();
  *solved = *std::move(again);
  *rig = std::move(rest);
  *refused = std::move(with);
  gone.findings = std::move(bad.findings);
  *left_out = std::move(gone);
  return absl::OkStatus();
}

void CountAsOutliers(const LeftOutRows& left_out, CalibrationResult* result) {
  for (CalibratedCamera& camera : result->cameras) {
    const auto own = left_out.markers.find(camera.camera);
    if (own != left_out.markers.end()) camera.residuals.outlier_count += own->second;
  }
}

}  // namespace rigcal::server

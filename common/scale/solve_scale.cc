// SPDX-License-Identifier: Apache-2.0
#include "common/scale/solve_scale.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <set>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/strings/str_join.h"
#include "common/scale/unit_ratio.h"
#include "common/status/status_macros.h"
#include "common/triangulate/camera_agreement.h"
#include "common/triangulate/located_markers.h"

namespace rigcal {
namespace {

// Lengths that differ by a unit may differ by a little more.
constexpr double kUnitTolerance = 0.1;

std::string NameOf(const KnownLength& length) {
  return length.name.empty() ? absl::StrCat("length ", length.marker_a, " to ", length.marker_b)
                             : length.name;
}

absl::StatusOr<std::vector<ScaleSource>> SourcesOf(const CalibrationResult& calibration,
                                                   const CameraCovariance& covariance,
                                                   const ScaleRequest& request,
                                                   const std::vector<MarkerViews>& measured) {
  std::vector<ScaleSource> sources;
  absl::StatusOr<ScaleSource> target = ScaleOfTarget(calibration);
  if (target.ok()) sources.push_back(*std::move(target));
  for (const CameraDistance& distance : request.distances) {
    RIGCAL_ASSIGN_OR_RETURN(
        ScaleSource source,
        ScaleOfCameras(calibration, covariance, distance.camera_a, distance.camera_b,
                       distance.distance_m, distance.SigmaM()));
    sources.push_back(std::move(source));
  }
  if (!request.lengths.empty()) {
    RIGCAL_ASSIGN_OR_RETURN(const std::vector<LocatedMarker> located,
                            LocateMarkers(calibration, measured));
    const Triangulation triangulation = AsTriangulation(located);
    for (const KnownLength& length : request.lengths) {
      RIGCAL_ASSIGN_OR_RETURN(
          ScaleSource source,
          ScaleOfMarkers(calibration, covariance, triangulation, length.marker_a, length.marker_b,
                         length.length_m, length.SigmaM()));
      source.name = NameOf(length);
      sources.push_back(std::move(source));
    }
  }
  for (const std::string& name : request.leave_out) {
    const auto removed =
        std::erase_if(sources, [&name](const ScaleSource& source) { return source.name == name; });
    if (removed > 0) continue;
    std::vector<std::string> names;
    for (const ScaleSource& source : sources)
      names.push_back(absl::StrCat("\"", source.name, "\""));
    return absl::InvalidArgumentError(absl::StrCat("there is no source \"", name, "\"; there ",
                                                   names.size() == 1 ? "is " : "are ",
                                                   absl::StrJoin(names, ", ")));
  }
  if (sources.empty()) return absl::InvalidArgumentError("no source of the scale is left");
  return sources;
}

std::string Described(const ScaleResidual& residual) {
  const double ratio = 1 + residual.from_others_rel;
  const bool percent = DescribeRatio(ratio).find('%') != std::string::npos;
  return absl::StrFormat("\"%s\" is %s %s the others say together (%.1f sigmas)", residual.name,
                         DescribeRatio(ratio), percent ? "than" : "as",
                         std::abs(residual.from_others_sigmas));
}

// "; is it in millimetres? Give metres", or nothing.
std::string UnitQuestion(const ScaleResidual& residual) {
  const double ratio = 1 + residual.from_others_rel;
  if (std::string unit = UnitOfRatio(ratio, kUnitTolerance); !unit.empty()) {
    return absl::StrCat("; is \"", residual.name, "\" in ", unit, "? Give metres");
  }
  if (std::string unit = UnitOfRatio(1 / ratio, kUnitTolerance); !unit.empty()) {
    return absl::StrCat("; are the others in ", unit, "? Give metres");
  }
  return "";
}

}  // namespace

absl::StatusOr<std::vector<MarkerViews>> MeasureForScale(const CalibrationResult& calibration,
                                                         const ScaleRequest& request,
                                                         const std::vector<CameraRows>& rows,
                                                         const TriangulationOptions& options,
                                                         size_t max_pairs) {
  RIGCAL_ASSIGN_OR_RETURN(const Triangulation triangulation,
                          TriangulateRows(calibration, rows, options));
  RIGCAL_RETURN_IF_ERROR(CheckCamerasAgree(calibration, triangulation));
  const std::vector<TriangulatedPoint>& points = triangulation.points;
  std::map<int64_t, std::map<int, size_t>> instants;  // marker to point, by time
  for (size_t i = 0; i < points.size(); ++i) {
    instants[points[i].rig_time_ns].emplace(points[i].marker, i);
  }
  std::set<size_t> taken;
  for (const KnownLength& length : request.lengths) {
    std::vector<std::pair<size_t, size_t>> pairs;
    for (const auto& [time_ns, markers] : instants) {
      const auto a = markers.find(length.marker_a), b = markers.find(length.marker_b);
      if (a != markers.end() && b != markers.end()) pairs.emplace_back(a->second, b->second);
    }
    const size_t stride = (pairs.size() + max_pairs - 1) / std::max<size_t>(1, max_pairs);
    for (size_t i = 0; i < pairs.size(); i += std::max<size_t>(1, stride)) {
      taken.insert({pairs[i].first, pairs[i].second});
    }
  }
  std::vector<MarkerViews> measured;
  for (const size_t i : taken) {
    measured.push_back(
        {points[i].marker, 0, points[i].rig_time_ns, NamedViews(calibration, points[i].views)});
  }
  return measured;
}

absl::StatusOr<ScaleFusion> FuseSources(const CalibrationResult& calibration,
                                        const ScaleRequest& request,
                                        const std::vector<MarkerViews>& measured) {
  RIGCAL_RETURN_IF_ERROR(request.Validate());
  if (!calibration.scale_known) {
    return absl::FailedPreconditionError(
        "the calibration's own scale is not known; calibrate with --distance first");
  }
  const CameraCovariance covariance = UnpackCameraCovariance(calibration);
  RIGCAL_ASSIGN_OR_RETURN(const std::vector<ScaleSource> sources,
                          SourcesOf(calibration, covariance, request, measured));
  return FuseScales(sources, covariance);
}

std::string DisagreementOf(const ScaleFusion& fusion) {
  if (fusion.undecided) {
    const ScaleResidual& a = fusion.residuals[static_cast<size_t>(fusion.suspects[0])];
    const ScaleResidual& b = fusion.residuals[static_cast<size_t>(fusion.suspects[1])];
    const std::string unit = UnitQuestion(a.from_others_rel > b.from_others_rel ? a : b);
    return absl::StrCat("\"", a.name, "\" and \"", b.name, "\" disagree: ", Described(a), ", ",
                        Described(b), unit.empty() ? ", and" : unit + ". Otherwise",
                        " nothing says which of them is wrong: measure both again, or a third, or "
                        "leave one out");
  }
  if (fusion.odd < 0) return "";
  const ScaleResidual& odd = fusion.residuals[static_cast<size_t>(fusion.odd)];
  return absl::StrCat("a source of the scale disagrees: ", Described(odd), UnitQuestion(odd),
                      "; measure it again, or go on with --leave-out \"", odd.name, "\"");
}

CalibrationResult WithScale(const CalibrationResult& calibration, const std::string& calibration_id,
                            const ScaleFusion& fusion) {
  CalibrationResult scaled = Rescale(calibration, fusion.factor, fusion.sigma_rel);
  CalibrationScale& scale = scaled.scale.emplace();
  scale.calibration_id = calibration_id;
  scale.factor = fusion.factor;
  scale.sigma_rel = fusion.sigma_rel;
  for (const ScaleResidual& residual : fusion.residuals) {
    scale.sources.push_back({residual.name, residual.own_change_rel, residual.own_sigma_rel,
                             residual.from_others_rel, residual.from_others_sigmas});
  }
  return scaled;
}

}  // namespace rigcal

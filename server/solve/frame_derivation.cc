// SPDX-License-Identifier: Apache-2.0
#include "server/solve/frame_derivation.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "common/origin/solve_origin.h"
#include "common/scale/solve_scale.h"
#include "common/status/status_macros.h"
#include "common/triangulate/convention_check.h"
#include "server/associate/align_clocks.h"
#include "server/associate/clean_track.h"
#include "server/associate/straight_clocks.h"
#include "server/solve/kept_frame.h"
#include "server/solve/observation_digest.h"

namespace rigcal::server {
namespace {

// Clocks that differ by more from where the parent has them have been started anew.
constexpr double kSameClocksS = 0.05;
// Of one length. More would say no more.
constexpr size_t kMaxLengthPairs = 2000;

const CalibratedCamera* FindCalibrated(const CalibrationResult& calibration,
                                       const std::string& name) {
  const auto found = std::ranges::find(calibration.cameras, name, &CalibratedCamera::camera);
  return found == calibration.cameras.end() ? nullptr : &*found;
}

// Rows of a session, and the calibration whose clocks go with them.
struct TimedRows {
  CalibrationResult calibration;
  std::vector<CameraRows> rows;
  bool same_clocks = true;
};

// Difference of the coarse clock from the one that the calibration found, less what all have in
// common.
bool AreSameClocks(const CalibrationResult& calibration, const std::vector<AlignedTrack>& tracks) {
  double lowest = 0, highest = 0;
  const AlignedTrack& first = tracks.front();
  const CalibratedCamera& first_camera = *FindCalibrated(calibration, first.track.camera.camera);
  for (const AlignedTrack& track : tracks) {
    const CalibratedCamera& camera = *FindCalibrated(calibration, track.track.camera.camera);
    const double coarse_s =
        1e-9 * static_cast<double>(track.clock_offset_ns - first.clock_offset_ns);
    const double apart_s = camera.time_offset_s - first_camera.time_offset_s - coarse_s;
    lowest = std::min(lowest, apart_s);
    highest = std::max(highest, apart_s);
  }
  return highest - lowest <= kSameClocksS;
}

absl::StatusOr<TimedRows> RowsOf(CalibrationInput* input, RefusalCounter* refused) {
  TimedRows timed;
  timed.calibration = *input->parent;
  const auto marker_count_of = [input](const std::string& session) {
    const auto other = input->other_targets.find(session);
    return (other == input->other_targets.end() ? input->target : other->second).marker_count();
  };
  StraightenClocks(&input->tracks, refused);
  std::vector<AlignedTrack> tracks =
      AlignClocks(input->tracks, CleanTracks(&input->tracks, marker_count_of, refused), refused);
  std::erase_if(tracks, [&](const AlignedTrack& track) {
    const std::string& name = track.track.camera.camera;
    if (FindCalibrated(timed.calibration, name) != nullptr) return false;
    refused->Add(name, RefusalReason::kAloneInInstant, track.track.observations.size(),
                 "the camera is not in the calibration that the frame is made for");
    return true;
  });
  if (tracks.size() < 2) {
    std::vector<std::string> names;
    for (const AlignedTrack& track : tracks) names.push_back(track.track.camera.camera);
    return absl::FailedPreconditionError(absl::StrCat(
        "points need rows of two cameras of the calibration, and the session has those of ",
        names.empty() ? "none" : absl::StrJoin(names, ", ")));
  }
  timed.same_clocks = AreSameClocks(timed.calibration, tracks);
  if (!timed.same_clocks) {
    for (CalibratedCamera& camera : timed.calibration.cameras) {
      camera.time_offset_s = camera.time_rate_ppm = 0;
      camera.clock_course.clear();
    }
  }
  for (const AlignedTrack& track : tracks) {
    CameraRows& rows = timed.rows.emplace_back();
    rows.camera = track.track.camera.camera;
    for (Observation row : track.track.observations) {
      if (!timed.same_clocks) row.time_ns = track.CoarseRigTimeNs(row.time_ns);
      rows.rows.push_back(std::move(row));
    }
  }
  return timed;
}

TriangulationOptions TriangulationFor(const CalibrationInput& input,
                                      const CalibrationOptions& options) {
  TriangulationOptions triangulation;
  triangulation.sigma_px = options.sigma_px;
  triangulation.diameter_m = input.target.diameter_m;
  triangulation.tolerance_s = options.association_tolerance_s;
  return triangulation;
}

// Rows that do not fit the calibration at all say so in their own words.
absl::Status Explained(const absl::Status& status, const TimedRows& timed,
                       const TriangulationOptions& options) {
  if (!absl::IsFailedPrecondition(status)) return status;
  absl::StatusOr<Triangulation> points = TriangulateRows(timed.calibration, timed.rows, options);
  if (!points.ok()) return status;
  const absl::Status fits = CheckConvention(timed.calibration, timed.rows, options, *points);
  return fits.ok() ? status : fits;
}

absl::Status NeedRows(const std::string& what) {
  return absl::FailedPreconditionError(absl::StrCat(
      what, " is made from rows: name a session in which they were recorded, or send them"));
}

absl::StatusOr<CalibrationResult> DeriveOrigin(CalibrationInput* input,
                                               const CalibrationOptions& options,
                                               RefusalCounter* refused) {
  const OriginRequest& request = *options.origin;
  std::vector<MarkerViews> measured = request.measured;
  std::vector<std::string> labels;
  if (!input->tracks.empty()) {
    RIGCAL_ASSIGN_OR_RETURN(const TimedRows timed, RowsOf(input, refused));
    if (request.source == FrameSource::kPath && !timed.same_clocks) {
      return absl::FailedPreconditionError(
          "the clocks of the session are not those of the calibration: cameras were started anew, "
          "and their offsets must be known for a target that moves; lay it down instead (floor), "
          "or calibrate from this session first");
    }
    const TriangulationOptions triangulation = TriangulationFor(*input, options);
    std::map<std::string, uint32_t> left_out_rows;
    absl::StatusOr<std::vector<MarkerViews>> found =
        MeasureForOrigin(timed.calibration, request, timed.rows, triangulation, &left_out_rows);
    if (!found.ok()) return Explained(found.status(), timed, triangulation);
    for (const auto& [camera, count] : left_out_rows) {
      refused->Add(camera, RefusalReason::kOutlier, count,
                   "rows whose rays miss those of the other cameras");
    }
    measured = *std::move(found);
    for (const TargetPoint& point : input->target.points) labels.push_back(point.label);
  } else if (request.NeedsRows() && measured.empty()) {
    return NeedRows("this frame");
  }
  std::vector<std::string> unseen;
  const absl::StatusOr<OriginSolution> solution =
      SolveOrigin(*input->parent, request, measured, labels, &unseen);
  if (!solution.ok() && !unseen.empty()) {
    return absl::Status(solution.status().code(),
                        absl::StrCat(std::string(solution.status().message()),
                                     "; not seen by the rig: ", absl::StrJoin(unseen, ", ")));
  }
  RIGCAL_RETURN_IF_ERROR(solution.status());
  CalibrationResult result =
      WithOrigin(*input->parent, options.parent_id, request.source, *solution);
  result.scale.reset();
  result.observation_digest = DerivedDigest(input->parent->observation_digest, options, measured);
  return result;
}

absl::StatusOr<CalibrationResult> DeriveScale(CalibrationInput* input,
                                              const CalibrationOptions& options,
                                              RefusalCounter* refused) {
  const ScaleRequest& request = *options.scale;
  std::vector<MarkerViews> measured = request.measured;
  if (!input->tracks.empty()) {
    RIGCAL_ASSIGN_OR_RETURN(const TimedRows timed, RowsOf(input, refused));
    if (!timed.same_clocks) {
      return absl::FailedPreconditionError(
          "the clocks of the session are not those of the calibration: cameras were started anew, "
          "and a length needs both ends at one time; calibrate from this session first, and give "
          "its lengths to that calibration");
    }
    const TriangulationOptions triangulation = TriangulationFor(*input, options);
    absl::StatusOr<std::vector<MarkerViews>> found =
        MeasureForScale(timed.calibration, request, timed.rows, triangulation, kMaxLengthPairs);
    if (!found.ok()) return Explained(found.status(), timed, triangulation);
    measured = *std::move(found);
    if (measured.empty()) {
      RIGCAL_RETURN_IF_ERROR(Explained(
          absl::FailedPreconditionError("the markers of the lengths are never seen together"),
          timed, triangulation));
    }
  } else if (!request.lengths.empty() && measured.empty()) {
    return NeedRows("a length between markers");
  }
  RIGCAL_ASSIGN_OR_RETURN(const ScaleFusion fusion, FuseSources(*input->parent, request, measured));
  if (const std::string odd = DisagreementOf(fusion); !odd.empty()) {
    return absl::FailedPreconditionError(odd);
  }
  CalibrationResult result = WithScale(*input->parent, options.parent_id, fusion);
  result.frame = InheritedFrame(*input->parent, options.parent_id);
  result.observation_digest = DerivedDigest(input->parent->observation_digest, options, measured);
  return result;
}

}  // namespace

absl::StatusOr<CalibrationResult> DeriveFrame(CalibrationInput* input,
                                              const CalibrationOptions& options,
                                              RefusalCounter* refused) {
  if (!input->parent) {
    return absl::FailedPreconditionError(
        absl::StrCat("calibration ", options.parent_id, " has no result to derive from"));
  }
  RIGCAL_ASSIGN_OR_RETURN(CalibrationResult result, options.kind == SolveKind::kOrigin
                                                        ? DeriveOrigin(input, options, refused)
                                                        : DeriveScale(input, options, refused));
  if (result.information && result.information->calibration_id.empty()) {
    result.information->calibration_id = options.parent_id;
  }
  return result;
}

}  // namespace rigcal::server

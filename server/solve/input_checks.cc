// SPDX-License-Identifier: Apache-2.0
#include "server/solve/input_checks.h"

#include <algorithm>
#include <set>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/strings/str_join.h"
#include "common/statistics/robust_statistics.h"
#include "common/status/status_macros.h"
#include "server/solve/bundle/line_bundle_kernel.h"

namespace rigcal::server {
namespace {

// Of the image's width; half of all views within this of one place determine nothing.
constexpr double kMinSpreadShare = 0.01;
constexpr double kMarginShare = 0.05;  // of the image, around it
constexpr double kMostOutside = 0.05;
constexpr double kLargestShare = 1.5;  // pixels: coordinates up to this are no pixels
constexpr size_t kMinMarkers = 20;
constexpr uint32_t kFewViews = 10;  // a wave has thousands

// The row's first visible marker, or, of a target whose marker 0 is enough, that one.
size_t FirstVisible(const ObservationTable& rows, size_t row, bool any_marker) {
  size_t marker = 0;
  while (any_marker && marker + 1 < rows.MarkerCount(row) && !rows.IsVisible(row, marker)) {
    ++marker;
  }
  return marker;
}

// The spread of the wand in a camera's image, in pixels: the median distance of a marker from its
// median position.
double ImageSpreadPx(const RigObservations& rig, int camera) {
  std::vector<Eigen::Vector2d> centres_px;
  std::vector<double> x, y, distance;
  for (size_t t = 0; t < rig.tracks.size(); ++t) {
    if (rig.index.camera_of_track[t] != camera) continue;
    const ObservationTable& rows = rig.tracks[t].track.observations;
    const bool any_marker = !rig.TargetOf(t).IsLine();
    for (size_t i = 0; i < rows.size(); ++i) {
      const size_t marker = FirstVisible(rows, i, any_marker);
      if (!rows.IsVisible(i, marker)) continue;
      centres_px.push_back(rows.centre_px(i, marker));
      x.push_back(centres_px.back().x());
      y.push_back(centres_px.back().y());
    }
  }
  if (x.empty()) return 0;
  const Eigen::Vector2d middle(UpperMedian(&x), UpperMedian(&y));
  for (const Eigen::Vector2d& centre_px : centres_px) {
    distance.push_back((centre_px - middle).norm());
  }
  return UpperMedian(&distance);
}

// Two cameras are joined by all wands as one line target.
absl::Status CheckWands(const TargetParts& parts) {
  size_t markers = 0;
  for (const Target& wand : parts.lines()) markers += wand.marker_positions_m.size();
  if (markers <= kMaxLineMarkers) return absl::OkStatus();
  return absl::FailedPreconditionError(absl::StrCat(
      "the ", parts.lines().size(), " different wands of these sessions have ", markers,
      " markers together, at most ", kMaxLineMarkers, ": calibrate fewer sessions at once"));
}

}  // namespace

absl::Status ValidateInput(const CalibrationInput& input, const CalibrationOptions& options) {
  RIGCAL_RETURN_IF_ERROR(options.Validate());
  std::vector<const Target*> targets = {&input.target};
  for (const auto& [session, target] : input.other_targets) targets.push_back(&target);
  for (const Target* target : targets) RIGCAL_RETURN_IF_ERROR(target->Validate());
  RIGCAL_RETURN_IF_ERROR(CheckWands(TargetParts(input.target, input.other_targets)));
  for (const Target* target : targets) {
    if (options.trajectory != TrajectoryChoice::kSpline || target->IsLine()) continue;
    return absl::InvalidArgumentError(
        "trajectory: a spline is for wands and single markers; with a rigid target or static "
        "points leave it out");
  }
  const auto is_survey = [](const Target* target) { return target->is_surveyed; };
  const auto joins_cameras = [](const Target* target) {
    return target->HasLengths() && !target->IsStatic();
  };
  if (std::ranges::any_of(targets, is_survey) && std::ranges::none_of(targets, joins_cameras)) {
    return absl::FailedPreconditionError(
        "surveyed static points place cameras only beside a wand or a rigid target: wave one for a "
        "few seconds and calibrate both sessions as one, or give the points' labels alone");
  }
  if (options.known_distance && TargetParts(input.target, input.other_targets).HasLengths()) {
    return absl::InvalidArgumentError(absl::StrCat(
        "a known distance (of cameras ", options.known_distance->camera_a, " and ",
        options.known_distance->camera_b,
        ") is for a target of one marker; this wand has lengths of its own, and two scales would "
        "contradict each other: leave the distance out, and compare it with the result"));
  }
  std::set<std::string> without;
  for (const CameraTrack& track : input.tracks) {
    if (!track.camera.intrinsics) {
      without.insert(track.camera.camera);
      continue;
    }
    const absl::Status status = track.camera.intrinsics->Validate(track.camera.image_size_px);
    if (!status.ok()) {
      return absl::InvalidArgumentError(
          absl::StrCat("camera ", track.camera.camera, ": ", std::string(status.message())));
    }
  }
  if (!without.empty()) {
    return absl::InvalidArgumentError(
        absl::StrCat("no intrinsics of camera ", absl::StrJoin(without, ", "),
                     ": calibrate its lens first and give its YAML file to the agent"));
  }
  return absl::OkStatus();
}

std::map<std::string, CameraCounts> CountInput(const CalibrationInput& input) {
  std::map<std::string, CameraCounts> counts;
  for (const CameraTrack& track : input.tracks) {
    CameraCounts& count = counts[track.camera.camera];
    count.observation_count += static_cast<uint32_t>(track.observations.size());
    for (const Observation& observation : track.observations) {
      count.wand_count += observation.VisibleCount() > 0 ? 1 : 0;
    }
  }
  return counts;
}

bool IsUnread(RefusalReason reason) {
  switch (reason) {
    case RefusalReason::kCsvFieldCount:
    case RefusalReason::kCsvBadTime:
    case RefusalReason::kCsvNotANumber:
    case RefusalReason::kCsvNotFinite:
    case RefusalReason::kCsvHalfMarker:
    case RefusalReason::kCsvLineTooLong:
    case RefusalReason::kCsvEmpty:
    case RefusalReason::kSourceFailed:
    case RefusalReason::kImplausibleTime:
      return true;
    default:
      return false;
  }
}

absl::Status CheckReadRows(const std::map<std::string, CameraCounts>& counts,
                           const std::vector<Refusal>& refused) {
  std::map<std::string, std::pair<uint64_t, const Refusal*>> unread;
  for (const Refusal& refusal : refused) {
    if (!IsUnread(refusal.reason)) continue;
    auto& [count, most] = unread[refusal.camera];
    count += refusal.count;
    if (most == nullptr || refusal.count > most->count) most = &refusal;
  }
  std::vector<std::string> faults;
  for (const auto& [camera, lost] : unread) {
    const auto& [count, most] = lost;
    const auto known = counts.find(camera);
    const uint32_t read = known == counts.end() ? 0 : known->second.observation_count;
    if (count <= read || known == counts.end()) continue;
    const bool is_source = most->reason == RefusalReason::kSourceFailed;
    const bool is_empty = most->reason == RefusalReason::kCsvEmpty;
    faults.push_back(is_source ? most->example
                     : is_empty
                         ? absl::StrCat("camera ", camera, ": ", most->example)
                         : absl::StrCat("camera ", camera, ": ", count, " of its ", count + read,
                                        " rows cannot be read: ", most->example));
  }
  if (faults.empty()) return absl::OkStatus();
  return absl::FailedPreconditionError(absl::StrCat(
      faults.front(),
      faults.size() > 1 ? absl::StrCat(" (and ", faults.size() - 1, " other cameras)") : ""));
}

absl::Status CheckColumns(const std::vector<CameraTrack>& tracks) {
  struct Seen {
    size_t count = 0;
    Eigen::Array2d least_px = Eigen::Array2d::Zero(), most_px = Eigen::Array2d::Zero();
  };
  for (const CameraTrack& track : tracks) {
    std::vector<Seen> markers;
    for (const Observation& row : track.observations) {
      markers.resize(std::max(markers.size(), row.markers.size()));
      for (size_t m = 0; m < row.markers.size(); ++m) {
        if (!row.markers[m].visible || !row.markers[m].centre_px.allFinite()) continue;
        const Eigen::Array2d at_px = row.markers[m].centre_px.array();
        Seen& seen = markers[m];
        seen.least_px = seen.count == 0 ? at_px : seen.least_px.min(at_px);
        seen.most_px = seen.count == 0 ? at_px : seen.most_px.max(at_px);
        ++seen.count;
      }
    }
    const double spread_px = kMinSpreadShare * track.camera.image_size_px.width;
    for (size_t m = 0; m < markers.size(); ++m) {
      const Eigen::Array2d range_px = markers[m].most_px - markers[m].least_px;
      for (const int axis : {0, 1}) {
        // Where both stay the marker is at rest, which is another matter.
        if (markers[m].count < kMinMarkers || range_px[axis] > 0 ||
            range_px[1 - axis] < spread_px) {
          continue;
        }
        return absl::InvalidArgumentError(absl::StrCat(
            "camera ", track.camera.camera, ": ", axis == 0 ? "x" : "y", " of its marker ", m,
            " is ", markers[m].least_px[axis], " in all of its ", markers[m].count,
            " views, while ", axis == 0 ? "y" : "x",
            " changes: that column of its rows is not what was seen; export it again"));
      }
    }
  }
  return absl::OkStatus();
}

absl::Status CheckMarkersTogether(const CalibrationInput& input) {
  const bool is_wand = input.target.kind == TargetKind::kWand;
  if (!is_wand || !input.other_targets.empty()) return absl::OkStatus();
  size_t views = 0, most = 0;
  std::set<size_t> seen;
  for (const CameraTrack& track : input.tracks) {
    for (const Observation& row : track.observations) {
      const auto count = static_cast<size_t>(row.VisibleCount());
      if (count == 0) continue;
      ++views;
      most = std::max(most, count);
      for (size_t m = 0; m < row.markers.size(); ++m) {
        if (row.markers[m].visible) seen.insert(m);
      }
    }
  }
  if (most != 1) return absl::OkStatus();
  return absl::FailedPreconditionError(absl::StrCat(
      "no camera ever saw two markers of the wand at once: all ", views, " wand views show one (",
      "marker ", absl::StrJoin(seen, ", "),
      "). A wand's lengths are between its markers: look at "
      "the detector and at what its rows leave out, or wave one marker (--target point)"));
}

absl::Status CheckImageSizes(const std::vector<CameraTrack>& tracks) {
  for (const CameraTrack& track : tracks) {
    const double width = track.camera.image_size_px.width;
    const double height = track.camera.image_size_px.height;
    size_t count = 0, outside = 0;
    Eigen::Vector2d largest_px = Eigen::Vector2d::Zero();
    for (const Observation& row : track.observations) {
      for (const MarkerObservation& marker : row.markers) {
        if (!marker.visible || !marker.centre_px.allFinite()) continue;
        ++count;
        largest_px = largest_px.cwiseMax(marker.centre_px);
        // A sphere at the border may have its centre beside the image.
        const Eigen::Vector2d margin_px = kMarginShare * Eigen::Vector2d(width, height);
        const bool is_inside =
            (marker.centre_px.array() >= -margin_px.array()).all() &&
            (marker.centre_px.array() <= Eigen::Array2d(width, height) + margin_px.array()).all();
        outside += is_inside ? 0 : 1;
      }
    }
    if (count < kMinMarkers) continue;
    const std::string name = absl::StrCat("camera ", track.camera.camera, ": ");
    if (largest_px.maxCoeff() <= kLargestShare && std::min(width, height) > 50) {
      return absl::InvalidArgumentError(
          absl::StrCat(name, "all its coordinates are from 0 to ", largest_px.maxCoeff(),
                       ", as shares of the image: multiply x by its width and y by its height (",
                       width, ", ", height, "), and give pixels"));
    }
    const double share = static_cast<double>(outside) / static_cast<double>(count);
    if (share <= kMostOutside) continue;
    return absl::InvalidArgumentError(absl::StrFormat(
        "%s%.0f %% of its markers lie outside of its image of %.0f x %.0f px, up to x %.0f and y "
        "%.0f: its lens file is of another camera or another resolution, or its rows are",
        name, 100 * share, width, height, largest_px.x(), largest_px.y()));
  }
  return absl::OkStatus();
}

absl::Status CheckCameras(const std::map<std::string, CameraCounts>& counts,
                          const CalibrationOptions& options) {
  if (counts.size() < 2) {
    return absl::FailedPreconditionError(
        absl::StrCat("a rig needs at least two cameras, this one has ", counts.size(),
                     counts.empty() ? "" : absl::StrCat(" (", counts.begin()->first, ")"),
                     ": record with every camera of the rig in one session"));
  }
  std::vector<std::string> blind;
  for (const auto& [camera, count] : counts) {
    if (count.wand_count == 0) blind.push_back(camera);
  }
  if (!blind.empty()) {
    return absl::FailedPreconditionError(absl::StrCat(
        "camera ", blind.front(), " never saw the wand (",
        counts.at(blind.front()).observation_count, " observations, 0 with a visible marker",
        blind.size() == 1 ? "" : absl::StrCat("; nor did ", blind.size() - 1, " other cameras"),
        "): wave the wand where it can see it, check its detector, or calibrate without it"));
  }
  if (options.known_distance) {
    for (const std::string* camera :
         {&options.known_distance->camera_a, &options.known_distance->camera_b}) {
      if (counts.contains(*camera)) continue;
      std::vector<std::string> names;
      for (const auto& [name, count] : counts) names.push_back(name);
      return absl::InvalidArgumentError(absl::StrCat("known distance: camera ", *camera,
                                                     " is none of the cameras of these sessions (",
                                                     absl::StrJoin(names, ", "), ")"));
    }
  }
  if (!options.reference_camera.empty() && !counts.contains(options.reference_camera)) {
    return absl::InvalidArgumentError(absl::StrCat("reference camera ", options.reference_camera,
                                                   " is none of the cameras of these sessions"));
  }
  return absl::OkStatus();
}

absl::Status CheckTracks(const RigIndex& index, const std::map<std::string, CameraCounts>& counts,
                         const std::set<std::string>& left_out) {
  for (const auto& [camera, count] : counts) {
    if (left_out.contains(camera)) continue;
    if (std::ranges::find(index.cameras, camera, &CameraDescription::camera) !=
        index.cameras.end()) {
      continue;
    }
    return absl::FailedPreconditionError(absl::StrCat(
        "camera ", camera, ": none of its ", count.observation_count,
        " observations can be used (see what was left out); if its clock cannot be put beside the "
        "others, let its agent send clock samples or name a common time base"));
  }
  return absl::OkStatus();
}

absl::Status CheckMotion(const RigObservations& rig,
                         const std::map<std::string, CameraCounts>& counts) {
  const RigIndex& index = rig.index;
  for (size_t c = 0; c < index.cameras.size(); ++c) {
    const double spread_px = ImageSpreadPx(rig, static_cast<int>(c));
    const double needed_px = kMinSpreadShare * index.cameras[c].image_size_px.width;
    if (spread_px >= needed_px) continue;
    const std::string& name = index.cameras[c].camera;
    if (const uint32_t count = counts.at(name).wand_count; count < kFewViews) {
      return absl::FailedPreconditionError(
          absl::StrFormat("camera %s saw the wand in only %d of %d rows: is its file or its "
                          "recording complete? Wave "
                          "the wand where it can see it, or calibrate without it",
                          name, count, counts.at(name).observation_count));
    }
    return absl::FailedPreconditionError(absl::StrFormat(
        "camera %s saw the wand in nearly one place (it moved by %.1f px, at least %.0f px are "
        "needed): wave the wand through all of what the cameras see, near and far, and turn it",
        name, spread_px, needed_px));
  }
  return absl::OkStatus();
}

}  // namespace rigcal::server

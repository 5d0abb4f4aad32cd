// SPDX-License-Identifier: Apache-2.0
#include "tests/accuracy/detection/detection_experiment.h"

#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

#include "common/camera/camera_model.h"
#include "common/statistics/robust_statistics.h"
#include "tests/accuracy/detection/paper_rig.h"
#include "tests/accuracy/detection/rendered_room.h"
#include "tests/accuracy/rig/statistics.h"
#include "tests/accuracy/seed_runs.h"
#include "tests/accuracy/thread_cpu.h"

namespace rigcal::accuracy {
namespace {

constexpr double kVisibleShare = 0.98;
constexpr std::array<double, 5> kDistancesM = {2, 3, 4, 5, 6.5};
constexpr std::array<double, 4> kRadiiPx = {200, 400, 600, 900};

void Compare(const FrameGroundTruth& truth, const WandMotion& motion, const Target& target,
             const DetectionOptions& options, const Observation& observation, ImageResult* result) {
  const Intrinsics& intrinsics = *options.camera.intrinsics;
  const Eigen::Vector2d middle(intrinsics.cx_px, intrinsics.cy_px);
  double worst = 0;
  for (size_t k = 0; k < truth.markers.size(); ++k) {
    const MarkerObservation& marker = observation.markers[k];
    if (!marker.visible) continue;
    CentreError centre;
    centre.true_px = truth.markers[k].centre_px;
    centre.error_px = marker.centre_px - centre.true_px;
    centre.nees = centre.error_px.dot(marker.covariance_px2.inverse() * centre.error_px);
    centre.distance_m = motion.At(target.marker_positions_m[k]).norm();
    const Eigen::Vector2d away = centre.true_px - middle;
    centre.image_radius_px = away.norm();
    centre.radial_px = centre.error_px.dot(away.normalized());
    const SphereMotion sphere = motion.Marker(target.marker_positions_m[k]);
    Eigen::Vector2d pixel, later;
    if (Project(intrinsics, sphere.centre_m, &pixel) &&
        Project(intrinsics, sphere.centre_m + 1e-4 * sphere.velocity_m_s, &later) &&
        (later - pixel).norm() > 0) {
      centre.motion = (later - pixel).normalized();
    }
    worst = std::max(worst, centre.error_px.norm());
    result->centres.push_back(centre);
  }
  const int seen = observation.VisibleCount();
  result->false_wand = result->outcome == DetectionOutcome::kWand && (worst > 3 || seen == 0);
  result->found = seen == target.marker_count() && worst <= 1;
  if (!result->found && !result->false_wand && worst <= 1) return;
  if (!result->found) result->centres.clear();
}

// Which of the spheres that are to be seen were found.
void CountMarkers(const DetectionOptions& options, const WandMotion& wand,
                  const FrameGroundTruth& truth, const Observation& observation,
                  ImageResult* result) {
  std::vector<size_t> visible;
  for (size_t m = 0; m < truth.markers.size(); ++m) {
    const double share =
        testing::VisibleShare(*options.camera.intrinsics, options.camera.image_size_px,
                              options.target, wand, m, truth.bar ? &*truth.bar : nullptr);
    if (share >= kVisibleShare) visible.push_back(m);
  }
  if (visible.size() < 2) return;
  result->visible_markers = static_cast<int>(visible.size());
  for (const size_t m : visible) {
    const MarkerObservation& marker = observation.markers[m];
    const bool found =
        marker.visible && (marker.centre_px - truth.markers[m].centre_px).norm() <= 1;
    result->found_markers += found ? 1 : 0;
  }
}

void Detect(const DetectionOptions& options, const RenderedRoom& room, const RoomFrame& frame,
            int index, agent::WandDetector* detector, ImageResult* result) {
  const double begin_s = ThreadCpuS();
  const auto detection =
      detector->Detect(room.view(), static_cast<int64_t>(index + 1) * 1000000000, 0);
  result->milliseconds = 1e3 * (ThreadCpuS() - begin_s);
  if (!detection.ok()) {
    result->status = detection.status();
    return;
  }
  result->outcome = detection->outcome;
  result->confidence = detection->confidence;
  result->covered_markers = detection->occluded_markers;
  if (!frame.wand) {
    result->false_wand = detection->outcome == DetectionOutcome::kWand;
    return;
  }
  const WandMotion& wand = *frame.wand;
  const Eigen::Vector3d at = wand.origin_m.normalized();
  result->distance_m = wand.origin_m.norm();
  result->tilt_deg = std::asin(std::abs(at.dot(wand.direction))) * 180 / std::numbers::pi;
  result->has_wand = true;
  result->lit = frame.lit;
  result->shown =
      frame.lit &&
      testing::WandVisible(*options.camera.intrinsics, options.camera.image_size_px, options.target,
                           wand, frame.truth.bar ? &*frame.truth.bar : nullptr);
  if (frame.lit) CountMarkers(options, wand, frame.truth, detection->observation, result);
  Compare(frame.truth, wand, options.target, options, detection->observation, result);
}

std::vector<ImageResult> RunRoom(const DetectionOptions& options, int number) {
  std::vector<ImageResult> results(static_cast<size_t>(options.frames_per_room));
  auto room = RenderedRoom::Create(options, number);
  agent::WandDetectorOptions detecting = options.detector;
  detecting.exposure_s = options.render.exposure_s;
  auto detector = agent::WandDetector::Create(detecting, options.target, options.camera);
  for (int i = 0; i < options.frames_per_room; ++i) {
    ImageResult& result = results[static_cast<size_t>(i)];
    result.status = room.ok() ? detector.status() : room.status();
    if (!result.status.ok()) continue;
    const auto frame = room->Render(i);
    result.status = frame.status();
    if (!frame.ok()) continue;
    result.seed = frame->seed;
    Detect(options, *room, *frame, i, &*detector, &result);
  }
  return results;
}

}  // namespace

DetectionOptions PaperDetection() {
  DetectionOptions options;
  options.camera = PaperCamera({1280, 1024}, 509);
  options.target = PaperWand();
  options.render.clutter = 0.5;
  options.render.read_noise_grey = 2.6;
  return options;
}

std::vector<ImageResult> RunDetection(const DetectionOptions& options) {
  const int rooms = (options.frames + options.frames_per_room - 1) / options.frames_per_room;
  const auto by_room = RunAll<std::vector<ImageResult>>(
      rooms, options.threads, [&](int room) { return RunRoom(options, room); });
  std::vector<ImageResult> results;
  for (const auto& some : by_room) results.insert(results.end(), some.begin(), some.end());
  return results;
}

DetectionSummary Summarise(const std::vector<ImageResult>& results) {
  DetectionSummary summary;
  std::vector<double> milliseconds;
  double squares = 0, along = 0, nees = 0;
  Eigen::Vector2d sum_px = Eigen::Vector2d::Zero();
  int centres = 0;
  for (const ImageResult& result : results) {
    ++summary.frames;
    summary.failures += result.status.ok() ? 0 : 1;
    summary.shown += result.shown ? 1 : 0;
    summary.found += result.shown && result.found ? 1 : 0;
    summary.false_wands += result.false_wand ? 1 : 0;
    summary.unlit += result.lit ? 0 : 1;
    summary.empty_frames += result.has_wand ? 0 : 1;
    summary.false_in_empty += !result.has_wand && result.false_wand ? 1 : 0;
    summary.visible_markers += result.visible_markers;
    summary.found_markers += result.found_markers;
    summary.worst_ms = std::max(summary.worst_ms, result.milliseconds);
    milliseconds.push_back(result.milliseconds);
    for (const CentreError& centre : result.centres) {
      sum_px += centre.error_px;
      squares += centre.error_px.squaredNorm();
      along += centre.error_px.dot(centre.motion);
      nees += centre.nees;
      ++centres;
    }
  }
  summary.median_ms = InterpolatedQuantile(milliseconds, 0.5);
  if (centres == 0) return summary;
  summary.rms_px = std::sqrt(squares / (2 * centres));
  summary.motion_bias_px = along / centres;
  summary.bias_px = (sum_px / centres).norm();
  summary.nees = nees / (2 * centres);
  return summary;
}

std::vector<RadialBin> RadialBins(const std::vector<ImageResult>& results) {
  std::vector<RadialBin> bins;
  double nearer = 0;
  for (const double distance_m : kDistancesM) {
    double within = 0;
    for (const double radius_px : kRadiiPx) {
      RadialBin bin{distance_m, radius_px};
      double sum = 0, squares = 0;
      for (const ImageResult& result : results) {
        if (!result.shown) continue;
        for (const CentreError& centre : result.centres) {
          if (centre.distance_m <= nearer || centre.distance_m > distance_m ||
              centre.image_radius_px <= within || centre.image_radius_px > radius_px) {
            continue;
          }
          ++bin.count;
          sum += centre.radial_px;
          squares += centre.radial_px * centre.radial_px;
        }
      }
      within = radius_px;
      if (bin.count < 2) continue;
      bin.mean_px = sum / bin.count;
      bin.sigma_px =
          std::sqrt(std::max(0.0, squares / bin.count - bin.mean_px * bin.mean_px) / bin.count);
      bins.push_back(bin);
    }
    nearer = distance_m;
  }
  return bins;
}

}  // namespace rigcal::accuracy

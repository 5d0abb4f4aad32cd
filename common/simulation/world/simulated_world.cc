// SPDX-License-Identifier: Apache-2.0
#include "common/simulation/world/simulated_world.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <utility>

#include "absl/strings/str_cat.h"
#include "common/camera/camera_model.h"
#include "common/simulation/world/random_stream.h"
#include "common/simulation/world/simulated_rig.h"
#include "common/status/status_macros.h"

namespace rigcal {
namespace {

constexpr uint64_t kObservePurpose = 0x6f6273;
constexpr uint64_t kMarkerPurpose = 0x6d61726b;
constexpr uint64_t kClockPurpose = 0x636c6f636b;
constexpr uint64_t kLengthPurpose = 0x6c656e677468;
constexpr uint64_t kSecondWandPurpose = 0x7365636f6e64;
constexpr uint64_t kStaticPurpose = 0x737461746963;
constexpr double kMinSigmaPx = 0.05;  // a covariance of zero could not be weighed
constexpr double kMaxJitterSigmas = 4;
constexpr int kShutterPasses = 5;
constexpr uint32_t kClockReadingSigmaNs = 200000;

bool InsideImage(const ImageSize& size, const Eigen::Vector2d& pixel) {
  return pixel.x() >= 0 && pixel.x() <= size.width - 1.0 && pixel.y() >= 0 &&
         pixel.y() <= size.height - 1.0;
}

// rig_time = camera_time + time_offset + time_rate * camera_time, solved for camera_time.
double CameraTime(const SimulatedCamera& camera, double rig_time_s) {
  return (rig_time_s - camera.time_offset_s) / (1 + 1e-6 * camera.time_rate_ppm);
}

int64_t Nanoseconds(double seconds) { return std::llround(seconds * 1e9); }

Eigen::Vector3d PositionOf(const TargetPoint& point) { return {point.x_m, point.y_m, point.z_m}; }

Eigen::Vector3d MiddleOf(const std::vector<TargetPoint>& points) {
  Eigen::Vector3d middle = Eigen::Vector3d::Zero();
  for (const TargetPoint& point : points) middle += PositionOf(point);
  return middle / static_cast<double>(points.size());
}

// Puts static points into the volume: as they were surveyed, around its middle, or anywhere.
void PlaceStaticPoints(uint32_t seed, const WaveVolume& volume, Target* target) {
  const Eigen::Vector3d middle = MiddleOf(target->points);
  for (size_t i = 0; i < target->points.size(); ++i) {
    TargetPoint& point = target->points[i];
    RandomStream random{seed, kStaticPurpose, i};
    Eigen::Vector3d place = volume.centre_m + PositionOf(point) - middle;
    if (!target->is_surveyed) {
      for (int axis = 0; axis < 3; ++axis) {
        place[axis] = volume.centre_m[axis] + volume.half_extent_m[axis] * random.Uniform(-1, 1);
      }
    }
    point.x_m = place.x(), point.y_m = place.y(), point.z_m = place.z();
  }
}

}  // namespace

bool ImageOf(const Intrinsics& intrinsics, const Eigen::Vector3d& x_in_cam,
             Eigen::Vector2d* pixel) {
  if (!Project(intrinsics, x_in_cam, pixel)) return false;
  const auto direction = Undistort(intrinsics, *pixel);
  return direction.ok() && (*direction - x_in_cam.hnormalized()).norm() < 1e-6;
}

absl::StatusOr<SimulatedWorld> SimulatedWorld::Create(const SimulationOptions& options,
                                                      const Target& target) {
  RIGCAL_RETURN_IF_ERROR(options.Validate());
  RIGCAL_RETURN_IF_ERROR(target.Validate());
  SimulatedWorld world;
  world.options_ = options;
  world.target_ = target;
  world.true_target_ = target;
  if (!target.board.empty()) {
    RIGCAL_ASSIGN_OR_RETURN(const Board board, ParseBoard(target.board));
    if (board.IsTwoSided()) world.two_sided_ = board;
  }
  double longer_m = 0;
  for (size_t i = 1; i < target.marker_positions_m.size(); ++i) {
    RandomStream random{options.seed, kLengthPurpose, i};
    longer_m += options.length_error_m + options.length_sigma_m * random.Gaussian();
    world.true_target_.marker_positions_m[i] += longer_m;
  }
  for (size_t i = 0; i < target.points.size(); ++i) {
    RandomStream random{options.seed, kLengthPurpose, i};
    TargetPoint& point = world.true_target_.points[i];
    for (double* const value : {&point.x_m, &point.y_m, &point.z_m}) {
      *value += options.length_sigma_m * random.Gaussian();
    }
  }
  if (target.IsStatic()) {
    PlaceStaticPoints(options.seed, MakeWaveVolume(options), &world.true_target_);
  }
  if (const absl::Status valid = world.true_target_.Validate(); !valid.ok()) {
    return absl::InvalidArgumentError(absl::StrCat(
        "a length_error of ", options.length_error_m, " m and a length_sigma of ",
        options.length_sigma_m, " m make a wand that cannot be: ", std::string(valid.message())));
  }
  world.cameras_ = MakeSimulatedCameras(options);
  world.trajectory_ = WandTrajectory(options.seed, MakeWaveVolume(options), options.duration_s,
                                     options.max_speed_m_s);
  return world;
}

WandPose SimulatedWorld::WandAt(double rig_time_s) const {
  if (true_target_.IsStatic()) return {Eigen::Vector3d::Zero(), Eigen::Vector3d::UnitX()};
  const Eigen::Vector3d direction = trajectory_.Direction(rig_time_s);
  if (true_target_.kind == TargetKind::kRigid) {
    const Eigen::Quaterniond rotation = trajectory_.Rotation(rig_time_s);
    return {trajectory_.Middle(rig_time_s) - rotation * MiddleOf(true_target_.points), direction,
            rotation};
  }
  const double length_m = true_target_.marker_positions_m.back();
  return {trajectory_.Middle(rig_time_s) - 0.5 * length_m * direction, direction};
}

Eigen::Vector3d SimulatedWorld::MarkerAt(const WandPose& wand, size_t marker) const {
  if (true_target_.IsLine()) return wand.At(true_target_.marker_positions_m[marker]);
  return wand.origin_m + wand.rotation * PositionOf(true_target_.points[marker]);
}

bool SimulatedWorld::IsHidden(const SimulatedCamera& camera, const WandPose& wand,
                              size_t marker) const {
  const Eigen::Vector3d eye_in_rig = camera.cam_from_rig.SourceFromTargetTranslation();
  const Eigen::Vector3d eye_in_board = wand.rotation.conjugate() * (eye_in_rig - wand.origin_m);
  return two_sided_->SideOf(marker) != two_sided_->SideSeenFrom(eye_in_board);
}

int SimulatedWorld::FrameCount(int camera) const {
  const SimulatedCamera& c = cameras_.at(static_cast<size_t>(camera));
  // The small part keeps a frame that rounding puts just before the end out.
  return static_cast<int>(std::floor((options_.duration_s - c.phase_s) * c.rate_hz - 1e-9)) + 1;
}

double SimulatedWorld::FrameRigTime(int camera, int index) const {
  const SimulatedCamera& c = cameras_.at(static_cast<size_t>(camera));
  return c.phase_s + index / c.rate_hz;
}

Observation SimulatedWorld::Observe(int camera, int index, std::vector<bool>* is_outlier) const {
  const bool second = ShowsSecondWand(camera, index);
  const double frame_s = FrameRigTime(camera, index);
  const auto wand_after = [this, second, frame_s](double delay_s) {
    WandPose wand = WandAt(frame_s + delay_s);
    if (second) {
      // Half a turn about the vertical through the middle of the rig.
      const Eigen::Vector3d turn(-1, -1, 1);
      wand = {wand.origin_m.cwiseProduct(turn), wand.direction.cwiseProduct(turn),
              Eigen::Quaterniond(0, 0, 0, 1) * Eigen::Quaterniond(wand.rotation)};
    }
    return wand;
  };
  return ObserveMoving(camera, index, wand_after, is_outlier);
}

Observation SimulatedWorld::ObserveWand(int camera, int index, const WandPose& wand,
                                        std::vector<bool>* is_outlier) const {
  return ObserveMoving(
      camera, index, [&wand](double) { return wand; }, is_outlier);
}

bool SimulatedWorld::ImageOfMarker(const SimulatedCamera& camera, const MovingWand& wand_after,
                                   size_t marker, Eigen::Vector2d* pixel) const {
  const double middle = 0.5 * (camera.description.image_size_px.height - 1.0);
  double delay_s = 0;
  // The row decides the time, and the time the row; a wand is slow beside the readout.
  for (int pass = 0; pass < (camera.line_delay_s == 0 ? 1 : kShutterPasses); ++pass) {
    if (!ImageOf(camera.true_intrinsics,
                 camera.cam_from_rig * MarkerAt(wand_after(delay_s), marker), pixel)) {
      return false;
    }
    delay_s = camera.line_delay_s * (pixel->y() - middle);
  }
  return true;
}

bool SimulatedWorld::ShowsSecondWand(int camera, int index) const {
  const auto share = options_.camera_second_wand_share.find(camera);
  if (share == options_.camera_second_wand_share.end()) return false;
  RandomStream random{options_.seed, kSecondWandPurpose, static_cast<uint64_t>(camera),
                      static_cast<uint64_t>(index)};
  return random.Uniform() < share->second;
}

Observation SimulatedWorld::ObserveMoving(int camera, int index, const MovingWand& wand_after,
                                          std::vector<bool>* is_outlier) const {
  const SimulatedCamera& c = cameras_.at(static_cast<size_t>(camera));
  const uint64_t frame_key[2] = {static_cast<uint64_t>(camera), static_cast<uint64_t>(index)};
  const double rig_time_s = FrameRigTime(camera, index);
  const ImageSize& size = c.description.image_size_px;
  const double sigma_px = std::max(options_.noise_px, kMinSigmaPx);
  const bool in_gap = options_.InGap(rig_time_s);
  const size_t marker_count = MarkerCount();

  RandomStream random{options_.seed, kObservePurpose, frame_key[0], frame_key[1]};
  const double jitter_sigmas = std::clamp(random.Gaussian(), -kMaxJitterSigmas, kMaxJitterSigmas);
  const bool swapped = random.Uniform() < options_.swap_share;

  Observation observation;
  observation.time_ns = c.clock_origin_ns +
                        Nanoseconds(CameraTime(c, rig_time_s) + options_.jitter_s * jitter_sigmas);
  observation.markers.resize(marker_count);
  std::vector<bool> outliers(marker_count, false);
  for (size_t m = 0; m < marker_count; ++m) {
    // Every number is drawn whether it is used or not, so that more of one disturbance leaves the
    // others as they were.
    RandomStream draw{options_.seed, kMarkerPurpose, frame_key[0], frame_key[1], m};
    const bool dropped = draw.Uniform() < options_.dropout_share;
    const bool outlier = draw.Uniform() < c.outlier_share;
    const double anywhere_x = draw.Uniform(0, size.width - 1.0);
    const double anywhere_y = draw.Uniform(0, size.height - 1.0);
    const double noise_x = draw.Gaussian();
    const double noise_y = draw.Gaussian();
    Eigen::Vector2d pixel;
    if (in_gap || dropped || (two_sided_ && IsHidden(c, wand_after(0), m)) ||
        !ImageOfMarker(c, wand_after, m, &pixel)) {
      continue;
    }
    if (!InsideImage(size, pixel)) continue;
    pixel += options_.noise_px * Eigen::Vector2d(noise_x, noise_y);
    if (outlier) pixel = {anywhere_x, anywhere_y};
    if (!InsideImage(size, pixel)) continue;
    MarkerObservation& marker = observation.markers[m];
    marker.visible = true;
    marker.centre_px = pixel;
    marker.covariance_px2 = sigma_px * sigma_px * Eigen::Matrix2d::Identity();
    marker.centre_kind = CentreKind::kSphereCentre;
    outliers[m] = outlier;
  }
  if (swapped && true_target_.IsLine()) {  // others have no other end
    std::reverse(observation.markers.begin(), observation.markers.end());
    std::reverse(outliers.begin(), outliers.end());
  }
  if (is_outlier != nullptr) *is_outlier = std::move(outliers);
  return observation;
}

ClockSample SimulatedWorld::SampleClock(int camera, int index) const {
  const SimulatedCamera& c = cameras_.at(static_cast<size_t>(camera));
  RandomStream random{options_.seed, kClockPurpose, static_cast<uint64_t>(camera),
                      static_cast<uint64_t>(index)};
  const double rig_time_s = FrameRigTime(camera, index);
  ClockSample sample;
  sample.device_ns = c.clock_origin_ns + Nanoseconds(CameraTime(c, rig_time_s));
  sample.host_utc_ns =
      Nanoseconds(rig_time_s) + std::llround(kClockReadingSigmaNs * random.Gaussian());
  sample.host_monotonic_ns = sample.host_utc_ns;
  sample.uncertainty_ns = kClockReadingSigmaNs;
  return sample;
}

}  // namespace rigcal

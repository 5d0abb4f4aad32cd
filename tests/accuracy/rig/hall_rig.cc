// SPDX-License-Identifier: Apache-2.0
#include "tests/accuracy/rig/hall_rig.h"

#include <Eigen/Cholesky>
#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <map>
#include <numbers>
#include <utility>
#include <vector>

#include "absl/strings/str_format.h"
#include "common/simulation/world/random_stream.h"
#include "common/simulation/world/simulated_world.h"
#include "common/status/status_macros.h"

namespace rigcal::accuracy {
namespace {

constexpr uint64_t kCameraPurpose = 0x68616c6c;
constexpr uint64_t kRowPurpose = 0x726f7773;
constexpr int kAcross = 10;
constexpr double kSpacingM = 1.25;
constexpr double kCeilingM = 6.3;
constexpr double kRateHz = 10;
constexpr double kStepS = 1e-4;
const ImageSize kImageSize{1280, 1024};

// Of a hall of so many rows of cameras, in its own frame: x along, y across, z up, metres.
class CarriedWand {
 public:
  CarriedWand(int rows, double duration_s)
      : along_m_s_(kSpacingM * rows / duration_s),
        turn_s_(duration_s / rows),
        half_width_m_(0.5 * kSpacingM * kAcross) {}

  WandPose At(double time_s) const {
    const double phase = std::numbers::pi * time_s / turn_s_ + 0.7 * std::sin(0.11 * time_s);
    const double azimuth = 0.4 * time_s + 0.8 * std::sin(0.31 * time_s);
    const double elevation = 1.2 * std::sin(0.57 * time_s);
    return {{along_m_s_ * time_s - 0.5 * kSpacingM, half_width_m_ * std::sin(phase),
             1.3 + 0.5 * std::sin(0.73 * time_s)},
            {std::cos(elevation) * std::cos(azimuth), std::cos(elevation) * std::sin(azimuth),
             std::sin(elevation)}};
  }

 private:
  double along_m_s_, turn_s_, half_width_m_;
};

TrueCamera MakeCamera(const HallOptions& options, int index) {
  RandomStream random{options.seed, kCameraPurpose, static_cast<uint64_t>(index)};
  const auto jitter = [&random](double most) { return random.Uniform(-most, most); };
  const Eigen::Vector3d centre_m(kSpacingM * (index / kAcross) + jitter(0.1),
                                 kSpacingM * (index % kAcross - 0.5 * (kAcross - 1)) + jitter(0.1),
                                 kCeilingM + jitter(0.2));
  const Eigen::Quaterniond down(0, 1, 0, 0);
  const Eigen::Quaterniond tilt = Eigen::AngleAxisd(jitter(0.15), Eigen::Vector3d::UnitX()) *
                                  Eigen::AngleAxisd(jitter(0.15), Eigen::Vector3d::UnitY()) *
                                  Eigen::AngleAxisd(jitter(0.3), Eigen::Vector3d::UnitZ());
  TrueCamera camera;
  const Eigen::Quaterniond rotation = (tilt * down).normalized();
  camera.cam_from_rig = {rotation, -(rotation * centre_m)};
  camera.intrinsics.fx_px = camera.intrinsics.fy_px = 1250 * random.Uniform(0.98, 1.02);
  camera.intrinsics.cx_px = 639.5 + jitter(15);
  camera.intrinsics.cy_px = 511.5 + jitter(15);
  camera.intrinsics.distortion = {-0.22, 0.2, 0, 0, -0.16};
  camera.middle_row = 0.5 * (kImageSize.height - 1);
  return camera;
}

bool IsInside(const Eigen::Vector2d& pixel) {
  return pixel.x() >= 0 && pixel.x() <= kImageSize.width - 1.0 && pixel.y() >= 0 &&
         pixel.y() <= kImageSize.height - 1.0;
}

// The row of one camera; what is no outlier also to `seen`.
Observation Observe(const HallOptions& options, const TrueRig& rig, int camera, int frame,
                    const WandPose& wand, std::vector<SeenMarker>* seen) {
  const TrueCamera& from = rig.cameras[static_cast<size_t>(camera)];
  Observation row;
  row.markers.resize(rig.marker_positions_m.size());
  for (size_t m = 0; m < row.markers.size(); ++m) {
    const Eigen::Vector3d x_in_cam = from.cam_from_rig * wand.At(rig.marker_positions_m[m]);
    Eigen::Vector2d pixel;
    if (!(x_in_cam.z() > 0) || !(x_in_cam.hnormalized().norm() < 1) ||
        !ImageOf(from.intrinsics, x_in_cam, &pixel) || !IsInside(pixel)) {
      continue;
    }
    RandomStream random{options.seed, kRowPurpose, static_cast<uint64_t>(camera),
                        static_cast<uint64_t>(frame), m};
    const bool dropped = random.Uniform() < options.dropout_share;
    const bool is_outlier = random.Uniform() < options.outlier_share;
    const Eigen::Vector2d anywhere(random.Uniform(0, kImageSize.width - 1.0),
                                   random.Uniform(0, kImageSize.height - 1.0));
    const double noise_x = random.Gaussian(), noise_y = random.Gaussian();
    pixel = is_outlier
                ? anywhere
                : Eigen::Vector2d(pixel + options.noise_px * Eigen::Vector2d(noise_x, noise_y));
    if (dropped || !IsInside(pixel)) continue;
    MarkerObservation& marker = row.markers[m];
    marker.visible = true;
    marker.centre_px = pixel;
    marker.covariance_px2 = options.noise_px * options.noise_px * Eigen::Matrix2d::Identity();
    marker.centre_kind = CentreKind::kSphereCentre;
    if (!is_outlier) seen->push_back({camera, static_cast<int>(m), marker.covariance_px2});
  }
  return row;
}

bool IsEmpty(const Observation& row) {
  return std::ranges::none_of(row.markers, &MarkerObservation::visible);
}

// The instant with its own cameras and the reference alone. `whole`: the rig's number of each.
TrueRig PartOf(const TrueRig& rig, const TrueInstant& instant, std::vector<int>* whole) {
  std::map<int, int> number;
  for (const SeenMarker& seen : instant.markers) number[seen.camera] = 0;
  number[rig.reference_camera] = 0;
  TrueRig part;
  part.marker_positions_m = rig.marker_positions_m;
  whole->clear();
  for (auto& [camera, own] : number) {
    own = static_cast<int>(whole->size());
    whole->push_back(camera);
    part.cameras.push_back(rig.cameras[static_cast<size_t>(camera)]);
  }
  part.reference_camera = number[rig.reference_camera];
  part.instants.push_back(instant);
  for (SeenMarker& seen : part.instants.front().markers) seen.camera = number[seen.camera];
  return part;
}

// Of each parameter of `part` the row in `rig`.
std::vector<int> RowsOf(const RigBound& part, const std::vector<int>& whole, const RigBound& rig,
                        int spans) {
  std::vector<int> rows(static_cast<size_t>(part.information.rows()), -1);
  for (int c = 0; c < part.camera_count; ++c) {
    if (c == part.reference_camera) continue;
    const int camera = whole[static_cast<size_t>(c)];
    for (int i = 0; i < 6; ++i) {
      rows[static_cast<size_t>(part.PoseIndex(c) + i)] = rig.PoseIndex(camera) + i;
    }
    rows[static_cast<size_t>(part.TimeOffsetIndex(c))] = rig.TimeOffsetIndex(camera);
  }
  for (int s = 0; s < spans; ++s) {
    rows[static_cast<size_t>(part.first_marker_position + s)] = rig.first_marker_position + s;
  }
  return rows;
}

// By blocked Cholesky of the matrix with a unit diagonal.
absl::Status Invert(RigBound* bound) {
  const Eigen::VectorXd scale = bound->information.diagonal().cwiseSqrt().cwiseInverse();
  const Eigen::LLT<Eigen::MatrixXd> factor(scale.asDiagonal() * bound->information *
                                           scale.asDiagonal());
  if (!scale.allFinite() || factor.info() != Eigen::Success) {
    return absl::FailedPreconditionError("the observations do not determine the rig");
  }
  bound->covariance = Eigen::MatrixXd::Identity(scale.size(), scale.size());
  factor.solveInPlace(bound->covariance);
  bound->covariance = scale.asDiagonal() * bound->covariance * scale.asDiagonal();
  return absl::OkStatus();
}

}  // namespace

HallRig MakeHallRig(const HallOptions& options) {
  HallRig hall;
  hall.truth.marker_positions_m = hall.input.target.marker_positions_m = {0, 0.13, 0.39};
  for (int c = 0; c < options.camera_count; ++c) {
    hall.truth.cameras.push_back(MakeCamera(options, c));
    server::CameraTrack track;
    track.session_id = "hall";
    track.camera.camera = absl::StrFormat("cam_%03d", c);
    track.camera.image_size_px = kImageSize;
    track.camera.intrinsics = hall.truth.cameras.back().intrinsics;
    track.camera.clock.clock_id = track.camera.camera;
    track.camera.clock.timebase = "hall";
    track.camera.sensor = SensorKind::kFrame;
    hall.input.tracks.push_back(std::move(track));
  }
  const int frames = options.camera_count * options.instants_per_camera;
  const CarriedWand wand(options.camera_count / kAcross, frames / kRateHz);
  double views = 0;
  for (int frame = 0; frame < frames; ++frame) {
    const double time_s = frame / kRateHz;
    TrueInstant instant;
    instant.wand = wand.At(time_s);
    const WandPose before = wand.At(time_s - kStepS), after = wand.At(time_s + kStepS);
    instant.origin_velocity_m_s = (after.origin_m - before.origin_m) / (2 * kStepS);
    instant.turn_rad_s =
        instant.wand.direction.cross((after.direction - before.direction) / (2 * kStepS));
    for (int c = 0; c < options.camera_count; ++c) {
      Observation row = Observe(options, hall.truth, c, frame, instant.wand, &instant.markers);
      // Cameras without the wand deliver empty rows: they go on running.
      views += IsEmpty(row) ? 0 : 1;
      row.time_ns = 10'000'000'000 + std::llround(1e9 * time_s);
      hall.input.tracks[static_cast<size_t>(c)].observations.push_back(std::move(row));
    }
    hall.truth.instants.push_back(std::move(instant));
  }
  hall.cameras_per_instant = views / frames;
  // Into the frame of the first camera.
  const RigidTransform first = hall.truth.cameras.front().cam_from_rig;
  for (TrueCamera& camera : hall.truth.cameras) {
    const Eigen::Quaterniond rotation = Eigen::Quaterniond(camera.cam_from_rig.rotation) *
                                        Eigen::Quaterniond(first.rotation).conjugate();
    camera.cam_from_rig = {rotation,
                           camera.cam_from_rig.translation_m - rotation * first.translation_m};
  }
  for (TrueInstant& instant : hall.truth.instants) {
    instant.wand.origin_m = first * instant.wand.origin_m;
    for (Eigen::Vector3d* const vector :
         {&instant.wand.direction, &instant.origin_velocity_m_s, &instant.turn_rad_s}) {
      *vector = first.rotation * *vector;
    }
  }
  return hall;
}

absl::StatusOr<RigBound> ComputeBoundOfParts(const TrueRig& rig, double span_sigma_m) {
  constexpr double kNoPrior = 1e9;
  InformationOptions options;
  options.marker_positions = options.time_offsets = true;
  options.span_sigma_m = span_sigma_m;
  TrueRig without = rig;
  without.instants.clear();
  RIGCAL_ASSIGN_OR_RETURN(RigBound bound, ComputeRigInformation(without, options));
  options.span_sigma_m = kNoPrior;
  std::vector<int> whole;
  for (const TrueInstant& instant : rig.instants) {
    const TrueRig part = PartOf(rig, instant, &whole);
    RIGCAL_ASSIGN_OR_RETURN(const RigBound own, ComputeRigInformation(part, options));
    const std::vector<int> rows =
        RowsOf(own, whole, bound, static_cast<int>(rig.marker_positions_m.size()) - 1);
    bound.information(rows, rows) += own.information;
  }
  RIGCAL_RETURN_IF_ERROR(Invert(&bound));
  return bound;
}

}  // namespace rigcal::accuracy

// SPDX-License-Identifier: Apache-2.0
#include "common/simulation/world/simulated_rig.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <numbers>

#include "absl/strings/str_cat.h"
#include "common/simulation/world/random_stream.h"

namespace rigcal {
namespace {

// The clocks of one time base at rig time 0: no timestamp is negative, whatever
// offset a clock is given.
constexpr int64_t kSharedOriginNs = 10'000'000'000;

constexpr uint64_t kRigPurpose = 0x726967;
constexpr uint64_t kLensPurpose = 0x6c656e73;
constexpr int kFullRing = 6;
constexpr int kMaxPerRing = 10;
constexpr int kMaxRings = 4;
constexpr double kRingDistanceM = 3.4;
constexpr double kVolumeHeightM = 1.5;
const ImageSize kImageSize{1280, 1024};

// Places of `camera_count` cameras on rings of one radius.
struct RingPlan {
  int rings = 1;
  int slots = kFullRing;  // places on the fullest ring
  double radius_m = 0;

  explicit RingPlan(int camera_count) {
    rings = std::min(kMaxRings, (camera_count + kMaxPerRing - 1) / kMaxPerRing);
    slots = std::max(kFullRing, (camera_count + rings - 1) / rings);
    const double baseline_m = rings == 1 ? 4.0 : 3.6;
    radius_m = baseline_m / (2 * std::sin(std::numbers::pi / slots));
  }
};

// z looks from `position` to `target`; x is horizontal before the roll.
RigidTransform LookAt(const Eigen::Vector3d& position, const Eigen::Vector3d& target,
                      double roll_rad) {
  const Eigen::Vector3d z = (target - position).normalized();
  const Eigen::Vector3d x = z.cross(Eigen::Vector3d::UnitZ()).normalized();
  const Eigen::Vector3d y = z.cross(x);
  Eigen::Matrix3d cam_from_rig;
  cam_from_rig << x.transpose(), y.transpose(), z.transpose();
  const Eigen::Quaterniond rotation(Eigen::AngleAxisd(roll_rad, Eigen::Vector3d::UnitZ()) *
                                    Eigen::Quaterniond(cam_from_rig));
  return {Canonical(rotation.normalized()), rotation.normalized() * -position};
}

RigidTransform MakePose(const RingPlan& plan, int index, int camera_count, RandomStream* random) {
  const int ring = index % plan.rings;
  const int place = index / plan.rings;
  const int on_ring = camera_count / plan.rings + (ring < camera_count % plan.rings ? 1 : 0);
  // Less than a full ring keeps the distance between neighbours and leaves the rest open.
  const int slots = plan.rings == 1 ? plan.slots : on_ring;
  const double turn = (place + 0.5 * (ring % 2)) / slots + random->Uniform(-0.05, 0.05) / slots;
  const double height_m = plan.rings == 1
                              ? random->Uniform(1.0, 2.6)
                              : 1.0 + kRingDistanceM * ring + random->Uniform(-0.1, 0.1);
  const double angle = 2 * std::numbers::pi * turn;
  const Eigen::Vector3d position(plan.radius_m * std::cos(angle), plan.radius_m * std::sin(angle),
                                 height_m);
  Eigen::Vector3d look_to(0, 0, kVolumeHeightM);
  for (int axis = 0; axis < 3; ++axis) look_to[axis] += random->Uniform(-0.15, 0.15);
  return LookAt(position, look_to, random->Uniform(-0.1, 0.1));
}

// Such a lens as those of the cameras the eWand paper used.
Intrinsics MakeIntrinsics(RandomStream* random) {
  Intrinsics intrinsics;
  intrinsics.fx_px = 1250 * random->Uniform(0.98, 1.02);
  intrinsics.fy_px = intrinsics.fx_px * random->Uniform(0.998, 1.002);
  intrinsics.cx_px = 639.5 + random->Uniform(-15, 15);
  intrinsics.cy_px = 511.5 + random->Uniform(-15, 15);
  intrinsics.distortion = {random->Uniform(-0.24, -0.20), random->Uniform(0.16, 0.24),
                           random->Uniform(-8e-4, 8e-4), random->Uniform(-8e-4, 8e-4),
                           random->Uniform(-0.20, -0.12)};
  return intrinsics;
}

// The true lens if `given` is a measurement with errors. Brown-Conrady.
Intrinsics DrawTrueIntrinsics(const Intrinsics& given, const SimulationOptions& options,
                              RandomStream random) {
  Intrinsics drawn = given;
  drawn.fx_px *= 1 + options.focal_sigma_rel * random.Gaussian();
  drawn.fy_px *= 1 + options.focal_sigma_rel * random.Gaussian();
  drawn.cx_px += options.centre_sigma_px * random.Gaussian();
  drawn.cy_px += options.centre_sigma_px * random.Gaussian();
  for (const size_t radial : {0, 1, 4}) {
    const double sigma = radial == 4 ? options.radial_high_sigma : options.radial_sigma;
    drawn.distortion[radial] += sigma * random.Gaussian();
  }
  for (const size_t tangential : {2, 3}) {
    drawn.distortion[tangential] += options.tangential_sigma * random.Gaussian();
  }
  return drawn;
}

double ValueOr(const std::map<int, double>& values, int index, double otherwise) {
  const auto found = values.find(index);
  return found == values.end() ? otherwise : found->second;
}

}  // namespace

std::vector<SimulatedCamera> MakeSimulatedCameras(const SimulationOptions& options) {
  const RingPlan plan(options.camera_count);
  std::vector<SimulatedCamera> cameras;
  for (int i = 0; i < options.camera_count; ++i) {
    RandomStream random{options.seed, kRigPurpose, static_cast<uint64_t>(i)};
    SimulatedCamera camera;
    camera.cam_from_rig = MakePose(plan, i, options.camera_count, &random);
    camera.description.camera = absl::StrCat("sim_", i);
    camera.description.image_size_px = kImageSize;
    camera.description.intrinsics = MakeIntrinsics(&random);
    camera.true_intrinsics =
        DrawTrueIntrinsics(*camera.description.intrinsics, options,
                           RandomStream{options.seed, kLensPurpose, static_cast<uint64_t>(i)});
    camera.description.clock.clock_id = camera.description.camera;
    camera.description.clock.timebase = options.clock_samples ? "" : "sim";
    camera.description.sensor = SensorKind::kFrame;
    camera.description.source = absl::StrCat("sim:camera=", i);
    camera.time_offset_s = ValueOr(options.time_offset_s, i, 0);
    camera.time_rate_ppm = ValueOr(options.time_rate_ppm, i, 0);
    camera.line_delay_s = ValueOr(options.line_delay_s, i, 0);
    camera.rate_hz = ValueOr(options.camera_rate_hz, i, options.rate_hz);
    camera.outlier_share = ValueOr(options.camera_outlier_share, i, options.outlier_share);
    const double phase_s = random.Uniform() / camera.rate_hz;
    if (options.free_running) camera.phase_s = phase_s;
    // As if each had been switched on at another hour.
    const double hours = 2.0 * i + random.Uniform(1.0, 2.0);
    camera.clock_origin_ns = kSharedOriginNs;
    if (options.clock_samples) {
      camera.clock_origin_ns = static_cast<int64_t>(hours * 3600 * 1e6) * 1000;
    }
    cameras.push_back(camera);
  }
  return cameras;
}

WaveVolume MakeWaveVolume(const SimulationOptions& options) {
  const double side_m = std::min(5.0, 0.5 * RingPlan(options.camera_count).radius_m);
  return {Eigen::Vector3d(0, 0, kVolumeHeightM), Eigen::Vector3d(side_m, side_m, 1.1)};
}

}  // namespace rigcal

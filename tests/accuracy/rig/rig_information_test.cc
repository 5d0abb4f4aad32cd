// SPDX-License-Identifier: Apache-2.0
#include "tests/accuracy/rig/rig_information.h"

#include <Eigen/Cholesky>
#include <Eigen/Geometry>
#include <cmath>
#include <string>
#include <vector>

#include "common/camera/camera_model.h"
#include "common/camera/intrinsics_vector.h"
#include "common/simulation/world/random_stream.h"
#include "server/solve/bundle/bundle_adjuster.h"
#include "tests/accuracy/rig/simulated_tracks.h"
#include "tests/accuracy/rig/statistics.h"
#include "tests/testing/simulation_text.h"
#include "tests/testing/status_matchers.h"

namespace rigcal::accuracy::rig_information_test {
namespace {

using ::rigcal::testing::IsOk;
using ::rigcal::testing::ParseSimulationOptions;
using ::rigcal::testing::StatusIs;
using ::testing::HasSubstr;

TrueRig SmallRig(const std::string& more = "") {
  const SimulatedWorld world = *SimulatedWorld::Create(
      *ParseSimulationOptions("seed=3;cameras=3;duration=8;rate=5;outliers=0;dropouts=0.1" + more),
      *ParseTarget("wand:0,0.13,0.39"));
  return MakeTrueRig(world, 0);
}

// One draw of the ground truth from its priors and of the noise, and the errors of the plain
// least-squares estimate, in the order of RigBound.
Eigen::VectorXd EstimateOnce(const TrueRig& given, const InformationOptions& options,
                             const RigBound& bound, uint64_t trial) {
  RandomStream random{7, trial};
  const auto noise = [&random] { return Eigen::Vector2d(random.Gaussian(), random.Gaussian()); };
  TrueRig truth = given;
  if (options.marker_positions) {
    double longer_m = 0;
    for (size_t m = 1; m < truth.marker_positions_m.size(); ++m) {
      longer_m += options.span_sigma_m * random.Gaussian();
      truth.marker_positions_m[m] += longer_m;
    }
  }
  server::BundleProblem problem;
  problem.target.marker_positions_m = truth.marker_positions_m;
  problem.target.given_positions_m = given.marker_positions_m;
  problem.target.span_sigma_m = options.span_sigma_m;
  problem.target.fixed = !options.marker_positions;
  Eigen::VectorXd true_offset_s = Eigen::VectorXd::Zero(bound.camera_count);
  for (int c = 0; c < bound.camera_count; ++c) {
    TrueCamera& camera = truth.cameras[static_cast<size_t>(c)];
    server::BundleCamera entry;
    entry.name = std::to_string(c);
    entry.cam_from_rig = camera.cam_from_rig;
    entry.pose_fixed = c == bound.reference_camera;
    entry.model = camera.intrinsics.model;
    entry.intrinsics_mean = ToVector(camera.intrinsics);
    if (options.intrinsics) {
      IntrinsicsVector drawn = entry.intrinsics_mean;
      for (Eigen::Index i = 0; i < drawn.size(); ++i) {
        drawn[i] += options.intrinsics_sigma[i] * random.Gaussian();
      }
      camera.intrinsics = FromVector(camera.intrinsics.model, drawn);
      entry.intrinsics_fixed = false;
      entry.intrinsics_sigma = options.intrinsics_sigma;
    }
    entry.intrinsics = ToVector(camera.intrinsics);
    problem.cameras.push_back(entry);
    server::BundleClock clock;
    clock.clock_id = entry.name;
    if (options.time_offsets && c != bound.reference_camera) {
      clock.offset_fixed = false;
      true_offset_s[c] = clock.time_offset_s = 1e-3 * random.Gaussian();
    }
    problem.clocks.push_back(clock);
  }
  for (const TrueInstant& instant : truth.instants) {
    server::BundleInstant entry;
    entry.origin_m = instant.wand.origin_m;
    entry.direction = instant.wand.direction;
    entry.first_observation = static_cast<int>(problem.observations.size());
    for (const SeenMarker& seen : instant.markers) {
      const TrueCamera& camera = truth.cameras[static_cast<size_t>(seen.camera)];
      const double s = truth.marker_positions_m[static_cast<size_t>(seen.marker)];
      Eigen::Matrix<double, 2, 3> d_point;
      server::BundleMarker marker;
      marker.marker = seen.marker;
      Eigen::Vector2d centre_px;
      if (!Project(camera.intrinsics,
                   camera.cam_from_rig * (instant.wand.origin_m + s * instant.wand.direction),
                   &centre_px, &d_point)) {
        continue;
      }
      marker.centre_px = centre_px;
      marker.velocity_px_s =
          d_point *
          (camera.cam_from_rig.rotation *
           (instant.origin_velocity_m_s + instant.turn_rad_s.cross(s * instant.wand.direction)));
      marker.centre_px += true_offset_s[seen.camera] * marker.velocity_px_s;
      const Eigen::LLT<Eigen::Matrix2d> factor(seen.covariance_px2);
      marker.centre_px += factor.matrixL() * noise();
      marker.sqrt_information = factor.matrixL().solve(Eigen::Matrix2d::Identity());
      server::BundleObservation observation;
      observation.camera = observation.clock = seen.camera;
      observation.first_marker = static_cast<int>(problem.markers.size());
      observation.marker_count = 1;
      problem.markers.push_back(marker);
      problem.observations.push_back(observation);
    }
    entry.observation_count =
        static_cast<int>(problem.observations.size()) - entry.first_observation;
    problem.instants.push_back(entry);
  }
  server::BundleOptions solve;
  solve.robust = false;
  EXPECT_THAT(server::SolveBundle(solve, &problem), IsOk());

  Eigen::VectorXd error = Eigen::VectorXd::Zero(bound.covariance.rows());
  for (int c = 0; c < bound.camera_count; ++c) {
    const auto i = static_cast<size_t>(c);
    if (bound.PoseIndex(c) >= 0) {
      const PoseError pose =
          ErrorOf(problem.cameras[i].cam_from_rig, truth.cameras[i].cam_from_rig);
      error.segment<3>(bound.PoseIndex(c)) = pose.rotation_rad;
      error.segment<3>(bound.PoseIndex(c) + 3) = pose.position_m;
      if (options.time_offsets) {
        error[bound.TimeOffsetIndex(c)] = problem.clocks[i].time_offset_s - true_offset_s[c];
      }
    }
    if (options.intrinsics) {
      const auto count = options.intrinsics_sigma.size();
      error.segment(bound.first_intrinsics + c * count, count) =
          problem.cameras[i].intrinsics - ToVector(truth.cameras[i].intrinsics);
    }
  }
  if (options.marker_positions) {
    for (size_t m = 1; m < truth.marker_positions_m.size(); ++m) {
      error[bound.first_marker_position + static_cast<int>(m) - 1] =
          problem.target.marker_positions_m[m] - truth.marker_positions_m[m];
    }
  }
  return error;
}

NeesSum MonteCarlo(const TrueRig& rig, const InformationOptions& options, int trials) {
  NeesSum sum;
  const absl::StatusOr<RigBound> bound = ComputeRigBound(rig, options);
  EXPECT_THAT(bound, IsOk());
  if (!bound.ok()) return sum;
  for (int trial = 0; trial < trials; ++trial) {
    const Eigen::VectorXd error = EstimateOnce(rig, options, *bound, static_cast<uint64_t>(trial));
    sum.Add(NormalisedErrorSquared(error, bound->covariance));
    EXPECT_EQ(sum.dof() / sum.trials(), bound->covariance.rows());
  }
  return sum;
}

// At 0.3 px the problem is nearly linear and the plain estimate reaches the bound: the errors of an
// independent solver, normalised by it, are chi-square. A bound off by 10 % in variance would be
// found.
TEST(RigBound, IsWhatLeastSquaresReaches) {
  const NeesSum poses = MonteCarlo(SmallRig(), {}, 250);
  EXPECT_EQ(poses.dof(), 250 * 12);
  EXPECT_TRUE(poses.ConsistentInterval(0.999).Contains(poses.Ratio())) << poses.Ratio();
}

// The priors are narrow enough for the bound at their middle to be that at every draw.
TEST(RigBound, HoldsOverPriorsOfSpansOffsetsAndIntrinsics) {
  InformationOptions options;
  options.marker_positions = options.time_offsets = options.intrinsics = true;
  options.intrinsics_sigma.resize(9);
  options.intrinsics_sigma << 1, 1, 1, 1, 3e-3, 3e-3, 2e-4, 2e-4, 3e-3;
  const NeesSum all = MonteCarlo(SmallRig(), options, 400);
  EXPECT_EQ(all.dof(), 400 * (12 + 2 + 2 + 27));
  EXPECT_TRUE(all.ConsistentInterval(0.999).Contains(all.Ratio())) << all.Ratio();
}

TEST(RigBound, ScalesWithTheNoiseAndShrinksWithMoreInstants) {
  const TrueRig rig = SmallRig();
  const RigBound once = *ComputeRigBound(rig, {});
  TrueRig twice = rig;
  twice.instants.insert(twice.instants.end(), rig.instants.begin(), rig.instants.end());
  const RigBound half = *ComputeRigBound(twice, {});
  const RigBound noisy = *ComputeRigBound(SmallRig(";noise=0.6"), {});
  for (const int c : {1, 2}) {
    EXPECT_NEAR(half.PositionCovariance(c).trace() / once.PositionCovariance(c).trace(), 0.5, 1e-6);
    EXPECT_NEAR(noisy.PositionCovariance(c).trace() / once.PositionCovariance(c).trace(), 4, 0.2);
  }
}

TEST(RigBound, MoreUnknownsNeverMakeItSmaller) {
  const TrueRig rig = SmallRig();
  InformationOptions options;
  double before = ComputeRigBound(rig, options)->PositionCovariance(1).trace();
  options.marker_positions = true;
  double after = ComputeRigBound(rig, options)->PositionCovariance(1).trace();
  EXPECT_GT(after, 1.01 * before);
  before = after;
  options.time_offsets = true;
  after = ComputeRigBound(rig, options)->PositionCovariance(1).trace();
  EXPECT_GT(after, before);
  options.span_sigma_m = 1e-9;
  options.time_offsets = false;
  after = ComputeRigBound(rig, options)->PositionCovariance(1).trace();
  EXPECT_NEAR(after, ComputeRigBound(rig, {})->PositionCovariance(1).trace(), 1e-6 * after);
}

TEST(RigBound, SaysWhenTheRigCannotBeKnown) {
  TrueRig rig = SmallRig();
  rig.instants.resize(1);
  EXPECT_FALSE(ComputeRigBound(rig, {}).ok());
  rig = SmallRig();
  for (TrueInstant& instant : rig.instants) {
    std::erase_if(instant.markers, [](const SeenMarker& seen) { return seen.camera == 2; });
  }
  EXPECT_THAT(ComputeRigBound(rig, {}),
              StatusIs(absl::StatusCode::kFailedPrecondition, HasSubstr("in no observation")));
}

}  // namespace
}  // namespace rigcal::accuracy::rig_information_test

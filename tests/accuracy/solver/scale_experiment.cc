// SPDX-License-Identifier: Apache-2.0
#include "tests/accuracy/solver/scale_experiment.h"

#include <cmath>
#include <random>
#include <utility>

#include "common/scale/scale_fusion.h"
#include "common/status/status_macros.h"
#include "server/solve/calibrate.h"
#include "tests/accuracy/rig/calibration_errors.h"
#include "tests/server/solve/simulated_input.h"

namespace rigcal::accuracy {
namespace {

constexpr double kBarM = 1;
constexpr double kBarS = 10;

// The bar, waved by the same rig after the wand: the noise is another.
absl::StatusOr<std::vector<CameraRows>> BarRows(SimulationOptions simulation) {
  simulation.length_sigma_m = 0;
  Target bar;
  bar.marker_positions_m = {0, kBarM};
  RIGCAL_ASSIGN_OR_RETURN(const SimulatedWorld world, SimulatedWorld::Create(simulation, bar));
  std::vector<CameraRows> rows;
  for (int c = 0; c < static_cast<int>(world.cameras().size()); ++c) {
    CameraRows& camera = rows.emplace_back();
    camera.camera = world.cameras()[static_cast<size_t>(c)].description.camera;
    const int first = world.FrameCount(c);
    const int count = static_cast<int>(kBarS * simulation.rate_hz);
    for (int i = 0; i < count; ++i) {
      camera.rows.push_back(world.ObserveWand(c, first + i, world.WandAt(i / simulation.rate_hz)));
    }
  }
  return rows;
}

absl::Status FuseAll(const SimulatedWorld& world, const ScaleSigmas& sigmas, double wrong_rel,
                     ScaleTrial* trial) {
  const server::CalibrationOutcome outcome = server::Calibrate(server::InputOf(world), {});
  RIGCAL_RETURN_IF_ERROR(outcome.result.status());
  const CalibrationResult& calibration = *outcome.result;
  const CameraCovariance covariance = UnpackCameraCovariance(calibration);
  std::mt19937_64 random(77 + world.options().seed);
  std::normal_distribution<double> normal;

  std::vector<ScaleSource> sources;
  RIGCAL_ASSIGN_OR_RETURN(ScaleSource target, ScaleOfTarget(calibration));
  sources.push_back(std::move(target));
  const double distance_m = (world.cameras()[0].cam_from_rig.SourceFromTargetTranslation() -
                             world.cameras()[1].cam_from_rig.SourceFromTargetTranslation())
                                .norm();
  RIGCAL_ASSIGN_OR_RETURN(
      ScaleSource cameras,
      ScaleOfCameras(calibration, covariance, "sim_0", "sim_1",
                     distance_m + sigmas.cameras_m * normal(random), sigmas.cameras_m));
  sources.push_back(std::move(cameras));
  RIGCAL_ASSIGN_OR_RETURN(std::vector<CameraRows> rows, BarRows(world.options()));
  TriangulationOptions options;
  options.sigma_px = world.options().noise_px;
  RIGCAL_ASSIGN_OR_RETURN(const Triangulation bar,
                          TriangulateRows(calibration, std::move(rows), options));
  RIGCAL_ASSIGN_OR_RETURN(ScaleSource length,
                          ScaleOfMarkers(calibration, covariance, bar, 0, 1,
                                         kBarM + sigmas.bar_m * normal(random), sigmas.bar_m));
  sources.push_back(std::move(length));

  const ScaleFusion fusion = FuseScales(sources, covariance);
  // The wand of the calibration is the true one times the error of its scale.
  const double true_change = std::log(world.true_target().marker_positions_m.back() /
                                      calibration.target.marker_positions_m.back());
  trial->error_rel = std::log(fusion.factor) - true_change;
  trial->sigma_rel = fusion.sigma_rel;
  trial->wand_sigma_rel = calibration.target.scale_sigma_rel;
  trial->false_alarm = fusion.odd >= 0;
  for (int wrong = 0; wrong < kScaleSources; ++wrong) {
    std::vector<ScaleSource> disturbed = sources;
    disturbed[static_cast<size_t>(wrong)].given_m *= 1 + wrong_rel;
    const ScaleFusion with = FuseScales(disturbed, covariance);
    trial->named[wrong] = with.odd == wrong;
    trial->other_named[wrong] = with.odd >= 0 && with.odd != wrong;
    trial->own_sigma_rel[wrong] = with.residuals[static_cast<size_t>(wrong)].own_sigma_rel;
  }
  return absl::OkStatus();
}

}  // namespace

ScaleTrial RunScaleTrial(const SimulationOptions& simulation, const ScaleSigmas& sigmas,
                         double wrong_rel) {
  Target target;
  target.marker_positions_m = {0, 0.2, 0.6};
  target.span_tolerance_m = sigmas.wand_span_m;
  SimulationOptions options = simulation;
  options.length_sigma_m = sigmas.wand_span_m;
  ScaleTrial trial;
  const absl::StatusOr<SimulatedWorld> world = SimulatedWorld::Create(options, target);
  trial.status = world.ok() ? FuseAll(*world, sigmas, wrong_rel, &trial) : world.status();
  return trial;
}

}  // namespace rigcal::accuracy

// SPDX-License-Identifier: Apache-2.0
#include <Eigen/LU>
#include <Eigen/SVD>
#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include "absl/strings/str_format.h"
#include "common/camera/camera_model.h"
#include "common/camera/intrinsics_vector.h"
#include "server/solve/diagnose/finding_causes.h"
#include "server/solve/rig/intrinsics_prior.h"

namespace rigcal::server {
namespace {

// How far a trial may go from what was given, one sigma: a wrong file, a lens that was changed.
constexpr IntrinsicsPrior kWidePrior = {.focal_share = 0.2,
                                        .centre_share = 0.05,
                                        .radial = 0.2,
                                        .radial_high = 0.3,
                                        .tangential = 0.01};
constexpr double kMinDisplacementPx = 1;
constexpr double kIntrinsicsSigmas = 5;
constexpr double kMinIntrinsicsGain = 0.1;
// Refined intrinsics further away than this many sigmas of their prior.
constexpr double kPriorSigmas = 3;
constexpr size_t kMaxRays = 1000;
// All cameras' intrinsics at once are the dearest of trials: of so many observations, or so many of
// each camera. A pixel is seen in fewer.
constexpr size_t kSuspectObservations = 10'000;
constexpr size_t kSuspectViews = 150;

struct Rays {
  std::vector<Eigen::Vector3d> given, found;  // unit, of the same pixels
  std::vector<Eigen::Vector2d> pixels;
};

Rays RaysOf(const BundleProblem& problem, size_t camera, const Intrinsics& given,
            const Intrinsics& found) {
  std::vector<Eigen::Vector2d> pixels;
  ForEachMarker(problem, [&](size_t, const BundleObservation& observation, size_t m) {
    if (observation.camera == static_cast<int>(camera) && problem.markers[m].used) {
      pixels.push_back(problem.markers[m].centre_px);
    }
  });
  Rays rays;
  const size_t stride = 1 + pixels.size() / kMaxRays;
  for (size_t i = 0; i < pixels.size(); i += stride) {
    const auto a = Undistort(given, pixels[i]), b = Undistort(found, pixels[i]);
    if (!a.ok() || !b.ok()) continue;
    rays.given.push_back(Eigen::Vector3d(a->x(), a->y(), 1).normalized());
    rays.found.push_back(Eigen::Vector3d(b->x(), b->y(), 1).normalized());
    rays.pixels.push_back(pixels[i]);
  }
  return rays;
}

// Root mean square of how far the same directions lie apart in the image under the camera's present
// intrinsics and the given ones (its priors' mean), where it saw the wand, after the rotation that
// brings them closest: a turn of the camera hides a moved centre.
double DisplacementPx(const BundleProblem& problem, size_t index) {
  const BundleCamera& camera = problem.cameras[index];
  const Intrinsics found = FromVector(camera.model, camera.intrinsics);
  const Rays rays = RaysOf(problem, index, FromVector(camera.model, camera.intrinsics_mean), found);
  if (rays.pixels.size() < 3) return 0;
  Eigen::Matrix3d sum = Eigen::Matrix3d::Zero();
  for (size_t i = 0; i < rays.pixels.size(); ++i) sum += rays.found[i] * rays.given[i].transpose();
  const Eigen::JacobiSVD<Eigen::Matrix3d> svd(sum, Eigen::ComputeFullU | Eigen::ComputeFullV);
  Eigen::Matrix3d turn = svd.matrixU() * svd.matrixV().transpose();
  if (turn.determinant() < 0) return 0;
  double squares = 0;
  int count = 0;
  for (size_t i = 0; i < rays.pixels.size(); ++i) {
    Eigen::Vector2d pixel;
    if (!Project(found, turn * rays.given[i], &pixel)) continue;
    squares += (pixel - rays.pixels[i]).squaredNorm();
    ++count;
  }
  return count == 0 ? 0 : std::sqrt(squares / count);
}

// The largest of focal lengths' and centre's changes, in sigmas.
double Significance(const TrialSigmas& sigmas, int camera, const IntrinsicsVector& change) {
  double largest = 0;
  for (int i = 0; i < 5; ++i) {
    const double sigma = sigmas.Of({ReducedParameterKind::kIntrinsic, camera, i});
    largest = std::max(largest, std::abs(change[i]) / sigma);
  }
  return largest;
}

std::string Changes(const BundleCamera& camera) {
  const IntrinsicsVector &given = camera.intrinsics_mean, &found = camera.intrinsics;
  return absl::StrFormat(
      "focal lengths %+.2f %% and %+.2f %%, centre (%+.1f, %+.1f) px against the given ones",
      100 * (found[0] / given[0] - 1), 100 * (found[1] / given[1] - 1), found[2] - given[2],
      found[3] - given[3]);
}

void Free(const CauseInput& input, size_t camera, BundleProblem* problem) {
  SetIntrinsicsPrior(input.rig.index.cameras[input.trial.rig_camera[camera]],
                     &problem->cameras[camera], kWidePrior);
}

// Cameras whose intrinsics, all of them free, go away from the given ones for a reason.
std::vector<size_t> Suspects(const CauseInput& input) {
  BundleProblem problem = input.trial.problem;
  UseSome(std::max(kSuspectObservations, kSuspectViews * problem.cameras.size()), &problem);
  for (size_t c = 0; c < problem.cameras.size(); ++c) Free(input, c, &problem);
  if (!SolveTrialFromAfar(input.trial.bundle, &problem).ok()) return {};
  const auto sigmas = ComputeSigmas(input.trial.bundle, problem);
  if (!sigmas.ok()) return {};
  std::vector<size_t> suspects;
  for (size_t c = 0; c < problem.cameras.size(); ++c) {
    const BundleCamera& camera = problem.cameras[c];
    const IntrinsicsVector change = camera.intrinsics - camera.intrinsics_mean;
    if (Significance(*sigmas, static_cast<int>(c), change) > kIntrinsicsSigmas &&
        DisplacementPx(problem, c) > kMinDisplacementPx) {
      suspects.push_back(c);
    }
  }
  return suspects;
}

}  // namespace

Repair RepairIntrinsics(const CauseInput& input) {
  Repair repair;
  if (input.evaluated.options.refine_intrinsics) return repair;
  const std::vector<size_t> suspects = Suspects(input);
  if (suspects.empty()) return repair;
  repair.repaired = input.trial;
  BundleProblem& problem = repair.repaired.problem;
  for (const size_t c : suspects) Free(input, c, &problem);
  if (!SolveTrialFromAfar(input.trial.bundle, &problem).ok()) return repair;
  const std::vector<ErrorChange> changes = CompareErrors(input.trial.problem, problem);
  for (const size_t c : suspects) {
    const BundleCamera& camera = problem.cameras[c];
    const double displacement_px = DisplacementPx(problem, c);
    if (changes[c].gain() < kMinIntrinsicsGain || displacement_px < kMinDisplacementPx) continue;
    repair.causes.push_back(
        {{FindingKind::kWrongIntrinsics, camera.name, displacement_px, "px",
          absl::StrFormat(
              "its given intrinsics put what it sees %.1f px (rms) away from where it is: %s; its "
              "error is %.2f px, and %.2f px with intrinsics that fit. Calibrate its lens again "
              "(zoom and focus as they are now), or calibrate with intrinsics refined",
              displacement_px, Changes(camera), changes[c].before_px, changes[c].after_px)},
         changes[c].gain_px()});
  }
  return repair;
}

std::vector<Cause> FindFarIntrinsics(const CauseInput& input) {
  std::vector<Cause> causes;
  if (!input.evaluated.options.refine_intrinsics) return causes;
  const BundleProblem& solved = input.trial.problem;
  for (size_t c = 0; c < solved.cameras.size(); ++c) {
    const BundleCamera& camera = solved.cameras[c];
    const bool apart = input.trial.rig_camera[c] != c;
    if (camera.intrinsics_fixed || apart) continue;
    const IntrinsicsVector change = camera.intrinsics - camera.intrinsics_mean;
    double prior_sigmas = 0;
    for (int i = 0; i < 4; ++i) {
      if (camera.intrinsics_sigma[i] <= 0) continue;
      prior_sigmas = std::max(prior_sigmas, std::abs(change[i]) / camera.intrinsics_sigma[i]);
    }
    const double displacement_px = DisplacementPx(solved, c);
    if (prior_sigmas < kPriorSigmas || displacement_px < kMinDisplacementPx) continue;
    BundleProblem given = solved;
    given.cameras[c].intrinsics = camera.intrinsics_mean;
    given.cameras[c].intrinsics_fixed = true;
    if (!SolveTrialFromAfar(input.trial.bundle, &given).ok()) continue;
    const ErrorChange change_px = CompareErrors(given, solved)[c];
    if (change_px.gain() < kMinIntrinsicsGain) continue;
    causes.push_back(
        {{FindingKind::kWrongIntrinsics, camera.name, displacement_px, "px",
          absl::StrFormat(
              "its refined intrinsics are far from the given ones, by %.1f px (rms) where it saw "
              "the wand: %s; its error is %.2f px with the given ones, %.2f px with the refined "
              "ones. The refined ones are used; check that it was given its own file, and "
              "calibrate its lens again",
              displacement_px, Changes(camera), change_px.before_px, change_px.after_px)},
         change_px.gain_px()});
  }
  return causes;
}

}  // namespace rigcal::server

// SPDX-License-Identifier: Apache-2.0
#include <Eigen/LU>
#include <Eigen/SVD>
#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <string>
#include <vector>

#include "absl/strings/str_format.h"
#include "common/camera/camera_model.h"
#include "common/camera/intrinsics_vector.h"
#include "server/solve/diagnose/finding_causes.h"
#include "server/solve/evaluate/given_intrinsics.h"
#include "server/solve/evaluate/lens_fit.h"
#include "server/solve/evaluate/placed_views.h"
#include "server/solve/rig/intrinsics_prior.h"

namespace rigcal::server {
namespace {

constexpr double kMinDisplacementPx = 1;
constexpr double kIntrinsicsSigmas = 5;
constexpr int kComparedIntrinsics = 5;  // focal lengths, centre, first coefficient
constexpr double kMinIntrinsicsGain = 0.1;
// Refined intrinsics further away than this many sigmas of their prior.
constexpr double kPriorSigmas = 3;
// Or, where the data contradict the given ones beyond chance, this many of a focal length's.
constexpr double kContradictedSigmas = 1.35;
constexpr double kContradiction = 1e-6;  // significance of that
// Of the variance of a focal length.
constexpr double kMaxPriorShare = 0.5;
constexpr size_t kMaxRays = 1000;
// Of the image's width, that the middle of a turned image is elsewhere; and of that, how near to it
// a centre is.
constexpr double kLeastTurned = 0.02, kNearMiddle = 0.35;
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
// intrinsics and `other` ones, where it saw the wand, after the rotation that brings them closest:
// a turn of the camera hides a moved centre.
double DisplacementPx(const BundleProblem& problem, size_t index, const Intrinsics& other) {
  const BundleCamera& camera = problem.cameras[index];
  const Intrinsics found = FromVector(camera.model, camera.intrinsics);
  const Rays rays = RaysOf(problem, index, other, found);
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

// From the given ones, the mean of its priors.
double DisplacementPx(const BundleProblem& problem, size_t index) {
  const BundleCamera& camera = problem.cameras[index];
  return DisplacementPx(problem, index, FromVector(camera.model, camera.intrinsics_mean));
}

// Another camera whose given intrinsics are those that fit here: files that were swapped. Empty:
// none.
std::string SwappedWith(const CauseInput& input, const BundleProblem& problem, size_t index) {
  const std::vector<CameraDescription>& cameras = input.rig.index.cameras;
  const size_t own = input.trial.rig_camera[index];
  for (size_t c = 0; c < cameras.size(); ++c) {
    if (c == own || cameras[c].image_size_px.width != cameras[own].image_size_px.width ||
        cameras[c].image_size_px.height != cameras[own].image_size_px.height) {
      continue;
    }
    // Lenses of one kind are alike: the other one's must not be wrong here by itself.
    if (DisplacementPx(problem, index, *cameras[c].intrinsics) < kMinDisplacementPx) {
      return absl::StrFormat(
          ". The intrinsics that were given to camera %s fit it: look whether files were "
          "swapped",
          cameras[c].camera);
    }
  }
  return "";
}

// The largest of focal lengths' and centre's changes, in sigmas.
double Significance(const TrialSigmas& sigmas, int camera, const IntrinsicsVector& change) {
  double largest = 0;
  for (int i = 0; i < kComparedIntrinsics; ++i) {
    const double sigma = sigmas.Of({ReducedParameterKind::kIntrinsic, camera, i});
    largest = std::max(largest, std::abs(change[i]) / sigma);
  }
  return largest;
}

// Images that were turned, or whose rows exchange x and y: the middle of one is elsewhere.
bool IsMiddleOfTurned(const BundleCamera& camera, const ImageSize& size_px) {
  const Eigen::Vector2d turned_px =
      0.5 * Eigen::Vector2d(size_px.height - size_px.width, size_px.width - size_px.height);
  const Eigen::Vector2d moved_px = (camera.intrinsics - camera.intrinsics_mean).segment<2>(2);
  return turned_px.norm() > kLeastTurned * size_px.width &&
         (moved_px - turned_px).norm() < kNearMiddle * turned_px.norm();
}

std::string Changes(const BundleCamera& camera, const ImageSize& size_px) {
  const IntrinsicsVector &given = camera.intrinsics_mean, &found = camera.intrinsics;
  // Images that were made smaller or larger: everything is times the same factor.
  std::string scaled;
  for (const double factor : {0.25, 0.5, 2.0, 4.0}) {
    const auto fits = [&](int i) { return std::abs(found[i] / (factor * given[i]) - 1) < 0.08; };
    if (fits(0) && fits(1) && fits(2) && fits(3)) {
      scaled = absl::StrFormat(
          ", as if its images were %.3g times as large as those of its lens file: binning?",
          factor);
    }
  }
  if (IsMiddleOfTurned(camera, size_px)) {
    scaled =
        ", about the middle of an image that was turned by 90 degrees: its rows, or its lens file, "
        "are of turned images, or exchange x and y";
  }
  return absl::StrFormat(
      "focal lengths %+.2f %% and %+.2f %%, centre (%+.1f, %+.1f) px against the given ones%s",
      100 * (found[0] / given[0] - 1), 100 * (found[1] / given[1] - 1), found[2] - given[2],
      found[3] - given[3], scaled);
}

const ImageSize& SizeOf(const CauseInput& input, size_t camera) {
  return input.rig.index.cameras[input.trial.rig_camera[camera]].image_size_px;
}

void Free(const CauseInput& input, size_t camera, BundleProblem* problem) {
  SetIntrinsicsPrior(input.rig.index.cameras[input.trial.rig_camera[camera]],
                     &problem->cameras[camera], kWideIntrinsicsPrior);
}

// The same in a large rig, each camera by itself on targets that the others place.
std::vector<size_t> SuspectsByCamera(const CauseInput& input) {
  BundleProblem problem = input.trial.problem;
  const auto views = PlaceByOthers(problem, std::vector<bool>(problem.cameras.size(), true),
                                   kSuspectViews, std::numeric_limits<double>::infinity());
  std::vector<size_t> suspects;
  for (size_t c = 0; c < problem.cameras.size(); ++c) {
    BundleCamera& camera = problem.cameras[c];
    const BundleCamera before = camera;
    Free(input, c, &problem);
    LensFit fit;
    const bool fits = FitLens(views[c], camera, {.from_afar = true}, &fit);
    bool is_far = false;
    for (int i = 0; fits && i < kComparedIntrinsics; ++i) {
      const double change = fit.camera.intrinsics[i] - before.intrinsics[i];
      is_far = is_far || std::abs(change) > kIntrinsicsSigmas * fit.IntrinsicSigma(i);
    }
    if (is_far) {
      camera.intrinsics = fit.camera.intrinsics;
      is_far = DisplacementPx(problem, c, FromVector(before.model, before.intrinsics)) >
               kMinDisplacementPx;
    }
    camera = before;
    if (is_far) suspects.push_back(c);
  }
  return suspects;
}

// Cameras whose intrinsics, all of them free, go away from where they are for a reason.
std::vector<size_t> Suspects(const CauseInput& input) {
  if (input.trial.shares_few) return SuspectsByCamera(input);
  BundleProblem problem = input.trial.problem;
  UseSome(std::max(kSuspectObservations, kSuspectViews * problem.cameras.size()), &problem);
  for (size_t c = 0; c < problem.cameras.size(); ++c) Free(input, c, &problem);
  if (!SolveTrialFromAfar(input.trial.bundle, &problem).ok()) return {};
  const auto sigmas = ComputeSigmas(input.trial.bundle, problem);
  if (!sigmas.ok()) return {};
  std::vector<size_t> suspects;
  for (size_t c = 0; c < problem.cameras.size(); ++c) {
    const BundleCamera& before = input.trial.problem.cameras[c];
    const IntrinsicsVector change = problem.cameras[c].intrinsics - before.intrinsics;
    if (Significance(*sigmas, static_cast<int>(c), change) > kIntrinsicsSigmas &&
        DisplacementPx(problem, c, FromVector(before.model, before.intrinsics)) >
            kMinDisplacementPx) {
      suspects.push_back(c);
    }
  }
  return suspects;
}

// Of the given intrinsics, kept.
Cause WrongIntrinsics(const CauseInput& input, const BundleProblem& freed, size_t c,
                      const ErrorChange& change) {
  const BundleCamera& camera = freed.cameras[c];
  const double displacement_px = DisplacementPx(freed, c);
  return {{FindingKind::kWrongIntrinsics, camera.name, displacement_px, "px",
           absl::StrFormat(
               "its given intrinsics put what it sees %.1f px (rms) away from where it is: %s; its "
               "error is %.2f px, and %.2f px with intrinsics that fit. Calibrate its lens again "
               "(zoom and focus as they are now), or calibrate with intrinsics refined%s",
               displacement_px, Changes(camera, SizeOf(input, c)), change.before_px,
               change.after_px, SwappedWith(input, freed, c))},
          change.gain_px()};
}

// Of intrinsics that were refined, but not as far as the data would have gone.
Cause HeldIntrinsics(const CauseInput& input, const BundleProblem& freed, size_t c,
                     const ErrorChange& change) {
  const BundleCamera& camera = freed.cameras[c];
  const IntrinsicsVector& refined = input.trial.problem.cameras[c].intrinsics;
  const double focal_percent = 100 * std::max(std::abs(camera.intrinsics[0] / refined[0] - 1),
                                              std::abs(camera.intrinsics[1] / refined[1] - 1));
  return {{FindingKind::kIntrinsicsFromPrior, camera.name, focal_percent, "%",
           absl::StrFormat(
               "its refined intrinsics are held by the given ones, which are wrong: left free, the "
               "data put them at %s; its error is %.2f px, and %.2f px with these. Was its file "
               "guessed, or is it another camera's? Calibrate its lens%s",
               Changes(camera, SizeOf(input, c)), change.before_px, change.after_px,
               SwappedWith(input, freed, c))},
          change.gain_px()};
}

}  // namespace

Repair RepairIntrinsics(const CauseInput& input) {
  Repair repair;
  // What was held out has said already that other intrinsics are no better.
  if (input.evaluated.refined_by_chance) return repair;
  const std::vector<size_t> suspects = Suspects(input);
  if (suspects.empty()) return repair;
  repair.repaired = input.trial;
  BundleProblem& problem = repair.repaired.problem;
  for (const size_t c : suspects) Free(input, c, &problem);
  if (!SolveTrialFromAfar(input.trial.bundle, &problem).ok()) return repair;
  const std::vector<ErrorChange> changes = CompareErrors(input.trial.problem, problem);
  for (const size_t c : suspects) {
    const BundleCamera& before = input.trial.problem.cameras[c];
    if (changes[c].gain() < kMinIntrinsicsGain ||
        DisplacementPx(problem, c, FromVector(before.model, before.intrinsics)) <
            kMinDisplacementPx) {
      continue;
    }
    repair.causes.push_back(input.evaluated.options.refine_intrinsics
                                ? HeldIntrinsics(input, problem, c, changes[c])
                                : WrongIntrinsics(input, problem, c, changes[c]));
  }
  return repair;
}

std::vector<Cause> FindFarIntrinsics(const CauseInput& input) {
  std::vector<Cause> causes;
  if (!input.evaluated.options.refine_intrinsics) return causes;
  const BundleProblem& solved = input.trial.problem;
  GivenIntrinsicsTest test;
  if (input.evaluated.uncertainty) {
    test = TestGivenIntrinsics(input.evaluated.solution.built.problem, *input.evaluated.uncertainty,
                               kContradiction);
  }
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
    const double focal_sigmas =
        change.head<2>().cwiseQuotient(camera.intrinsics_sigma.head<2>()).cwiseAbs().maxCoeff();
    const bool contradicted =
        c < test.disagrees.size() && test.disagrees[c] && focal_sigmas > kContradictedSigmas;
    if (!(prior_sigmas > kPriorSigmas || contradicted) || displacement_px < kMinDisplacementPx) {
      continue;
    }
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
              "calibrate its lens again%s",
              displacement_px, Changes(camera, SizeOf(input, c)), change_px.before_px,
              change_px.after_px, SwappedWith(input, solved, c))},
         change_px.gain_px()});
  }
  return causes;
}

std::vector<Cause> FindPriorIntrinsics(const CauseInput& input) {
  std::vector<Cause> causes;
  const std::optional<RigUncertainty>& uncertainty = input.evaluated.uncertainty;
  if (!input.evaluated.options.refine_intrinsics || !uncertainty) return causes;
  const BundleProblem& problem = input.evaluated.solution.built.problem;
  const std::vector<Eigen::Vector4d> shares = PriorShares(problem, *uncertainty);
  for (size_t c = 0; c < shares.size(); ++c) {
    const double share = shares[c].head<2>().maxCoeff();
    if (!(share > kMaxPriorShare)) continue;
    const double focal_percent =
        100 * uncertainty->cameras[c].intrinsics_sigma[0] / problem.cameras[c].intrinsics[0];
    causes.push_back(
        {{FindingKind::kIntrinsicsFromPrior, problem.cameras[c].name, focal_percent, "%",
          absl::StrFormat(
              "%.0f %% of what is known of its focal length is what was given, not what the data "
              "say (one sigma: %.2f %%): it is right only as far as its file is. Wave the wand "
              "nearer and farther, and turn it towards the cameras, or calibrate its lens",
              100 * share, focal_percent)},
         0});
  }
  return causes;
}

}  // namespace rigcal::server

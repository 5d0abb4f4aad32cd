// SPDX-License-Identifier: Apache-2.0
#include "common/lens/lens_solver.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include "absl/strings/str_cat.h"
#include "common/camera/camera_model.h"
#include "common/lens/circle_image.h"
#include "common/lens/held_out_views.h"
#include "common/lens/lens_adjustment.h"
#include "common/lens/lens_advice.h"
#include "common/lens/lens_start.h"
#include "common/lens/view_coverage.h"
#include "common/lens/view_outliers.h"
#include "common/statistics/robust_statistics.h"
#include "common/status/status_macros.h"

namespace rigcal {
namespace {

constexpr int kStepsToGoOn = 4;     // from a solution of most of the views
constexpr double kMuchWorse = 1.5;  // a family's held-out error over the least one
constexpr double kAsGood = 1.02;    // of the least held-out error: the simpler model wins ...

// Cauchy's losses of the first solve, from far to near.
constexpr double kWideLossPx = 20;
constexpr double kNarrowLossPx = 1;

constexpr int kBlindGrid = 21;
constexpr double kBendSigmas = 5;

// The images of circles depend on where the boards are, which depends on them, by little.
constexpr int kEccentricityRounds = 2;

// Corners of all views, one behind the other.
std::vector<double> ErrorsOf(const std::vector<BoardView>& views, const LensEstimate& estimate) {
  std::vector<double> errors;
  for (size_t i = 0; i < views.size(); ++i) {
    const auto of_view = CornerErrors(views[i], estimate.intrinsics, estimate.cam_from_board[i]);
    errors.insert(errors.end(), of_view.begin(), of_view.end());
  }
  return errors;
}

double TiltDeg(const RigidTransform& cam_from_board) {
  const Eigen::Vector3d normal = cam_from_board.rotation * Eigen::Vector3d::UnitZ();
  return std::acos(std::min(1.0, std::abs(normal.z()))) * 180 / std::numbers::pi;
}

// A model begins where a simpler one of its family has ended.
LensEstimate Enriched(const LensEstimate& simpler, LensModel model) {
  LensEstimate start = simpler;
  start.model = model;
  start.intrinsics.model = DistortionModelOf(model);
  start.intrinsics.distortion.resize(static_cast<size_t>(CoefficientCount(start.intrinsics.model)),
                                     0.0);
  return start;
}

// A model's robust solve of all views.
absl::StatusOr<LensEstimate> SolveRobustly(LensModel model, const ImageSize& image_size_px,
                                           const std::vector<BoardView>& views,
                                           const LensEstimate* simpler) {
  LensEstimate start;
  if (simpler != nullptr) {
    start = Enriched(*simpler, model);
  } else {
    RIGCAL_ASSIGN_OR_RETURN(start, StartLens(model, image_size_px, views));
  }
  for (const double loss : {kWideLossPx, kNarrowLossPx}) {
    LensAdjustmentOptions options;
    options.loss_px = loss;
    start = AdjustLens(views, start, options).estimate;
    start.noise_px =
        std::max(UpperMedian(ErrorsOf(views, start)) / kMedianOfRayleigh, kLeastNoisePx);
  }
  return start;
}

double LeastHeldOut(const LensSolution& solution) {
  double least = std::numeric_limits<double>::infinity();
  for (const LensCandidate& candidate : solution.candidates) {
    least = std::min(least, candidate.held_out_rms_px);
  }
  return least;
}

// From a solve of most of these views. None: the model was not in it, and there is no simpler one.
std::optional<LensEstimate> GoOn(LensModel model, const std::vector<BoardView>& views,
                                 const LensSolution& previous, const LensEstimate* simpler) {
  const auto before =
      std::find_if(previous.candidates.begin(), previous.candidates.end(),
                   [&](const LensCandidate& candidate) { return candidate.model == model; });
  // What has gone astray begins again.
  const bool is_astray = simpler != nullptr && before != previous.candidates.end() &&
                         before->held_out_rms_px > kMuchWorse * LeastHeldOut(previous);
  LensEstimate start;
  if (before != previous.candidates.end() && !is_astray) {
    start = before->estimate;
    start.cam_from_board.clear();
    for (const BoardView& view : views) {
      const auto same =
          std::find_if(previous.view_results.begin(), previous.view_results.end(),
                       [&](const LensViewResult& result) { return result.name == view.name; });
      start.cam_from_board.push_back(
          same != previous.view_results.end() && same->left_out.empty()
              ? before->estimate
                    .cam_from_board[static_cast<size_t>(same - previous.view_results.begin())]
              : PlaceBoard(model, view, start.intrinsics).cam_from_board);
    }
  } else if (simpler != nullptr) {
    start = Enriched(*simpler, model);
  } else {
    return std::nullopt;
  }
  LensAdjustmentOptions options;
  options.loss_px = kNarrowLossPx;
  options.max_steps = kStepsToGoOn;
  return AdjustLens(views, start, options).estimate;
}

// Of the models of its family the best one predicts views as well as any other, or nearly.
bool IsFamilyOfUse(bool is_fisheye, const LensSolution& previous) {
  double of_family = std::numeric_limits<double>::infinity();
  for (const LensCandidate& candidate : previous.candidates) {
    if ((candidate.model == LensModel::kFisheye) != is_fisheye) continue;
    of_family = std::min(of_family, candidate.held_out_rms_px);
  }
  return of_family <= kMuchWorse * LeastHeldOut(previous);
}

std::optional<LensDifference> CompareHalves(const std::vector<BoardView>& views,
                                            const LensEstimate& estimate,
                                            const ImageSize& image_size_px) {
  Intrinsics lenses[2];
  for (size_t half = 0; half < 2; ++half) {
    const ViewSubset subset = Subset(views, estimate, [&](size_t i) { return i % 2 == half; });
    lenses[half] = AdjustLens(subset.views, subset.estimate).estimate.intrinsics;
  }
  const absl::StatusOr<LensDifference> difference =
      CompareLenses(lenses[0], lenses[1], image_size_px);
  return difference.ok() ? std::optional(*difference) : std::nullopt;
}

// What is uncertain of the intrinsics of a solution with this information.
void SetUncertainty(const Eigen::MatrixXd& information, const ImageSize& image_size_px,
                    LensSolution* solution) {
  solution->information = information;
  const Eigen::MatrixXd covariance = CovarianceOf(information);
  solution->uncertainty =
      LensSensitivity(solution->model, solution->intrinsics, image_size_px).Of(covariance);
  solution->sigmas =
      Eigen::VectorXd::Constant(information.rows(), std::numeric_limits<double>::infinity());
  if (covariance.size() > 0) solution->sigmas = covariance.diagonal().cwiseSqrt();
}

double BlindShare(const Intrinsics& intrinsics, const ImageSize& image_size_px) {
  int blind = 0;
  for (int row = 0; row < kBlindGrid; ++row) {
    for (int column = 0; column < kBlindGrid; ++column) {
      const Eigen::Vector2d pixel((image_size_px.width - 1.0) * column / (kBlindGrid - 1),
                                  (image_size_px.height - 1.0) * row / (kBlindGrid - 1));
      if (!Undistort(intrinsics, pixel).ok()) ++blind;
    }
  }
  return blind / static_cast<double>(kBlindGrid * kBlindGrid);
}

absl::Status CheckViews(const std::vector<BoardView>& views, const ImageSize& image_size_px) {
  RIGCAL_RETURN_IF_ERROR(image_size_px.Validate());
  for (const BoardView& view : views) {
    if (view.corners.size() < kLeastCornersOfView) {
      return absl::InvalidArgumentError(absl::StrCat(view.name, " has ", view.corners.size(),
                                                     " corners, which must be at least ",
                                                     kLeastCornersOfView));
    }
  }
  if (views.size() >= kLeastLensViews) return absl::OkStatus();
  return absl::FailedPreconditionError(
      absl::StrCat("a lens needs at least ", kLeastLensViews, " pictures that show the board, and ",
                   views.size(), views.size() == 1 ? " does" : " do",
                   "; 20 to 40 are good: tilted to every side, near and far, all over the image"));
}

// The views with the images of circles moved to those of their centres, as a solution has them.
std::vector<BoardView> WithoutEccentricity(const std::vector<BoardView>& views,
                                           const LensSolution& solution) {
  std::vector<BoardView> corrected = views;
  for (size_t i = 0; i < views.size(); ++i) {
    for (BoardCorner& corner : corrected[i].corners) {
      Eigen::Vector2d offset_px;
      if (corner.radius_m > 0 &&
          CircleOffset(solution.intrinsics, solution.view_results[i].cam_from_board,
                       corner.x_in_board_m, corner.radius_m, &offset_px)) {
        corner.pixel -= offset_px;
      }
    }
  }
  return corrected;
}

// Of points.
absl::StatusOr<LensSolution> SolveLensOnce(const std::vector<BoardView>& views,
                                           const ImageSize& image_size_px,
                                           const LensOptions& options) {
  // Every model on everything.
  std::vector<LensEstimate> estimates;
  absl::Status failure = absl::FailedPreconditionError("no lens to go on from");
  std::optional<LensEstimate> pinhole;
  for (const LensModel model : AllLensModels()) {
    const bool is_wanted = !options.model || *options.model == model;
    const bool is_pinhole = model != LensModel::kFisheye;
    // The richer pinholes begin with the simpler ones.
    if (!is_wanted && (!is_pinhole || *options.model == LensModel::kFisheye)) continue;
    if (!is_wanted && model > *options.model) continue;
    const LensEstimate* simpler = is_pinhole && pinhole ? &*pinhole : nullptr;
    std::optional<LensEstimate> estimate;
    if (options.previous != nullptr) {
      if (!IsFamilyOfUse(!is_pinhole, *options.previous)) continue;
      estimate = GoOn(model, views, *options.previous, simpler);
      if (!estimate) continue;
    } else {
      absl::StatusOr<LensEstimate> solved = SolveRobustly(model, image_size_px, views, simpler);
      if (!solved.ok()) {
        failure = solved.status();
        continue;
      }
      estimate = *std::move(solved);
    }
    if (is_pinhole) pinhole = *estimate;
    if (is_wanted) estimates.push_back(*std::move(estimate));
  }
  if (estimates.empty()) return failure;

  // What not even the best of them explains.
  const auto best = std::min_element(
      estimates.begin(), estimates.end(), [&](const LensEstimate& a, const LensEstimate& b) {
        return UpperMedian(ErrorsOf(views, a)) < UpperMedian(ErrorsOf(views, b));
      });
  const UsedCorners used = LeaveOutWrong(views, *best);
  const std::vector<BoardView> good = used.Of(views);
  if (good.size() < kLeastLensViews) {
    return absl::FailedPreconditionError(absl::StrCat(
        "only ", good.size(), " of ", views.size(),
        " views agree about a lens: are they all of one camera with one focus and zoom, and is the "
        "board flat?"));
  }

  LensSolution solution;
  std::vector<LensAdjustment> adjusted;
  std::vector<std::vector<std::vector<double>>> held_out;  // by model and view
  LensAdjustmentOptions adjusting;
  if (options.previous != nullptr) adjusting.max_steps = kStepsToGoOn;
  for (LensEstimate& estimate : estimates) {
    adjusted.push_back(AdjustLens(good, used.Of(estimate), adjusting));
    const LensEstimate& fitted = adjusted.back().estimate;
    held_out.push_back(HeldOutErrors(good, fitted, adjusting.max_steps));
    used.Into(fitted, &estimate);
    solution.candidates.push_back({.model = estimate.model,
                                   .rms_px = RmsOf(ErrorsOf(good, fitted)),
                                   .held_out_rms_px = RmsOfAll(held_out.back()),
                                   .estimate = estimate});
  }
  const auto least = std::min_element(solution.candidates.begin(), solution.candidates.end(),
                                      [](const LensCandidate& a, const LensCandidate& b) {
                                        return a.held_out_rms_px < b.held_out_rms_px;
                                      });
  const auto least_index = static_cast<size_t>(least - solution.candidates.begin());
  size_t chosen = 0;
  while (chosen < least_index &&
         (solution.candidates[chosen].held_out_rms_px > kAsGood * least->held_out_rms_px ||
          IsWorse(held_out[chosen], held_out[least_index]))) {
    ++chosen;
  }

  const LensAdjustment& result = adjusted[chosen];
  solution.model = result.estimate.model;
  solution.intrinsics = result.estimate.intrinsics;
  solution.rms_px = solution.candidates[chosen].rms_px;
  solution.held_out_rms_px = solution.candidates[chosen].held_out_rms_px;
  solution.views = static_cast<int>(good.size());
  for (const BoardView& view : good) solution.corners += static_cast<int>(view.corners.size());
  solution.noise_px = NoiseOf(result, good);
  const double noise_px = std::max(solution.noise_px, kLeastNoisePx);
  SetUncertainty(result.information / (noise_px * noise_px), image_size_px, &solution);
  RIGCAL_RETURN_IF_ERROR(solution.intrinsics.Validate(image_size_px));

  std::vector<double> tilts_deg;
  for (size_t i = 0, at = 0; i < views.size(); ++i) {
    LensViewResult& view = solution.view_results.emplace_back();
    view.name = views[i].name;
    view.corners = static_cast<int>(views[i].corners.size());
    view.left_out = used.left_out[i];
    const bool is_used = view.left_out.empty();
    const RigidTransform& pose = solution.candidates[chosen].estimate.cam_from_board[i];
    const BoardView& shown = is_used ? good[at] : views[i];
    view.cam_from_board = pose;
    view.tilt_deg = TiltDeg(pose);
    view.rms_px = RmsOf(CornerErrors(shown, solution.intrinsics, pose));
    if (!is_used) continue;
    view.left_out_corners = view.corners - static_cast<int>(shown.corners.size());
    tilts_deg.push_back(view.tilt_deg);
    ++at;
  }
  RIGCAL_RETURN_IF_ERROR(CheckTilt(solution, tilts_deg));
  solution.covered_share = CoveredShare(good, image_size_px);
  solution.blind_share = BlindShare(solution.intrinsics, image_size_px);
  if (options.previous != nullptr) return solution;
  solution.halves = CompareHalves(good, result.estimate, image_size_px);
  AddAdvice(image_size_px, good, tilts_deg, &solution);
  return solution;
}

// A solution's views that were used, solved once more together with the bend of the board.
BentAdjustment WithBend(const std::vector<BoardView>& views, const LensSolution& solution) {
  std::vector<BoardView> used;
  LensEstimate start;
  start.model = solution.model;
  start.intrinsics = solution.intrinsics;
  if (solution.bend) start.bend_per_m = solution.bend->per_m;
  start.noise_px = std::max(solution.noise_px, kLeastNoisePx);
  for (size_t i = 0; i < views.size(); ++i) {
    if (!solution.view_results[i].left_out.empty()) continue;
    used.push_back(views[i]);
    start.cam_from_board.push_back(solution.view_results[i].cam_from_board);
  }
  return AdjustWithBend(used, start, kNarrowLossPx);
}

// The lens together with the bend, where that predicts views that were held out better.
absl::StatusOr<LensSolution> SolveBent(const std::vector<BoardView>& views,
                                       const ImageSize& image_size_px, const LensOptions& options,
                                       const LensSolution& flat) {
  const BentAdjustment first = WithBend(views, flat);
  if (first.information.size() == 0) return flat;
  const Eigen::Array2d sigmas = first.bend.height_m.array() / first.bend.sigma_m.array();
  if (!(sigmas.abs().maxCoeff() > kBendSigmas)) return flat;
  absl::StatusOr<LensSolution> bent =
      SolveLensOnce(Bent(views, first.bend.per_m), image_size_px, options);
  if (!bent.ok() || kAsGood * bent->held_out_rms_px > flat.held_out_rms_px) return flat;
  bent->bend = first.bend;
  // What the bend leaves open is open of the lens, too.
  const BentAdjustment both = WithBend(views, *bent);
  if (both.information.size() == 0) return flat;
  bent->bend = both.bend;
  bent->intrinsics = both.adjusted.estimate.intrinsics;
  bent->noise_px = both.noise_px;
  SetUncertainty(both.information, image_size_px, &*bent);
  AddBendAdvice(&*bent);
  return bent;
}

}  // namespace

absl::StatusOr<LensSolution> SolveLens(const std::vector<BoardView>& views,
                                       const ImageSize& image_size_px, const LensOptions& options) {
  RIGCAL_RETURN_IF_ERROR(CheckViews(views, image_size_px));
  std::vector<BoardView> centres = views;
  absl::StatusOr<LensSolution> solution = SolveLensOnce(centres, image_size_px, options);
  const bool has_circles = std::any_of(views.begin(), views.end(), [](const BoardView& view) {
    return std::any_of(view.corners.begin(), view.corners.end(),
                       [](const BoardCorner& corner) { return corner.radius_m > 0; });
  });
  const int rounds = options.previous != nullptr ? 1 : kEccentricityRounds;
  for (int round = 0; has_circles && solution.ok() && round < rounds; ++round) {
    centres = WithoutEccentricity(views, *solution);
    solution = SolveLensOnce(centres, image_size_px, options);
  }
  // Who holds a board before a camera waits for nothing that the last solve will say.
  if (!solution.ok() || options.previous != nullptr) return solution;
  return SolveBent(centres, image_size_px, options, *solution);
}

}  // namespace rigcal

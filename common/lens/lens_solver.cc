// SPDX-License-Identifier: Apache-2.0
#include "common/lens/lens_solver.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "common/camera/camera_model.h"
#include "common/lens/circle_image.h"
#include "common/lens/lens_adjustment.h"
#include "common/lens/lens_start.h"
#include "common/lens/view_coverage.h"
#include "common/statistics/robust_statistics.h"
#include "common/status/status_macros.h"

namespace rigcal {
namespace {

constexpr size_t kLeastCornersOfView = 6;
constexpr size_t kFolds = 5;
// A corner at the border may have no ray by a lens that was solved without it.
constexpr double kMostHeldOutPx = 5;
constexpr int kStepsToGoOn = 4;      // from a solution of most of the views
constexpr double kMuchWorse = 1.5;   // a family's held-out error over the least one
constexpr double kAsGood = 1.02;     // of the least held-out error: the simpler model wins ...
constexpr double kSystematic = 2.5;  // ... unless its views are worse by so many standard errors

// Cauchy's losses of the first solve, from far to near.
constexpr double kWideLossPx = 20;
constexpr double kNarrowLossPx = 1;

constexpr double kOutlierSigmas = 6;
constexpr double kLeastOutlierPx = 0.05;
constexpr double kOutlierViewRatio = 5;  // of the median of all views
constexpr double kLeastOutlierViewPx = 0.3;

constexpr double kNeverTiltedDeg = 10;
constexpr double kTiltedDeg = 25;  // of the third most tilted view; below: advice
constexpr double kMostFocalSigma = 0.03;
constexpr double kGoodFocalSigma = 0.003;
constexpr double kGoodHalvesPx = 0.3, kPoorHalvesPx = 5;
constexpr double kPoorRmsPx = 0.6;
constexpr double kGoodCoverage = 0.7;
constexpr int kFewViews = 10, kGoodViews = 20;
constexpr double kGoodUncertaintyPx = 0.2;
constexpr int kBlindGrid = 21;
constexpr double kBendSigmas = 5;

// The images of circles depend on where the boards are, which depends on them, by little.
constexpr int kEccentricityRounds = 2;

double RmsOf(const std::vector<double>& errors) {
  double sum = 0;
  for (const double error : errors) sum += error * error;
  return errors.empty() ? 0 : std::sqrt(sum / static_cast<double>(errors.size()));
}

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

// Which corners and views are used.
struct UsedCorners {
  std::vector<std::vector<bool>> corners;  // view by view
  std::vector<std::string> left_out;       // why a view is not used; empty: it is

  std::vector<BoardView> Of(const std::vector<BoardView>& views) const {
    std::vector<BoardView> used;
    for (size_t i = 0; i < views.size(); ++i) {
      if (!left_out[i].empty()) continue;
      BoardView& view = used.emplace_back();
      view.name = views[i].name;
      for (size_t k = 0; k < views[i].corners.size(); ++k) {
        if (corners[i][k]) view.corners.push_back(views[i].corners[k]);
      }
    }
    return used;
  }
  // The lens and the poses of the views that are used, into those of all.
  void Into(const LensEstimate& fitted, LensEstimate* all) const {
    all->intrinsics = fitted.intrinsics;
    for (size_t i = 0, at = 0; i < left_out.size(); ++i) {
      if (left_out[i].empty()) all->cam_from_board[i] = fitted.cam_from_board[at++];
    }
  }
  // The poses of the views that are used.
  LensEstimate Of(const LensEstimate& all) const {
    LensEstimate used = all;
    used.cam_from_board.clear();
    for (size_t i = 0; i < left_out.size(); ++i) {
      if (left_out[i].empty()) used.cam_from_board.push_back(all.cam_from_board[i]);
    }
    return used;
  }
};

UsedCorners LeaveOutWrong(const std::vector<BoardView>& views, const LensEstimate& estimate) {
  std::vector<std::vector<double>> errors;
  std::vector<double> medians;
  for (size_t i = 0; i < views.size(); ++i) {
    errors.push_back(CornerErrors(views[i], estimate.intrinsics, estimate.cam_from_board[i]));
    medians.push_back(UpperMedian(errors.back()));
  }
  const double typical = UpperMedian(medians);
  UsedCorners used;
  std::vector<double> of_used;
  for (size_t i = 0; i < views.size(); ++i) {
    std::string why;
    if (medians[i] > std::max(kOutlierViewRatio * typical, kLeastOutlierViewPx)) {
      why =
          absl::StrFormat("does not fit the others: corners are off by %.2f px, elsewhere by %.2f",
                          medians[i], typical);
    } else {
      of_used.insert(of_used.end(), errors[i].begin(), errors[i].end());
    }
    used.left_out.push_back(std::move(why));
  }
  const double sigma = UpperMedian(std::move(of_used)) / kMedianOfRayleigh;
  const double limit = std::max(kOutlierSigmas * sigma, kLeastOutlierPx);
  for (size_t i = 0; i < views.size(); ++i) {
    auto& corners = used.corners.emplace_back();
    for (const double error : errors[i]) corners.push_back(error <= limit);
    const auto good = static_cast<size_t>(std::count(corners.begin(), corners.end(), true));
    if (used.left_out[i].empty() &&
        (good < kLeastCornersOfView || 2 * good < views[i].corners.size())) {
      used.left_out[i] = absl::StrFormat("only %d of its %d corners fit", good, corners.size());
    }
  }
  return used;
}

// The views of these numbers, and their poses.
struct ViewSubset {
  std::vector<BoardView> views;
  LensEstimate estimate;
};

template <typename Predicate>
ViewSubset Subset(const std::vector<BoardView>& views, const LensEstimate& estimate,
                  Predicate is_in) {
  ViewSubset subset;
  subset.estimate = estimate;
  subset.estimate.cam_from_board.clear();
  for (size_t i = 0; i < views.size(); ++i) {
    if (!is_in(i)) continue;
    subset.views.push_back(views[i]);
    subset.estimate.cam_from_board.push_back(estimate.cam_from_board[i]);
  }
  return subset;
}

// Errors of each view with a lens that was solved without it.
std::vector<std::vector<double>> HeldOutErrors(const std::vector<BoardView>& views,
                                               const LensEstimate& estimate, int max_steps) {
  const size_t folds = std::min(kFolds, views.size());
  std::vector<std::vector<double>> errors(views.size());
  for (size_t fold = 0; fold < folds; ++fold) {
    const ViewSubset training =
        Subset(views, estimate, [&](size_t i) { return i % folds != fold; });
    ViewSubset held_out = Subset(views, estimate, [&](size_t i) { return i % folds == fold; });
    LensAdjustmentOptions options;
    options.max_steps = max_steps;
    held_out.estimate.intrinsics =
        AdjustLens(training.views, training.estimate, options).estimate.intrinsics;
    options.fix_intrinsics = true;
    const LensAdjustment placed = AdjustLens(held_out.views, held_out.estimate, options);
    for (size_t k = 0; k < held_out.views.size(); ++k) {
      std::vector<double>& of_view = errors[fold + k * folds];
      of_view = CornerErrors(held_out.views[k], placed.estimate.intrinsics,
                             placed.estimate.cam_from_board[k]);
      for (double& error : of_view) error = std::min(error, kMostHeldOutPx);
    }
  }
  return errors;
}

double RmsOfAll(const std::vector<std::vector<double>>& errors) {
  std::vector<double> all;
  for (const auto& of_view : errors) all.insert(all.end(), of_view.begin(), of_view.end());
  return RmsOf(all);
}

// View by view, `a` is further off than `b`.
bool IsWorse(const std::vector<std::vector<double>>& a, const std::vector<std::vector<double>>& b) {
  const double count = static_cast<double>(a.size());
  double sum = 0, squares = 0;
  for (size_t i = 0; i < a.size(); ++i) {
    const double rms_a = RmsOf(a[i]), rms_b = RmsOf(b[i]);
    const double difference = rms_a * rms_a - rms_b * rms_b;
    sum += difference;
    squares += difference * difference;
  }
  const double mean = sum / count;
  const double variance = std::max(0.0, squares / count - mean * mean) / (count - 1);
  return mean > kSystematic * std::sqrt(variance);
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

// Noise in each coordinate of a corner that makes the residuals.
double NoiseOf(const LensAdjustment& adjusted, size_t corners, size_t views) {
  const double freedom =
      std::max(1.0, 2.0 * static_cast<double>(corners) - 6.0 * static_cast<double>(views) -
                        static_cast<double>(adjusted.information.rows()));
  return std::sqrt(adjusted.cost_px2 / freedom);
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

// The focal length is known through boards that are seen at an angle.
absl::Status CheckTilt(const LensSolution& solution, const std::vector<double>& tilts_deg) {
  const double most = *std::max_element(tilts_deg.begin(), tilts_deg.end());
  const double focal_sigma = solution.sigmas[0] / solution.intrinsics.fx_px;
  if (most >= kNeverTiltedDeg && focal_sigma <= kMostFocalSigma) return absl::OkStatus();
  return absl::FailedPreconditionError(absl::StrFormat(
      "focal length and distance cannot be told apart: the board is tilted by %.0f degrees at "
      "most, and the focal length is uncertain by %.1f %%; tilt the board by 30 degrees and more, "
      "to every side",
      most, std::min(100.0, 100 * focal_sigma)));
}

void AddAdvice(const ImageSize& image_size_px, const std::vector<BoardView>& used,
               std::vector<double> tilts_deg, LensSolution* solution) {
  std::vector<std::string>& advice = solution->advice;
  if (solution->held_out_rms_px > kPoorRmsPx) {
    advice.push_back(absl::StrFormat(
        "corners are off by %.1f px, and usual is 0.05 to 0.5, so do not use this lens: were focus "
        "and zoom the same in all pictures, is the board flat, and are its counts, sides and gaps "
        "those of --board?",
        solution->held_out_rms_px));
  } else if (solution->halves && solution->halves->p95_px > kPoorHalvesPx) {
    advice.push_back(absl::StrFormat(
        "two halves of the views make lenses that are %.0f px apart at the border: use this lens "
        "only in the middle of the image, or take more views; were focus and zoom the same in all "
        "pictures?",
        solution->halves->p95_px));
  }
  for (const std::string& side : BareSides(used, image_size_px)) {
    advice.push_back(side + ": hold the board there, too");
  }
  if (solution->covered_share < kGoodCoverage) {
    advice.push_back(absl::StrFormat(
        "corners are in %.0f %% of the image: fill the rest, also its corners, with near views",
        100 * solution->covered_share));
  }
  std::sort(tilts_deg.rbegin(), tilts_deg.rend());
  if (tilts_deg[2] < kTiltedDeg) {
    advice.push_back(absl::StrFormat(
        "only two views are tilted by more than %.0f degrees: tilt the board by 30 to 50, to every "
        "side",
        tilts_deg[2]));
  }
  if (solution->sigmas[0] > kGoodFocalSigma * solution->intrinsics.fx_px) {
    advice.push_back(absl::StrFormat("the focal length is uncertain by %.1f %%: more tilted views",
                                     100 * solution->sigmas[0] / solution->intrinsics.fx_px));
  }
  if (solution->views < kFewViews ||
      (solution->views < kGoodViews && !(solution->uncertainty.p95_px < kGoodUncertaintyPx))) {
    advice.push_back(absl::StrFormat("only %d views were used: take 20 to 40", solution->views));
  }
  if (!solution->halves) {
    advice.push_back(
        "the lenses of two halves of the views have little in common: take more views");
  } else if (solution->halves->p95_px > kGoodHalvesPx &&
             solution->halves->p95_px <= kPoorHalvesPx) {
    advice.push_back(absl::StrFormat(
        "two halves of the views make lenses that differ by %.2f px: take more views, above all "
        "where the image is bare; is the board flat?",
        solution->halves->p95_px));
  }
  if (solution->blind_share > 0) {
    advice.push_back(absl::StrFormat(
        "%.0f %% of the image, at its border, have no ray: outside of where corners were, this "
        "lens cannot be used",
        std::max(1.0, 100 * solution->blind_share)));
  }
}

void AddBendAdvice(LensSolution* solution) {
  const BoardBend& bend = *solution->bend;
  const bool is_across = std::abs(bend.height_m.x()) >= std::abs(bend.height_m.y());
  solution->advice.push_back(absl::StrFormat(
      "the board is bent by %.1f mm from its middle to its %s: that was estimated and taken into "
      "account, but glue it on something flat and stiff",
      1e3 * bend.height_m.cwiseAbs().maxCoeff(), is_across ? "left and right" : "top and bottom"));
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

// A solution's views that were used, solved once more together with the bend of the board.
struct BentAdjustment {
  LensAdjustment adjusted;
  BoardBend bend;
  double noise_px = 0;
  // Of the intrinsics alone, the bend eliminated, for that noise; empty: they are not determined.
  Eigen::MatrixXd information;
};

BentAdjustment AdjustWithBend(const std::vector<BoardView>& views, const LensSolution& solution) {
  std::vector<BoardView> used;
  LensEstimate start;
  start.model = solution.model;
  start.intrinsics = solution.intrinsics;
  if (solution.bend) start.bend_per_m = solution.bend->per_m;
  start.noise_px = std::max(solution.noise_px, kLeastNoisePx);
  size_t corners = 0;
  for (size_t i = 0; i < views.size(); ++i) {
    if (!solution.view_results[i].left_out.empty()) continue;
    used.push_back(views[i]);
    start.cam_from_board.push_back(solution.view_results[i].cam_from_board);
    corners += views[i].corners.size();
  }
  LensAdjustmentOptions options;
  options.estimate_bend = true;
  options.loss_px = kNarrowLossPx;
  BentAdjustment result;
  result.adjusted = AdjustLens(used, start, options);
  result.noise_px = std::max(NoiseOf(result.adjusted, corners, used.size()), kLeastNoisePx);
  const Eigen::MatrixXd covariance =
      CovarianceOf(result.adjusted.information / (result.noise_px * result.noise_px));
  if (covariance.size() == 0) return result;
  const Eigen::Index free = covariance.rows() - 2;
  result.information = CovarianceOf(covariance.topLeftCorner(free, free));
  const Eigen::Vector2d middle_m = MiddleOfBoard(used);
  Eigen::Array2d reach_m(0, 0);
  for (const BoardView& view : used) {
    for (const BoardCorner& corner : view.corners) {
      reach_m = reach_m.max((corner.x_in_board_m.head<2>() - middle_m).array().abs());
    }
  }
  result.bend.per_m = result.adjusted.estimate.bend_per_m;
  result.bend.height_m = result.bend.per_m.array() * reach_m.square();
  result.bend.sigma_m = covariance.diagonal().tail<2>().array().sqrt() * reach_m.square();
  return result;
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
  solution.noise_px = NoiseOf(result, static_cast<size_t>(solution.corners), good.size());
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

// The lens together with the bend, where that predicts views that were held out better.
absl::StatusOr<LensSolution> SolveBent(const std::vector<BoardView>& views,
                                       const ImageSize& image_size_px, const LensOptions& options,
                                       const LensSolution& flat) {
  const BentAdjustment first = AdjustWithBend(views, flat);
  if (first.information.size() == 0) return flat;
  const Eigen::Array2d sigmas = first.bend.height_m.array() / first.bend.sigma_m.array();
  if (!(sigmas.abs().maxCoeff() > kBendSigmas)) return flat;
  absl::StatusOr<LensSolution> bent =
      SolveLensOnce(Bent(views, first.bend.per_m), image_size_px, options);
  if (!bent.ok() || kAsGood * bent->held_out_rms_px > flat.held_out_rms_px) return flat;
  bent->bend = first.bend;
  // What the bend leaves open is open of the lens, too.
  const BentAdjustment both = AdjustWithBend(views, *bent);
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

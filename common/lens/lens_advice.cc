// SPDX-License-Identifier: Apache-2.0
#include "common/lens/lens_advice.h"

#include <algorithm>
#include <cmath>
#include <string>
#include <utility>

#include "absl/strings/str_format.h"
#include "common/lens/view_coverage.h"

namespace rigcal {
namespace {

constexpr double kNeverTiltedDeg = 10;
constexpr double kTiltedDeg = 25;  // of the third most tilted view; below: advice
constexpr double kMostFocalSigma = 0.03;
constexpr double kGoodFocalSigma = 0.003;
constexpr double kGoodHalvesPx = 0.3, kPoorHalvesPx = 5, kUselessHalvesPx = 20;
constexpr double kPoorRmsPx = 0.6;
constexpr double kGoodCoverage = 0.7;
constexpr int kFewViews = 10, kGoodViews = 20;
constexpr double kGoodUncertaintyPx = 0.2;
constexpr double kHopelessPx = 50;  // uncertainty, median over the image

}  // namespace

absl::Status CheckTilt(const LensSolution& solution, const std::vector<double>& tilts_deg) {
  const double most = *std::max_element(tilts_deg.begin(), tilts_deg.end());
  const double focal_sigma = solution.sigmas[0] / solution.intrinsics.fx_px;
  if (most >= kNeverTiltedDeg && focal_sigma <= kMostFocalSigma) {
    if (solution.uncertainty.median_px < kHopelessPx) return absl::OkStatus();
    return absl::FailedPreconditionError(absl::StrFormat(
        "these views say next to nothing about the lens: half of the image is known within %.0f px "
        "at best; take views that differ, tilted to every side, near, all over the image",
        solution.uncertainty.median_px));
  }
  return absl::FailedPreconditionError(absl::StrFormat(
      "focal length and distance cannot be told apart: the board is tilted by %.0f degrees at "
      "most, and the focal length is uncertain by %.1f %%; tilt the board by 30 degrees and more, "
      "to every side",
      most, std::min(100.0, 100 * focal_sigma)));
}

void AddAdvice(const ImageSize& image_size_px, const std::vector<BoardView>& used,
               std::vector<double> tilts_deg, LensSolution* solution) {
  std::vector<std::string>& advice = solution->advice;
  if (const std::string why = WhyNotToUse(*solution); !why.empty()) {
    // More views of the same mend nothing.
    advice.push_back(why);
    return;
  }
  if (solution->halves && solution->halves->p95_px > kPoorHalvesPx) {
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

std::string WhyNotToUse(const LensSolution& solution) {
  constexpr char kQuestions[] =
      "so do not use this lens: were focus and zoom the same in all pictures, is the board flat, "
      "and are its counts, sides and gaps those of --board?";
  if (solution.held_out_rms_px > kPoorRmsPx) {
    return absl::StrFormat("corners are off by %.1f px, and usual is 0.05 to 0.5, %s",
                           solution.held_out_rms_px, kQuestions);
  }
  if (solution.halves && solution.halves->p95_px > kUselessHalvesPx) {
    return absl::StrFormat("two halves of the views make lenses that are %.0f px apart, %s",
                           solution.halves->p95_px, kQuestions);
  }
  return "";
}

void AddBendAdvice(LensSolution* solution) {
  const BoardBend& bend = *solution->bend;
  const bool is_across = std::abs(bend.height_m.x()) >= std::abs(bend.height_m.y());
  solution->advice.push_back(absl::StrFormat(
      "the board is bent by %.1f mm from its middle to its %s: that was estimated and taken into "
      "account, but glue it on something flat and stiff",
      1e3 * bend.height_m.cwiseAbs().maxCoeff(), is_across ? "left and right" : "top and bottom"));
}

}  // namespace rigcal

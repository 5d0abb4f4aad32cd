// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cmath>
#include <set>
#include <string>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "common/board/board.h"
#include "common/board/board_misfit.h"
#include "server/solve/diagnose/finding_causes.h"

namespace rigcal::server {
namespace {

// Of the points from where they were given, over their sigma: in the mean, and of one alone.
constexpr double kShapeSigmas = 2;
constexpr double kOnePointSigmas = 6;
// Likewise of the whole back of a board with two sides.
constexpr double kBackSigmas = 2;
// Of the error, that goes away when points that were given as exact are estimated.
constexpr double kLeastGain = 0.1;
// Of the target's extent: the sigma that points have where the images alone are to say where they
// are.
constexpr double kFreeShare = 0.1;

// A rigid target of the calibration, and its points as they were solved.
struct SolvedShape {
  Target given;
  std::vector<Eigen::Vector3d> given_m, found_m;
  int first_point = 0;  // in the problem
  double sigma_m = 0;   // of a coordinate, mean square
  double extent_m = 0;  // between the two points that are furthest apart
};

SolvedShape ShapeOf(const TargetParts::Part& part, const BundleRigidTarget& solved) {
  SolvedShape shape;
  shape.given = part.target;
  shape.first_point = part.first_marker;
  const auto first = static_cast<size_t>(part.first_marker);
  const size_t count = part.target.points.size();
  double variance = 0;
  for (size_t m = first; m < first + count; ++m) {
    shape.given_m.push_back(solved.given_points_m[m]);
    shape.found_m.push_back(solved.points_m[m]);
    variance += solved.sigma_m[m] * solved.sigma_m[m] / static_cast<double>(count);
    for (const Eigen::Vector3d& other_m : shape.given_m) {
      shape.extent_m = std::max(shape.extent_m, (other_m - shape.given_m.back()).norm());
    }
  }
  shape.sigma_m = std::sqrt(variance);
  return shape;
}

std::vector<SolvedShape> ShapesOf(const CauseInput& input, const BundleRigidTarget& solved) {
  const TargetParts parts = input.rig.Parts();
  std::vector<SolvedShape> shapes;
  std::set<int> seen;
  const auto add = [&](const TargetParts::Part& part) {
    if (part.target.kind != TargetKind::kRigid || !part.is_rigid || part.is_point) return;
    if (seen.insert(part.first_marker).second) shapes.push_back(ShapeOf(part, solved));
  };
  for (const AlignedTrack& track : input.rig.tracks) add(parts.Of(track.track.session_id));
  return shapes;
}

std::string ScaleText(double scale) {
  return absl::StrFormat("the scale, and with it every length of the rig, is off by %.1f %%",
                         100 * std::abs(scale - 1));
}

// What is wrong with a board and what to say instead, and by how much its lengths are off.
std::string BoardText(const SolvedShape& shape, double* scale) {
  const absl::StatusOr<Board> board = ParseBoard(shape.given.board);
  if (!board.ok()) return "";
  const BoardMisfit misfit = ExplainBoardMisfit(*board, shape.found_m);
  *scale = misfit.scale;
  switch (misfit.cause) {
    case MisfitCause::kGap: {
      Board better = *board;
      better.gap_share = std::round(1000 * misfit.found) / 1000;
      return absl::StrFormat(
          ": the gap between its tags is %.3f of their side, not %.3f. Measure a tag's black "
          "square "
          "and a gap on the print, and calibrate again with --target %s; as it is, %s",
          misfit.found, board->gap_share, FormatBoard(better), ScaleText(misfit.scale));
    }
    case MisfitCause::kStretch:
      return absl::StrFormat(
          ": its rows are %.2f %% %s apart than its columns. The print is stretched: measure it "
          "both "
          "ways, and print it at 100 %%, without fitting it to the page; %s",
          100 * std::abs(misfit.found - 1), misfit.found > 1 ? "further" : "less far",
          ScaleText(misfit.scale));
    case MisfitCause::kBend:
      return absl::StrFormat(
          ": it is bent by %.1f mm. That was estimated, and its sigma held it back: glue the print "
          "on something stiff, or calibrate again with --target %s;flatness=%.4f",
          1e3 * misfit.found, shape.given.board, std::max(misfit.found, 2 * shape.sigma_m));
    case MisfitCause::kThickness: {
      if (!(misfit.found > 0)) break;
      Board better = *board;
      better.thickness_m = std::round(1e4 * misfit.found) / 1e4;
      return absl::StrFormat(
          ": its two sides are %.1f mm apart, not %.1f mm. Measure the board with both prints on "
          "it, and calibrate again with --target %s; cameras that face each other across it are "
          "off by as much, or by more where its points were given as exact",
          1e3 * misfit.found, 1e3 * board->thickness_m, FormatBoard(better));
    }
    case MisfitCause::kShift:
      return absl::StrFormat(
          ": its back is %.1f mm beside its place behind the front. Glue both sheets on so that "
          "their crosses lie behind each other, and record again",
          1e3 * misfit.found);
    case MisfitCause::kUnknown:
      break;
  }
  return ". If counts and sides are those of the print, it is damaged or was changed; the scale "
         "may "
         "be wrong by as much";
}

bool IsAsGiven(const SolvedShape& shape, double sigma_m) {
  const ShapeMisfit misfit = CompareShapes(shape.given_m, shape.found_m);
  if (const absl::StatusOr<Board> board = ParseBoard(shape.given.board);
      board.ok() && board->IsTwoSided() &&
      !(BackOffset(*board, shape.found_m).norm() < kBackSigmas * sigma_m)) {
    return false;
  }
  // Three coordinates have the sigma.
  return misfit.rms_m < kShapeSigmas * std::sqrt(3.0) * sigma_m &&
         misfit.worst_m < kOnePointSigmas * std::sqrt(3.0) * sigma_m;
}

// `shape`: as the images alone have it.
Cause CauseOf(const SolvedShape& shape, double gain_px) {
  const ShapeMisfit misfit = CompareShapes(shape.given_m, shape.found_m);
  const bool is_board = !shape.given.board.empty();
  double scale = 1 + misfit.rms_m / shape.extent_m;
  std::string advice = absl::StrFormat(
      "the points of %s are %.1f mm (RMS) from where they were given; %s is off by %.1f mm",
      is_board ? shape.given.board : "the rigid target", 1e3 * misfit.rms_m,
      shape.given.points[misfit.worst].label, 1e3 * misfit.worst_m);
  absl::StrAppend(&advice, is_board
                               ? BoardText(shape, &scale)
                               : ". Measure them again, give them again and calibrate again; every "
                                 "length of the rig may be as wrong");
  return {{FindingKind::kWrongTargetShape, "", 1e3 * std::abs(scale - 1) * shape.extent_m, "mm",
           advice},
          gain_px};
}

}  // namespace

std::vector<Cause> FindWrongTargetShape(const CauseInput& input) {
  BundleProblem problem = input.trial.problem;
  BundleRigidTarget& rigid = problem.rigid_target;
  if (rigid.points_m.empty()) return {};
  const bool is_exact =
      rigid.fixed || std::ranges::all_of(rigid.sigma_m, [](double sigma) { return sigma == 0; });
  std::vector<SolvedShape> shapes = ShapesOf(input, rigid);
  std::vector<bool> wrong;
  for (const SolvedShape& shape : shapes) {
    wrong.push_back(is_exact || !IsAsGiven(shape, shape.sigma_m));
  }
  if (std::ranges::count(wrong, true) == 0) return {};
  // The sigma that was given holds the points back.
  rigid.fixed = false;
  for (const SolvedShape& shape : shapes) {
    std::fill_n(rigid.sigma_m.begin() + shape.first_point, shape.given_m.size(),
                kFreeShare * shape.extent_m);
  }
  if (!SolveTrial(input.trial.bundle, &problem).ok()) return {};
  const ErrorChange change = Overall(CompareErrors(input.trial.problem, problem));
  if (is_exact && change.gain() < kLeastGain) return {};
  shapes = ShapesOf(input, rigid);
  std::vector<Cause> causes;
  for (size_t s = 0; s < shapes.size(); ++s) {
    if (!wrong[s] || (is_exact && IsAsGiven(shapes[s], kBoardSigmaM))) continue;
    causes.push_back(CauseOf(shapes[s], std::max(0.0, change.gain_px())));
  }
  return causes;
}

}  // namespace rigcal::server

// SPDX-License-Identifier: Apache-2.0
#include "common/board/board_misfit.h"

#include <Eigen/Geometry>
#include <Eigen/QR>
#include <algorithm>
#include <cmath>
#include <functional>

namespace rigcal {
namespace {

using Points = std::vector<Eigen::Vector3d>;

// That most of the misfit is explained, and nothing else is needed.
constexpr double kExplainedShare = 0.75;
constexpr int kSearchSteps = 60;  // first over the whole range, then within two of its steps

Eigen::Matrix3Xd Columns(const Points& points) {
  Eigen::Matrix3Xd columns(3, static_cast<Eigen::Index>(points.size()));
  for (size_t i = 0; i < points.size(); ++i) columns.col(static_cast<Eigen::Index>(i)) = points[i];
  return columns;
}

// `from`, moved to where it is nearest to `to`: Umeyama 1991, "Least-squares estimation of
// transformation parameters between two point patterns".
Eigen::Matrix3Xd Moved(const Eigen::Matrix3Xd& from, const Eigen::Matrix3Xd& to,
                       double* scale = nullptr) {
  const Eigen::Matrix4d transform = Eigen::umeyama(from, to);
  if (scale) *scale = std::cbrt(transform.topLeftCorner<3, 3>().determinant());
  return (transform.topLeftCorner<3, 3>() * from).colwise() + transform.topRightCorner<3, 1>();
}

double SquaredMisfit(const Eigen::Matrix3Xd& model, const Eigen::Matrix3Xd& found) {
  return (Moved(model, found) - found).squaredNorm();
}

// The value from `low` to `high` that makes `cost` least; it has one minimum there.
double LeastOf(double low, double high, const std::function<double(double)>& cost) {
  for (int pass = 0; pass < 4; ++pass) {
    const double step = (high - low) / kSearchSteps;
    double best = low, best_cost = cost(low);
    for (int k = 1; k <= kSearchSteps; ++k) {
      const double value = low + k * step, cost_here = cost(value);
      if (cost_here >= best_cost) continue;
      best = value;
      best_cost = cost_here;
    }
    low = std::max(low, best - step);
    high = std::min(high, best + step);
  }
  return (low + high) / 2;
}

Eigen::Matrix3Xd WithGap(Board board, double share) {
  board.gap_share = share;
  return Columns(board.Points());
}

Eigen::Matrix3Xd Stretched(Eigen::Matrix3Xd points, double factor) {
  points.row(1) *= factor;
  return points;
}

// The paraboloid over the board that is nearest to what was found, and how high its middle is over
// its corners.
Eigen::Matrix3Xd Bent(const Eigen::Matrix3Xd& given, const Eigen::Matrix3Xd& found,
                      double* height) {
  const Eigen::Matrix3Xd in_board = Moved(found, given);
  const Eigen::Vector3d middle = given.rowwise().mean();
  const Eigen::Index count = given.cols();
  Eigen::MatrixXd rows(count, 6);
  for (Eigen::Index i = 0; i < count; ++i) {
    const double x = given(0, i) - middle.x(), y = given(1, i) - middle.y();
    rows.row(i) << 1, x, y, x * x, x * y, y * y;
  }
  const Eigen::VectorXd heights = (in_board.row(2) - given.row(2)).transpose();
  const Eigen::VectorXd surface = rows.colPivHouseholderQr().solve(heights);
  Eigen::Matrix3Xd bent = given;
  bent.row(2) += (rows * surface).transpose();
  const Eigen::VectorXd curved = rows.rightCols<3>() * surface.tail<3>();
  *height = curved.cwiseAbs().maxCoeff();
  return bent;
}

Eigen::Matrix3Xd WithBackMoved(const Board& board, Eigen::Matrix3Xd points,
                               const Eigen::Vector3d& offset_m) {
  points.rightCols(board.side_point_count()).colwise() += offset_m;
  return points;
}

}  // namespace

Eigen::Vector3d BackOffset(const Board& board, const Points& found_points) {
  const Eigen::Matrix3Xd given = Columns(board.Points()), found = Columns(found_points);
  const Eigen::Index count = board.side_point_count();
  const Eigen::Matrix4d board_from_found =
      Eigen::umeyama(found.leftCols(count), given.leftCols(count));
  const Eigen::Vector3d back =
      (board_from_found.topLeftCorner<3, 3>() * found.rightCols(count) - given.rightCols(count))
          .rowwise()
          .mean();
  return back + board_from_found.topRightCorner<3, 1>();
}

ShapeMisfit CompareShapes(const Points& given, const Points& found) {
  const Eigen::Matrix3Xd target = Columns(found);
  const Eigen::VectorXd distances = (Moved(Columns(given), target) - target).colwise().norm();
  ShapeMisfit misfit;
  Eigen::Index worst = 0;
  misfit.worst_m = distances.maxCoeff(&worst);
  misfit.worst = static_cast<size_t>(worst);
  misfit.rms_m = std::sqrt(distances.squaredNorm() / static_cast<double>(given.size()));
  return misfit;
}

BoardMisfit ExplainBoardMisfit(const Board& board, const Points& found_points) {
  const Eigen::Matrix3Xd given = Columns(board.Points()), found = Columns(found_points);
  const double before = SquaredMisfit(given, found);
  BoardMisfit best;
  Moved(given, found, &best.scale);
  const auto consider = [&](MisfitCause cause, double value, const Eigen::Matrix3Xd& model) {
    BoardMisfit misfit = {.cause = cause, .found = value};
    misfit.explained_share =
        1 - (Moved(model, found, &misfit.scale) - found).squaredNorm() / std::max(before, 1e-300);
    if (misfit.explained_share >= kExplainedShare &&
        misfit.explained_share > best.explained_share) {
      best = misfit;
    }
  };
  if (board.kind == BoardKind::kAprilGrid) {
    const double share = LeastOf(
        0.02, 1.5, [&](double value) { return SquaredMisfit(WithGap(board, value), found); });
    consider(MisfitCause::kGap, share, WithGap(board, share));
  }
  const double factor = LeastOf(
      0.4, 2.5, [&](double value) { return SquaredMisfit(Stretched(given, value), found); });
  consider(MisfitCause::kStretch, factor, Stretched(given, factor));
  if (board.IsTwoSided()) {
    const Eigen::Vector3d offset_m = BackOffset(board, found_points);
    const Eigen::Vector3d deeper_m(0, 0, offset_m.z()), beside_m(offset_m.x(), offset_m.y(), 0);
    const double away = board.FrontFromBack().translation_m.z() > 0 ? 1 : -1;
    consider(MisfitCause::kThickness, board.thickness_m + away * offset_m.z(),
             WithBackMoved(board, given, deeper_m));
    consider(MisfitCause::kShift, beside_m.norm(), WithBackMoved(board, given, beside_m));
  }
  double height_m = 0;
  const Eigen::Matrix3Xd bent = Bent(given, found, &height_m);
  consider(MisfitCause::kBend, height_m, bent);
  return best;
}

}  // namespace rigcal

// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <functional>
#include <optional>
#include <vector>

#include "server/solve/bundle/line_bundle_estimate.h"
#include "server/solve/bundle/line_bundle_layout.h"
#include "server/solve/trajectory/banded_matrix.h"
#include "server/solve/trajectory/path_prior.h"
#include "server/solve/trajectory/trajectory_problem.h"

namespace rigcal::server {

// The normal equations of a trajectory problem: banded in the knots of each span, which are
// eliminated, with a border of the cameras, clocks and target. Works on the problem in place.
class TrajectorySystem {
 public:
  // Of the markers that are used now; `problem` must be valid and outlive it.
  TrajectorySystem(const BundleOptions& options, TrajectoryProblem* problem);

  // At the problem's present values. False where a used marker cannot be seen, or the knots are not
  // determined.
  bool Linearise();
  double cost() const { return cost_; }  // of the last linearisation, priors included
  // Lower triangle, the knots eliminated; and the gradient, likewise.
  const Eigen::MatrixXd& matrix() const { return matrix_; }
  const Eigen::VectorXd& gradient() const { return gradient_; }
  const LineBundleLayout& layout() const { return layout_; }

  enum class StepOutcome {
    kTaken,
    kNoGain,    // no step lowers the cost; the problem is as it was
    kSingular,  // the data do not determine the parameters; likewise
  };
  // One Gauss-Newton step from the last linearisation, halved until the cost is lower.
  StepOutcome Step();

  // Of the last linearisation, with the cameras held.
  // Before it is asked: PreparePathCovariance.
  PathFreedom MeasureFreedom() const;

  // Of the last linearisation, prepared as well: from now on the gradient has that of variance / 2
  // * log det A, with A the matrix of the knots, as it is here, and the variance of the whitened
  // residuals. The cost has its minimum over paths and cameras together where the path is smooth
  // for want of room: a rig at half the size, or flatter, has a path of half the third differences.
  // Where there is more room, more paths fit; what is minimised is the cost of all of them
  // (Laplace's approximation of the marginal likelihood; MacKay 1999, Comparison of approximate
  // methods for handling hyperparameters).
  void CountPaths(double variance);

  // Of the last linearisation, by row in the order of the problem: weight, whitened residual, and
  // its derivative by the reduced parameters where the knots give way to them.
  using MarkerVisitor =
      std::function<void(size_t row, double weight, const Eigen::Vector2d& residual,
                         const Eigen::Matrix<double, 2, Eigen::Dynamic>& slope)>;
  void ForEachReduced(const MarkerVisitor& visit) const;

  // Of the last linearisation, with the cameras held: the covariance of where the path puts a
  // marker, whitened, used or not. `row` must have a span, and its camera see the marker.
  Eigen::Matrix2d PathCovariance(size_t row, const BundleObservation& observation,
                                 const BundleMarker& marker) const;
  // Before PathCovariance is asked.
  void PreparePathCovariance();

 private:
  struct SpanSystem {
    BandedMatrix matrix;       // factored
    Eigen::MatrixXd border;    // L^-1 of the coupling to the reduced parameters
    Eigen::VectorXd gradient;  // L^-1 of it
    BandedMatrix inverse;
  };
  double Weight(const Eigen::Vector2d& residual) const;
  bool DataCost(double* cost) const;

  // The unit of length is the spacing's business, where that is estimated. Rows say nothing of it,
  // and a path of half the size is no more likely. So a path is judged by the size of the wand:
  // with the spacing grows the sigma of the third differences of the origin, and a rig that grows
  // as a whole costs the path nothing. What the count of paths says about the scale is taken out.
  struct ScaleDirection {
    Eigen::Vector3d centre_m;    // of the camera that is held
    Eigen::VectorXd reduced;     // by which the parameters grow when all lengths do, and knots with
    Eigen::VectorXd size_slope;  // derivative of the logarithm of the wand's size
  };
  void FindScaleDirection();
  double SizeM() const;  // of the wand: root of the sum of its squared positions
  void AddPath(size_t span_index);
  void AddCount();

  const BundleOptions& options_;
  TrajectoryProblem& problem_;
  LineBundleLayout layout_;
  PackedMarkers packed_;  // of nothing
  std::vector<SpanSystem> systems_;
  Eigen::MatrixXd matrix_;
  Eigen::VectorXd gradient_;
  double cost_ = 0;
  std::optional<ScaleDirection> scale_;  // none: something else than the spacing has the scale
  // Of CountPaths; empty until then.
  Eigen::VectorXd count_gradient_, counted_;  // counted: without the scale
  std::vector<Eigen::VectorXd> count_gradient_of_knots_;
};

}  // namespace rigcal::server

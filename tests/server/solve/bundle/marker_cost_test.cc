// SPDX-License-Identifier: Apache-2.0
#include "server/solve/bundle/marker_cost.h"

#include <ceres/autodiff_cost_function.h>
#include <ceres/gradient_checker.h>
#include <ceres/manifold.h>
#include <ceres/rotation.h>
#include <gtest/gtest.h>

#include <memory>
#include <vector>

#include "server/solve/bundle/marker_residual_px.h"

namespace rigcal::server::marker_cost_test {
namespace {

constexpr double kMiddleRow = 511.5;

// The residual written down a second time, from the formulas of OpenCV's documentation.
struct DocumentedMarkerCost {
  DistortionModel model;
  BundleMarker marker;
  double clock_time_s;

  template <typename T>
  bool operator()(const T* rotation, const T* translation, const T* k, const T* offset,
                  const T* rate, const T* line_delay, const T* position, const T* target,
                  T* residuals) const {
    const T wxyz[4] = {rotation[3], rotation[0], rotation[1], rotation[2]};
    T in_rig[3], x[3];
    for (int i = 0; i < 3; ++i) in_rig[i] = target[i] + position[0] * target[3 + i];
    ceres::UnitQuaternionRotatePoint(wxyz, in_rig, x);
    for (int i = 0; i < 3; ++i) x[i] += translation[i];
    const T a = x[0] / x[2], b = x[1] / x[2];
    T u, v;
    if (model == DistortionModel::kFisheye) {
      const T r = sqrt(a * a + b * b), theta = atan(r), t2 = theta * theta;
      const T bent = theta * (1.0 + t2 * (k[4] + t2 * (k[5] + t2 * (k[6] + t2 * k[7]))));
      u = a * bent / r;
      v = b * bent / r;
    } else {
      const T r2 = a * a + b * b;
      T radial = 1.0 + r2 * (k[4] + r2 * (k[5] + r2 * k[8]));
      if (model == DistortionModel::kRational) {
        radial /= 1.0 + r2 * (k[9] + r2 * (k[10] + r2 * k[11]));
      }
      u = a * radial + 2.0 * k[6] * a * b + k[7] * (r2 + 2.0 * a * a);
      v = b * radial + k[6] * (r2 + 2.0 * b * b) + 2.0 * k[7] * a * b;
    }
    const T dt =
        offset[0] + rate[0] * clock_time_s + line_delay[0] * (marker.centre_px.y() - kMiddleRow);
    const T ex = k[0] * u + k[2] - (marker.centre_px.x() - dt * marker.velocity_px_s.x());
    const T ey = k[1] * v + k[3] - (marker.centre_px.y() - dt * marker.velocity_px_s.y());
    const Eigen::Matrix2d& root = marker.sqrt_information;
    residuals[0] = root(0, 0) * ex + root(0, 1) * ey;
    residuals[1] = root(1, 0) * ex + root(1, 1) * ey;
    return true;
  }
};

struct Point {
  DistortionModel model = DistortionModel::kBrownConrady;
  BundleMarker marker;
  std::vector<double> rotation = {0.1, -0.2, 0.3, 0.0}, translation = {0.1, 0.2, 3}, intrinsics,
                      offset = {0.003}, rate = {2e-5}, line_delay = {1.5e-5}, position = {0.26},
                      target = {0.2, -0.1, 0.4, 0.48, 0.6, 0.64};

  explicit Point(DistortionModel which) : model(which) {
    rotation[3] = std::sqrt(1 - 0.01 - 0.04 - 0.09);
    intrinsics = {1250, 1240, 640, 500};
    const std::vector<double> all = {-0.22, 0.14, 0.0011, -0.0007, -0.05, 0.03, -0.02, 0.01};
    intrinsics.insert(intrinsics.end(), all.begin(), all.begin() + CoefficientCount(model));
    marker.centre_px = {650, 420};
    marker.velocity_px_s = {300, -120};
    marker.sqrt_information << 2, 0.3, 0, 1.7;
  }
  BundleCamera Camera() const {
    BundleCamera camera;
    camera.model = model;
    camera.middle_row = kMiddleRow;
    return camera;
  }
  std::vector<const double*> Parameters() const {
    return {rotation.data(), translation.data(), intrinsics.data(), offset.data(),
            rate.data(),     line_delay.data(),  position.data(),   target.data()};
  }
};

template <int kIntrinsics, typename Functor>
std::unique_ptr<ceres::CostFunction> AutomaticOfSize(const Functor& functor) {
  return std::make_unique<
      ceres::AutoDiffCostFunction<Functor, 2, 4, 3, kIntrinsics, 1, 1, 1, 1, 6>>(
      new Functor(functor));
}

template <typename Functor>
std::unique_ptr<ceres::CostFunction> Automatic(const Point& point, const Functor& functor) {
  switch (point.model) {
    case DistortionModel::kRational:
      return AutomaticOfSize<12>(functor);
    case DistortionModel::kFisheye:
      return AutomaticOfSize<8>(functor);
    default:
      return AutomaticOfSize<9>(functor);
  }
}

struct Evaluation {
  Eigen::Vector2d residual;
  std::vector<Eigen::Matrix<double, 2, Eigen::Dynamic, Eigen::RowMajor>> jacobians;
};

Evaluation Evaluate(const ceres::CostFunction& cost, const Point& point) {
  Evaluation result;
  std::vector<double*> pointers;
  for (const int size : cost.parameter_block_sizes()) result.jacobians.emplace_back(2, size);
  for (auto& jacobian : result.jacobians) pointers.push_back(jacobian.data());
  EXPECT_TRUE(cost.Evaluate(point.Parameters().data(), result.residual.data(), pointers.data()));
  return result;
}

class MarkerCostEveryModel : public ::testing::TestWithParam<DistortionModel> {};

void ExpectEqual(const Evaluation& analytic, const Evaluation& automatic, const Point& point) {
  EXPECT_LT((analytic.residual - automatic.residual).norm(), 1e-9);
  // The ambient derivatives by the quaternion differ off the unit sphere, where it never is:
  // compared along the manifold.
  ceres::EigenQuaternionManifold quaternion;
  Eigen::Matrix<double, 4, 3, Eigen::RowMajor> plus;
  quaternion.PlusJacobian(point.rotation.data(), plus.data());
  EXPECT_LT(((analytic.jacobians[0] - automatic.jacobians[0]) * plus).norm(), 1e-8);
  for (size_t block = 1; block < analytic.jacobians.size(); ++block) {
    EXPECT_LT((analytic.jacobians[block] - automatic.jacobians[block]).norm(),
              1e-10 * (1 + automatic.jacobians[block].norm()))
        << block;
  }
}

TEST_P(MarkerCostEveryModel, AgreesWithTheDocumentedFormulas) {
  const Point point(GetParam());
  const Evaluation analytic = Evaluate(MarkerCost(point.Camera(), point.marker, 12.5), point);
  const Evaluation documented =
      Evaluate(*Automatic(point, DocumentedMarkerCost{point.model, point.marker, 12.5}), point);
  ExpectEqual(analytic, documented, point);
}

// The derivatives written down against dual numbers through the same residual.
TEST_P(MarkerCostEveryModel, AgreesWithItsFunctorThroughAutomaticDifferentiation) {
  const Point point(GetParam());
  const Evaluation analytic = Evaluate(MarkerCost(point.Camera(), point.marker, 12.5), point);
  const Evaluation automatic = Evaluate(
      *Automatic(point, MarkerFunctor{point.model, ToMeasured(point.marker), 12.5, kMiddleRow}),
      point);
  ExpectEqual(analytic, automatic, point);
}

TEST_P(MarkerCostEveryModel, AgreesWithDifferences) {
  const Point point(GetParam());
  const MarkerCost cost(point.Camera(), point.marker, 12.5);
  const ceres::EigenQuaternionManifold quaternion;
  const std::vector<const ceres::Manifold*> manifolds = {&quaternion, nullptr, nullptr, nullptr,
                                                         nullptr,     nullptr, nullptr, nullptr};
  ceres::NumericDiffOptions numeric;
  numeric.relative_step_size = 1e-6;
  ceres::GradientChecker checker(&cost, &manifolds, numeric);
  ceres::GradientChecker::ProbeResults results;
  EXPECT_TRUE(checker.Probe(point.Parameters().data(), 1e-5, &results)) << results.error_log;
}

INSTANTIATE_TEST_SUITE_P(MarkerCost, MarkerCostEveryModel,
                         ::testing::Values(DistortionModel::kBrownConrady,
                                           DistortionModel::kRational, DistortionModel::kFisheye));

TEST(MarkerCost, NegativeOffsetMeansRowsShowAnEarlierInstant) {
  // A row stamped t shows the instant t + offset; with offset -1 ms the marker at t itself is 1 ms
  // of motion further along.
  Point point(DistortionModel::kBrownConrady);
  point.marker.sqrt_information.setIdentity();
  point.rate = point.line_delay = {0};
  point.offset = {0};
  const MarkerCost still(point.Camera(), point.marker, 0);
  const Eigen::Vector2d projected = Evaluate(still, point).residual + point.marker.centre_px;
  point.marker.centre_px = projected - 0.001 * point.marker.velocity_px_s;
  point.offset = {-0.001};
  const MarkerCost late(point.Camera(), point.marker, 0);
  EXPECT_LT(Evaluate(late, point).residual.norm(), 1e-9);
}

TEST(MarkerCost, FailsBehindTheCamera) {
  Point point(DistortionModel::kBrownConrady);
  point.translation[2] = -3;
  const MarkerCost cost(point.Camera(), point.marker, 0);
  double residuals[2];
  EXPECT_FALSE(cost.Evaluate(point.Parameters().data(), residuals, nullptr));
}

TEST(PriorCosts, OfASpanIsInSigmas) {
  const double a = 0.1, b = 0.25;
  double residual = 0;
  ASSERT_TRUE((SpanPrior{0.13, 0.002}(&a, &b, &residual)));
  EXPECT_NEAR(residual, 10, 1e-9);
}

TEST(PriorCosts, OfADistanceAgreesWithDifferences) {
  const Eigen::Quaterniond turn_a(Eigen::AngleAxisd(0.4, Eigen::Vector3d(1, 2, -1).normalized()));
  const Eigen::Quaterniond turn_b(Eigen::AngleAxisd(-1.1, Eigen::Vector3d(0, 1, 2).normalized()));
  const std::vector<double> at_a = {0.3, -0.2, 1}, at_b = {-1, 0.5, 0.2};
  const ceres::AutoDiffCostFunction<DistancePrior, 1, 4, 3, 4, 3> distance(
      new DistancePrior{1.5, 0.01});
  const ceres::EigenQuaternionManifold unit;
  const std::vector<const ceres::Manifold*> manifolds = {&unit, nullptr, &unit, nullptr};
  std::vector<const double*> parameters = {turn_a.coeffs().data(), at_a.data(),
                                           turn_b.coeffs().data(), at_b.data()};
  EXPECT_TRUE(ceres::GradientChecker(&distance, &manifolds, ceres::NumericDiffOptions())
                  .Probe(parameters.data(), 1e-6, nullptr));
  double residual = 0;
  ASSERT_TRUE(distance.Evaluate(parameters.data(), &residual, nullptr));
  const Eigen::Vector3d a = turn_a.conjugate() * -Eigen::Vector3d(at_a.data());
  const Eigen::Vector3d b = turn_b.conjugate() * -Eigen::Vector3d(at_b.data());
  EXPECT_NEAR(residual, ((b - a).norm() - 1.5) / 0.01, 1e-9);
  // In one place there is no direction to step to.
  parameters = {turn_a.coeffs().data(), at_a.data(), turn_a.coeffs().data(), at_a.data()};
  EXPECT_FALSE(distance.Evaluate(parameters.data(), &residual, nullptr));
}

}  // namespace
}  // namespace rigcal::server::marker_cost_test

// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <ceres/cost_function.h>

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <algorithm>
#include <cstddef>
#include <cstdint>

#include "server/solve/bundle/bundle_problem.h"
#include "server/solve/bundle/marker_residual.h"

namespace rigcal::server {

// The residual of one marker (marker_residual.h) for Ceres. Two residuals; parameter blocks, in
// this order:
//   rotation (4)     of cam_from_rig, Eigen's storage x y z w
//   translation (3)  of cam_from_rig, metres
//   intrinsics (n)   fx fy cx cy and the coefficients of `model`
//   offset (1)       of the clock, seconds
//   rate (1)         of the clock, s/s
//   line delay (1)   of the camera, seconds
//   position (1)     of the marker along the target, metres
//   target (6)       origin in the rig (3, metres), direction (3, unit)
// Evaluation fails, and with it the step that led there, for a marker the camera cannot see; a
// silent zero would draw the target behind the camera.
enum class MarkerBlock : uint8_t {
  kRotation,
  kTranslation,
  kIntrinsics,
  kOffset,
  kRate,
  kLineDelay,
  kPosition,
  kTarget
};
inline constexpr size_t kMarkerBlockCount = 8;

// With T = double the residual, with Ceres's Jets automatic differentiation.
struct MarkerFunctor {
  DistortionModel model;
  MeasuredMarker<double> measured;
  double clock_time_s;
  double middle_row;

  template <typename T>
  bool operator()(const T* rotation, const T* translation, const T* intrinsics, const T* offset,
                  const T* rate, const T* line_delay, const T* position, const T* target,
                  T* residuals) const {
    const T* const blocks[kMarkerBlockCount] = {rotation, translation, intrinsics, offset,
                                                rate,     line_delay,  position,   target};
    ProjectedPoint<T> projected;
    return Evaluate<false, false>(SeenFrom(blocks), &projected, residuals);
  }

  // The view, the line in it, and the marker's point.
  template <typename T>
  struct Seen {
    ViewEstimate<T> view;
    LineInView<T> line;
    Vec3<T> x_in_cam;
  };
  template <typename T>
  Seen<T> SeenFrom(T const* const* blocks) const {
    const T* const target = blocks[static_cast<size_t>(MarkerBlock::kTarget)];
    Seen<T> seen;
    seen.view = ViewFrom(blocks);
    seen.line = SeeLine(seen.view, Vec3<T>{target[0], target[1], target[2]},
                        Vec3<T>{target[3], target[4], target[5]});
    seen.x_in_cam =
        seen.line.start + *blocks[static_cast<size_t>(MarkerBlock::kPosition)] * seen.line.slope;
    return seen;
  }
  // Of a marker at this place, wherever it comes from. The line is left empty.
  template <typename T>
  Seen<T> SeenAt(T const* const* blocks, const Vec3<T>& x_in_rig) const {
    Seen<T> seen{ViewFrom(blocks), {}, {}};
    const T* const t = seen.view.translation;
    seen.x_in_cam = Times(seen.view.rotation, x_in_rig) + Vec3<T>{t[0], t[1], t[2]};
    return seen;
  }
  // Of the first six blocks.
  template <typename T>
  ViewEstimate<T> ViewFrom(T const* const* blocks) const {
    const auto block = [blocks](MarkerBlock which) { return blocks[static_cast<size_t>(which)]; };
    ViewEstimate<T> view;
    view.model = model;
    Eigen::Map<Eigen::Matrix<T, 3, 3, Eigen::RowMajor>>(view.rotation) =
        Eigen::Map<const Eigen::Quaternion<T>>(block(MarkerBlock::kRotation)).toRotationMatrix();
    std::copy_n(block(MarkerBlock::kTranslation), 3, view.translation);
    std::copy_n(block(MarkerBlock::kIntrinsics), 4 + CoefficientCount(model), view.intrinsics);
    view.offset_s = *block(MarkerBlock::kOffset);
    view.rate = *block(MarkerBlock::kRate);
    view.line_delay_s = *block(MarkerBlock::kLineDelay);
    view.middle_row = T(middle_row);
    return view;
  }

  template <bool kPointDerivatives, bool kIntrinsicsDerivatives, typename T>
  bool Evaluate(const Seen<T>& seen, ProjectedPoint<T>* projected, T* residuals) const {
    if (!(seen.x_in_cam.z > T(0.0))) return false;
    const T point[3] = {seen.x_in_cam.x, seen.x_in_cam.y, seen.x_in_cam.z};
    ProjectPoint<kPointDerivatives, kIntrinsicsDerivatives>(model, seen.view.intrinsics, point,
                                                            projected);
    if (!(projected->visible > T(0.0))) return false;
    const MeasuredMarker<T> m = {T(measured.a),
                                 T(measured.b),
                                 T(measured.c),
                                 {T(measured.centre[0]), T(measured.centre[1])},
                                 {T(measured.velocity[0]), T(measured.velocity[1])}};
    const T dt = TimeShift(seen.view, T(clock_time_s)) +
                 seen.view.line_delay_s * RowsLate(seen.view, m.centre[1]);
    WhitenedResidual(m, *projected, dt, &residuals[0], &residuals[1]);
    return true;
  }
};

// The derivatives by x y z w of unit q, given that by a rotation vector applied from the left:
// along the sphere, on which alone q moves, half a rotation vector v is the step (v, 0) * q.
void StoreQuaternionDerivative(const Vec3<double>& d_rotation, const double* q, double* to);

// The part of a residual's Jacobian that every kind of target has: by the blocks of the view.
// `rows` is that by x_in_cam, see PointDerivative.
void StoreViewDerivatives(const MarkerFunctor& functor, const MarkerFunctor::Seen<double>& seen,
                          const ProjectedPoint<double>& projected, const Vec3<double>* rows,
                          double const* const* parameters, double** jacobians);

// The same with analytic derivatives.
class MarkerCost final : public ceres::CostFunction {
 public:
  MarkerCost(const BundleCamera& camera, const BundleMarker& marker, double clock_time_s);

  bool Evaluate(double const* const* parameters, double* residuals,
                double** jacobians) const override;

 private:
  MarkerFunctor functor_;
};

// ((b - a) - span) / sigma for two scalar blocks a, b: the build tolerance of a target's span.
struct SpanPrior {
  double span_m, sigma_m;

  template <typename T>
  bool operator()(const T* a, const T* b, T* residual) const {
    *residual = (*b - *a - span_m) / sigma_m;
    return true;
  }
};

// (|c_b - c_a| - distance) / sigma, with c the centres of two cameras. Parameter blocks: rotation
// (4) and translation (3) of cam_from_rig of a, then of b, as in MarkerCost. Fails where the
// centres are one place, from which there is no direction to step to.
struct DistancePrior {
  double distance_m, sigma_m;

  template <typename T>
  bool operator()(const T* rotation_a, const T* translation_a, const T* rotation_b,
                  const T* translation_b, T* residual) const {
    const auto centre = [](const T* rotation, const T* translation) -> Eigen::Vector3<T> {
      return Eigen::Map<const Eigen::Quaternion<T>>(rotation).conjugate() *
             Eigen::Vector3<T>(-Eigen::Map<const Eigen::Vector3<T>>(translation));
    };
    const Eigen::Vector3<T> difference =
        centre(rotation_b, translation_b) - centre(rotation_a, translation_a);
    if (!(difference.squaredNorm() > T(0))) return false;
    *residual = (difference.norm() - distance_m) / sigma_m;
    return true;
  }
};

}  // namespace rigcal::server

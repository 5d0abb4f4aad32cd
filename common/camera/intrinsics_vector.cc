// SPDX-License-Identifier: Apache-2.0
#include "common/camera/intrinsics_vector.h"

namespace rigcal {

int IntrinsicsSize(DistortionModel model) { return 4 + CoefficientCount(model); }

IntrinsicsVector ToVector(const Intrinsics& intrinsics) {
  IntrinsicsVector values = IntrinsicsVector::Zero(IntrinsicsSize(intrinsics.model));
  values.head<4>() << intrinsics.fx_px, intrinsics.fy_px, intrinsics.cx_px, intrinsics.cy_px;
  for (size_t i = 0; i < intrinsics.distortion.size(); ++i) {
    values[static_cast<Eigen::Index>(i) + 4] = intrinsics.distortion[i];
  }
  return values;
}

Intrinsics FromVector(DistortionModel model, const IntrinsicsVector& values) {
  Intrinsics intrinsics;
  intrinsics.model = model;
  intrinsics.fx_px = values[0];
  intrinsics.fy_px = values[1];
  intrinsics.cx_px = values[2];
  intrinsics.cy_px = values[3];
  intrinsics.distortion.assign(values.data() + 4, values.data() + values.size());
  return intrinsics;
}

}  // namespace rigcal

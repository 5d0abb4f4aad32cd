// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <cstdint>

#include "absl/container/inlined_vector.h"

namespace rigcal {

// The kind of a marker's centre, so that the correction from one to the other is made once.
enum class CentreKind : uint8_t {
  kImageBlob = 1,     // centre of the marker's image (an ellipse)
  kSphereCentre = 2,  // projection of the sphere's centre
};

struct MarkerObservation {
  bool visible = false;
  Eigen::Vector2d centre_px = Eigen::Vector2d::Zero();
  Eigen::Matrix2d covariance_px2 = Eigen::Matrix2d::Identity();
  int32_t time_delta_ns = 0;  // time of this centre minus the observation's time
  float label_confidence = 1;
  CentreKind centre_kind = CentreKind::kImageBlob;
};

// One camera's view of the target at one time. Without a visible marker it is empty: the camera
// looked and saw no wand.
struct Observation {
  int64_t time_ns = 0;  // the camera's clock
  uint32_t clock_epoch = 0;
  absl::InlinedVector<MarkerObservation, 3> markers;

  int VisibleCount() const {
    int count = 0;
    for (const MarkerObservation& marker : markers) count += marker.visible ? 1 : 0;
    return count;
  }
};

}  // namespace rigcal

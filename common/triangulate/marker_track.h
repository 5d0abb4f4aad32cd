// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <optional>
#include <vector>

#include "common/associate/motion_weights.h"
#include "common/calibration/calibration.h"
#include "common/target/observation.h"

namespace rigcal {

// Rig time of a moment of a camera's clock, by the clock of its calibration: offset, rate and
// course.
int64_t RigTimeNs(const CalibratedCamera& camera, int64_t camera_time_ns);

// So much later than the clock says is an image row of a rolling shutter seen; 0 without one.
int64_t LineDelayNs(const CalibratedCamera& camera, double y_px);

// A centre as it would have been seen at another time.
struct MovedCentre {
  Eigen::Vector2d centre_px = Eigen::Vector2d::Zero();
  // Of the sum of rows that it is, with what the fit of the motion leaves out.
  Eigen::Matrix2d covariance_px2 = Eigen::Matrix2d::Identity();
  CentreKind centre_kind = CentreKind::kImageBlob;
};

// One marker in the image of one camera, through time.
class MarkerTrack {
 public:
  // `rows` ascend in time; `period_s`: median time between them, 0: not known. The rows must
  // outlive it.
  MarkerTrack(const CalibratedCamera& camera, const std::vector<Observation>& rows, size_t marker,
              double period_s);

  // The centre in `row` as it would be at `rig_time_ns`, from a local polynomial fit to the rows
  // around it (motion_weights.h); a row at that time stays as it is. None: it is not visible in the
  // row, or there is nothing around it to say how it moves.
  std::optional<MovedCentre> At(int row, int64_t rig_time_ns, MotionWeightsMemory* memory) const;

 private:
  struct Sample {
    int64_t time_ns = 0;  // rig time
    int row = 0;
    bool outlier = false;  // far from where its neighbours predict it
  };
  const MarkerObservation& Marker(const Sample& sample) const {
    return (*rows_)[static_cast<size_t>(sample.row)].markers[marker_];
  }

  const std::vector<Observation>* rows_;
  size_t marker_;
  double period_s_;
  std::vector<Sample> samples_;
  std::vector<int> sample_of_row_;  // -1: not visible
};

}  // namespace rigcal

// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "absl/container/inlined_vector.h"
#include "common/time/clock.h"

namespace rigcal {

// What a marker's centre is, so that the correction from one to the other is made once.
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

// Observations lost at an agent; their numbers will never come.
struct DroppedRange {
  uint32_t first_seq = 0;
  uint32_t count = 0;
  std::string reason;
  friend bool operator==(const DroppedRange&, const DroppedRange&) = default;
};

// Observations of one camera and one clock epoch with consecutive sequence numbers, as columns: row
// i is observation first_seq + i. Columns per marker are row-major (row * marker_count + marker)
// and always have rows * marker_count values; values of invisible markers are 0.
struct ObservationBatch {
  std::string session_id;
  std::string camera;
  uint32_t stream_epoch = 1;
  uint32_t first_seq = 1;
  uint32_t clock_epoch = 0;
  uint32_t marker_count = 0;

  std::vector<int64_t> time_ns;        // per row
  std::vector<uint32_t> visible_mask;  // per row, bit m = marker m
  std::vector<float> x_px, y_px;
  std::vector<float> cov_xx_px2, cov_xy_px2, cov_yy_px2;
  std::vector<int32_t> time_delta_ns;
  std::vector<float> label_confidence;
  std::vector<uint8_t> centre_kind;  // CentreKind; 0 for invisible markers

  std::vector<ClockSample> clock_samples;
  std::vector<HostAlignment> host_alignments;
  std::vector<DroppedRange> dropped;

  size_t rows() const { return time_ns.size(); }
  uint32_t end_seq() const {
    return first_seq + static_cast<uint32_t>(rows());
  }  // one past the last

  // Adds a row; `observation.clock_epoch` must be this batch's and its markers `marker_count`.
  void Append(const Observation& observation);
  Observation Row(size_t row) const;
  // Rows [begin, end) with their numbers; samples, alignments and dropped ranges go with `begin ==
  // 0`.
  ObservationBatch Slice(size_t begin, size_t end) const;
};

}  // namespace rigcal

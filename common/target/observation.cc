// SPDX-License-Identifier: Apache-2.0
#include "common/target/observation.h"

#include <cassert>

namespace rigcal {
namespace {

template <typename T>
void CopyRange(const std::vector<T>& from, size_t begin, size_t end, std::vector<T>* to) {
  to->assign(from.begin() + static_cast<std::ptrdiff_t>(begin),
             from.begin() + static_cast<std::ptrdiff_t>(end));
}

}  // namespace

void ObservationBatch::Append(const Observation& observation) {
  assert(observation.clock_epoch == clock_epoch);
  assert(observation.markers.size() == marker_count);
  uint32_t mask = 0;
  for (uint32_t m = 0; m < marker_count; ++m) {
    const bool visible = m < observation.markers.size() && observation.markers[m].visible;
    if (!visible) {
      for (std::vector<float>* column :
           {&x_px, &y_px, &cov_xx_px2, &cov_xy_px2, &cov_yy_px2, &label_confidence}) {
        column->push_back(0);
      }
      time_delta_ns.push_back(0);
      centre_kind.push_back(0);
      continue;
    }
    const MarkerObservation& marker = observation.markers[m];
    mask |= uint32_t{1} << m;
    x_px.push_back(static_cast<float>(marker.centre_px.x()));
    y_px.push_back(static_cast<float>(marker.centre_px.y()));
    cov_xx_px2.push_back(static_cast<float>(marker.covariance_px2(0, 0)));
    cov_xy_px2.push_back(static_cast<float>(marker.covariance_px2(0, 1)));
    cov_yy_px2.push_back(static_cast<float>(marker.covariance_px2(1, 1)));
    label_confidence.push_back(marker.label_confidence);
    time_delta_ns.push_back(marker.time_delta_ns);
    centre_kind.push_back(static_cast<uint8_t>(marker.centre_kind));
  }
  time_ns.push_back(observation.time_ns);
  visible_mask.push_back(mask);
}

Observation ObservationBatch::Row(size_t row) const {
  assert(row < rows());
  Observation observation;
  observation.time_ns = time_ns[row];
  observation.clock_epoch = clock_epoch;
  observation.markers.resize(marker_count);
  for (uint32_t m = 0; m < marker_count; ++m) {
    if ((visible_mask[row] >> m & 1u) == 0) continue;
    const size_t i = row * marker_count + m;
    MarkerObservation& marker = observation.markers[m];
    marker.visible = true;
    marker.centre_px = {x_px[i], y_px[i]};
    marker.covariance_px2 << cov_xx_px2[i], cov_xy_px2[i], cov_xy_px2[i], cov_yy_px2[i];
    marker.time_delta_ns = time_delta_ns[i];
    marker.label_confidence = label_confidence[i];
    marker.centre_kind = static_cast<CentreKind>(centre_kind[i]);
  }
  return observation;
}

ObservationBatch ObservationBatch::Slice(size_t begin, size_t end) const {
  assert(begin <= end && end <= rows());
  ObservationBatch slice;
  slice.session_id = session_id;
  slice.camera = camera;
  slice.stream_epoch = stream_epoch;
  slice.first_seq = first_seq + static_cast<uint32_t>(begin);
  slice.clock_epoch = clock_epoch;
  slice.marker_count = marker_count;
  CopyRange(time_ns, begin, end, &slice.time_ns);
  CopyRange(visible_mask, begin, end, &slice.visible_mask);
  const size_t first = begin * marker_count;
  const size_t last = end * marker_count;
  CopyRange(x_px, first, last, &slice.x_px);
  CopyRange(y_px, first, last, &slice.y_px);
  CopyRange(cov_xx_px2, first, last, &slice.cov_xx_px2);
  CopyRange(cov_xy_px2, first, last, &slice.cov_xy_px2);
  CopyRange(cov_yy_px2, first, last, &slice.cov_yy_px2);
  CopyRange(time_delta_ns, first, last, &slice.time_delta_ns);
  CopyRange(label_confidence, first, last, &slice.label_confidence);
  CopyRange(centre_kind, first, last, &slice.centre_kind);
  if (begin == 0) {
    slice.clock_samples = clock_samples;
    slice.host_alignments = host_alignments;
    slice.dropped = dropped;
  }
  return slice;
}

}  // namespace rigcal

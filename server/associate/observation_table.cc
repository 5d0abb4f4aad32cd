// SPDX-License-Identifier: Apache-2.0
#include "server/associate/observation_table.h"

#include <utility>

namespace rigcal::server {

ObservationTable::ObservationTable(const std::vector<Observation>& rows) {
  for (const Observation& row : rows) {
    if (row.markers.size() > width_) width_ = row.markers.size();
  }
  reserve(rows.size(), width_);
  for (const Observation& row : rows) push_back(row);
}

void ObservationTable::reserve(size_t rows, size_t markers) {
  if (empty()) width_ = markers;
  time_ns_.reserve(rows);
  clock_epoch_.Reserve(rows);
  visible_.reserve(rows * words());
  bare_.reserve(rows);
  const size_t values = rows * markers;
  for (RealColumn* column : {&x_px_, &y_px_, &xx_px2_, &xy_px2_, &yy_px2_}) column->Reserve(values);
  delta_ns_.Reserve(values);
  confidence_.Reserve(values);
  kind_.Reserve(values);
}

void ObservationTable::AppendMarker(const MarkerObservation& marker) {
  const size_t before = marker_count_++;
  if (!marker.visible) {
    for (RealColumn* column : {&x_px_, &y_px_, &xx_px2_, &xy_px2_, &yy_px2_}) column->Append(0);
    delta_ns_.AppendAny();
    confidence_.AppendAny();
    kind_.AppendAny();
    return;
  }
  x_px_.Append(marker.centre_px.x());
  y_px_.Append(marker.centre_px.y());
  xx_px2_.Append(marker.covariance_px2(0, 0));
  xy_px2_.Append(marker.covariance_px2(0, 1));
  yy_px2_.Append(marker.covariance_px2(1, 1));
  delta_ns_.Append(before, marker.time_delta_ns);
  confidence_.Append(before, marker.label_confidence);
  kind_.Append(before, static_cast<uint8_t>(marker.centre_kind));
}

void ObservationTable::push_back(const Observation& row) {
  if (row.markers.size() > width_) {
    // The rows before get as many. Happens once, and to the rows of a few empty views.
    ObservationTable wider;
    wider.width_ = row.markers.size();
    wider.reserve(time_ns_.capacity(), row.markers.size());
    for (const Observation& earlier : *this) wider.push_back(earlier);
    *this = std::move(wider);
  }
  const size_t first_word = visible_.size();
  visible_.resize(first_word + words());
  for (size_t m = 0; m < width_; ++m) {
    if (m < row.markers.size()) {
      visible_[first_word + m / 32] |= uint32_t{row.markers[m].visible} << m % 32;
      AppendMarker(row.markers[m]);
    } else {
      AppendMarker({});
    }
  }
  clock_epoch_.Append(time_ns_.size(), row.clock_epoch);
  time_ns_.push_back(row.time_ns);
  bare_.push_back(row.markers.empty());
}

MarkerObservation ObservationTable::Marker(size_t row, size_t marker) const {
  MarkerObservation observation;
  if (!IsVisible(row, marker)) return observation;
  const size_t i = At(row, marker);
  observation.visible = true;
  observation.centre_px = centre_px(row, marker);
  observation.covariance_px2 = covariance_px2(row, marker);
  observation.time_delta_ns = delta_ns_[i];
  observation.label_confidence = confidence_[i];
  observation.centre_kind = static_cast<CentreKind>(kind_[i]);
  return observation;
}

Observation ObservationTable::operator[](size_t row) const {
  Observation observation;
  observation.time_ns = time_ns_[row];
  observation.clock_epoch = clock_epoch_[row];
  const size_t markers = MarkerCount(row);
  for (size_t m = 0; m < markers; ++m) observation.markers.push_back(Marker(row, m));
  return observation;
}

ObservationTable ObservationTable::Select(const std::vector<uint32_t>& rows) const {
  ObservationTable selected;
  selected.width_ = width_;
  selected.reserve(rows.size(), width_);
  for (const uint32_t row : rows) selected.push_back((*this)[row]);
  return selected;
}

size_t ObservationTable::Bytes() const {
  size_t bytes = time_ns_.capacity() * sizeof(int64_t) + visible_.capacity() * sizeof(uint32_t) +
                 bare_.capacity() / 8 + clock_epoch_.Bytes() + delta_ns_.Bytes() +
                 confidence_.Bytes() + kind_.Bytes();
  for (const RealColumn* column : {&x_px_, &y_px_, &xx_px2_, &xy_px2_, &yy_px2_}) {
    bytes += column->Bytes();
  }
  return bytes;
}

}  // namespace rigcal::server

// SPDX-License-Identifier: Apache-2.0
#include "common/session/observation_batch.h"

#include <cassert>

#include "absl/strings/str_cat.h"
#include "common/status/status_macros.h"
#include "common/target/target.h"

namespace rigcal {
namespace {

const MarkerObservation kInvisible = {
    .covariance_px2 = Eigen::Matrix2d::Zero(), .label_confidence = 0, .centre_kind = CentreKind{0}};

absl::Status Fault(absl::string_view field, absl::string_view what) {
  return absl::InvalidArgumentError(absl::StrCat(field, ": ", what));
}

absl::Status CheckColumns(const ObservationBatch& batch) {
  const size_t rows = batch.rows();
  if (rows > kMaxBatchRows) {
    return Fault("time_ns", absl::StrCat("has ", rows, " rows, at most ", kMaxBatchRows,
                                         " are allowed: send the batch in parts"));
  }
  if (batch.marker_count > static_cast<uint32_t>(kMaxMarkers) ||
      (batch.marker_count == 0 && rows > 0)) {
    return Fault("marker_count",
                 absl::StrCat(batch.marker_count, " is not within 1 to ", kMaxMarkers));
  }
  const size_t values = rows * batch.marker_count;
  const struct {
    const char* name;
    size_t size;
    size_t expected;
  } columns[] = {
      {"visible_mask", batch.visible_mask.size(), rows},
      {"x_px", batch.x_px.size(), values},
      {"y_px", batch.y_px.size(), values},
      {"cov_xx_px2", batch.cov_xx_px2.size(), values},
      {"cov_xy_px2", batch.cov_xy_px2.size(), values},
      {"cov_yy_px2", batch.cov_yy_px2.size(), values},
      {"time_delta_ns", batch.time_delta_ns.size(), values},
      {"label_confidence", batch.label_confidence.size(), values},
      {"centre_kind", batch.centre_kind.size(), values},
  };
  for (const auto& column : columns) {
    if (column.size == column.expected) continue;
    return Fault(column.name,
                 absl::StrCat("has ", column.size, " values, expected ", column.expected, " for ",
                              rows, " rows of ", batch.marker_count, " markers"));
  }
  return absl::OkStatus();
}

absl::Status CheckVisibleMarkers(const ObservationBatch& batch) {
  for (size_t row = 0; row < batch.rows(); ++row) {
    const uint32_t mask = batch.visible_mask[row];
    if (batch.marker_count > kMaskMarkers) {
      uint32_t visible = 0;
      for (uint32_t m = 0; m < batch.marker_count; ++m) visible += batch.IsVisible(row, m) ? 1 : 0;
      if (mask != visible) {
        return Fault(absl::StrCat("visible_mask[", row, "]"),
                     absl::StrCat("is ", mask, ", but ", visible, " of the ", batch.marker_count,
                                  " markers have a kind of centre: of more than ", kMaskMarkers,
                                  " markers it is the number of visible ones"));
      }
    } else if (uint64_t{mask} >> batch.marker_count != 0) {
      return Fault(absl::StrCat("visible_mask[", row, "]"),
                   absl::StrCat("has bits beyond the ", batch.marker_count, " markers"));
    }
    for (uint32_t marker = 0; marker < batch.marker_count; ++marker) {
      const size_t i = row * batch.marker_count + marker;
      const uint8_t kind = batch.centre_kind[i];
      if (!batch.IsVisible(row, marker) || kind == static_cast<uint8_t>(CentreKind::kImageBlob) ||
          kind == static_cast<uint8_t>(CentreKind::kSphereCentre)) {
        continue;
      }
      return Fault(absl::StrCat("centre_kind[", i, "]"),
                   absl::StrCat(kind, " is no kind of centre, but the marker is visible"));
    }
  }
  return absl::OkStatus();
}

absl::Status CheckNumbers(const ObservationBatch& batch) {
  const auto fits = [](uint64_t first, uint64_t count) {
    return first >= 1 && first + count <= uint64_t{kMaxSeq} + 1;
  };
  if (batch.rows() > 0 && !fits(batch.first_seq, batch.rows())) {
    return Fault("first_seq", absl::StrCat(batch.rows(), " rows from ", batch.first_seq,
                                           " are not within 1 to ", kMaxSeq));
  }
  for (size_t i = 0; i < batch.dropped.size(); ++i) {
    const DroppedRange& range = batch.dropped[i];
    const std::string field = absl::StrCat("dropped[", i, "]");
    if (range.count == 0 || !fits(range.first_seq, range.count)) {
      return Fault(field, absl::StrCat(range.count, " from ", range.first_seq,
                                       " is not a range within 1 to ", kMaxSeq));
    }
    if (batch.rows() > 0 && range.first_seq < batch.end_seq() &&
        batch.first_seq < range.first_seq + range.count) {
      return Fault(field, "overlaps the rows of the batch");
    }
    if (range.reason == RefusalReason::kUnspecified) {
      return Fault(field + ".reason", "is not a known reason");
    }
  }
  return absl::OkStatus();
}

}  // namespace

void ObservationBatch::Reserve(size_t row_count) {
  time_ns.reserve(row_count);
  visible_mask.reserve(row_count);
  for (std::vector<float>* column :
       {&x_px, &y_px, &cov_xx_px2, &cov_xy_px2, &cov_yy_px2, &label_confidence}) {
    column->reserve(row_count * marker_count);
  }
  time_delta_ns.reserve(row_count * marker_count);
  centre_kind.reserve(row_count * marker_count);
}

void ObservationBatch::Append(const Observation& observation) {
  assert(observation.clock_epoch == clock_epoch);
  assert(observation.markers.size() == marker_count);
  uint32_t mask = 0;
  for (uint32_t m = 0; m < marker_count; ++m) {
    const bool visible = m < observation.markers.size() && observation.markers[m].visible;
    const MarkerObservation& marker = visible ? observation.markers[m] : kInvisible;
    mask = marker_count > kMaskMarkers ? mask + uint32_t{visible} : mask | uint32_t{visible} << m;
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
    if (!IsVisible(row, m)) continue;
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
  slice.stream = stream;
  slice.first_seq = first_seq + static_cast<uint32_t>(begin);
  slice.clock_epoch = clock_epoch;
  slice.marker_count = marker_count;
  const auto copy = [&](size_t width, auto... columns) {
    const auto at = [width](const auto& column, size_t row) {
      return column.begin() + static_cast<std::ptrdiff_t>(row * width);
    };
    ((slice.*columns).assign(at(this->*columns, begin), at(this->*columns, end)), ...);
  };
  using Batch = ObservationBatch;
  copy(1, &Batch::time_ns, &Batch::visible_mask);
  copy(marker_count, &Batch::x_px, &Batch::y_px, &Batch::cov_xx_px2, &Batch::cov_xy_px2,
       &Batch::cov_yy_px2, &Batch::time_delta_ns, &Batch::label_confidence, &Batch::centre_kind);
  if (begin == 0) {
    slice.clock_samples = clock_samples;
    slice.host_alignments = host_alignments;
    slice.dropped = dropped;
  }
  return slice;
}

absl::Status CheckShape(const ObservationBatch& batch) {
  RIGCAL_RETURN_IF_ERROR(CheckColumns(batch));
  RIGCAL_RETURN_IF_ERROR(CheckNumbers(batch));
  return CheckVisibleMarkers(batch);
}

}  // namespace rigcal

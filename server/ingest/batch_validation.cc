// SPDX-License-Identifier: Apache-2.0
#include "server/ingest/batch_validation.h"

#include <cmath>
#include <limits>
#include <string>

#include "absl/strings/str_cat.h"
#include "common/status/status_macros.h"
#include "server/store/sqlite/batch_blob.h"
#include "server/store/stream_ledger.h"

namespace rigcal::server {
namespace {

constexpr int64_t kMaxTimeNs = int64_t{1} << 62;
constexpr int32_t kMaxTimeDeltaNs = 1'000'000'000;
constexpr double kMinVariancePx2 = 1e-8;

// A fault of one row. Texts are static; `field` null: none.
struct RowFault {
  const char* field = nullptr;
  size_t index = 0;  // of the value within its column
  const char* reason = nullptr;
  const char* detail = nullptr;
};

// Where a centre may lie, and how uncertain it may be.
struct Limits {
  float x_min_px, x_max_px, y_min_px, y_max_px;
  double max_variance_px2;
};

Limits LimitsFor(const ImageSize& size) {
  const auto width = static_cast<float>(size.width);
  const auto height = static_cast<float>(size.height);
  return {.x_min_px = -0.5f - width,
          .x_max_px = 2 * width - 0.5f,
          .y_min_px = -0.5f - height,
          .y_max_px = 2 * height - 0.5f,
          .max_variance_px2 = double{width} * width + double{height} * height};
}

// Both eigenvalues of [[xx, xy], [xy, yy]] within [kMinVariancePx2, max].
bool IsSaneCovariance(double xx, double xy, double yy, double max) {
  const double low_x = xx - kMinVariancePx2;
  const double low_y = yy - kMinVariancePx2;
  const double high_x = max - xx;
  const double high_y = max - yy;
  return low_x > 0 && low_y > 0 && low_x * low_y - xy * xy > 0 && high_x > 0 && high_y > 0 &&
         high_x * high_y - xy * xy > 0;
}

RowFault CheckFinite(const ObservationBatch& batch, size_t i) {
  const struct {
    const char* field;
    float value;
    const char* detail;
  } values[] = {
      {"x_px", batch.x_px[i], "the x of a marker is not finite"},
      {"y_px", batch.y_px[i], "the y of a marker is not finite"},
      {"cov_xx_px2", batch.cov_xx_px2[i], "the covariance of a marker is not finite"},
      {"cov_xy_px2", batch.cov_xy_px2[i], "the covariance of a marker is not finite"},
      {"cov_yy_px2", batch.cov_yy_px2[i], "the covariance of a marker is not finite"},
      {"label_confidence", batch.label_confidence[i], "a label confidence is not finite"},
  };
  for (const auto& value : values) {
    if (!std::isfinite(value.value)) return {value.field, i, "not_finite", value.detail};
  }
  return {};
}

// Element i of the columns is a visible marker. Written so that NaN fails each test.
RowFault CheckMarker(const ObservationBatch& batch, size_t i, const Limits& limits) {
  const bool x_inside = batch.x_px[i] >= limits.x_min_px && batch.x_px[i] <= limits.x_max_px;
  const bool y_inside = batch.y_px[i] >= limits.y_min_px && batch.y_px[i] <= limits.y_max_px;
  const bool covariance_sane = IsSaneCovariance(batch.cov_xx_px2[i], batch.cov_xy_px2[i],
                                                batch.cov_yy_px2[i], limits.max_variance_px2);
  const bool time_near =
      batch.time_delta_ns[i] >= -kMaxTimeDeltaNs && batch.time_delta_ns[i] <= kMaxTimeDeltaNs;
  const bool confidence_sane = batch.label_confidence[i] >= 0 && batch.label_confidence[i] <= 1;
  if (x_inside && y_inside && covariance_sane && time_near && confidence_sane) return {};

  if (const RowFault fault = CheckFinite(batch, i); fault.field != nullptr) return fault;
  if (!x_inside || !y_inside) {
    return {x_inside ? "y_px" : "x_px", i, "far_outside_image",
            "a marker lies more than one image size outside of the image"};
  }
  if (!covariance_sane) {
    return {"cov_xx_px2", i, "bad_covariance",
            "the covariance of a marker is not positive definite or has no sane size"};
  }
  if (!time_near) {
    return {"time_delta_ns", i, "time_delta_too_large",
            "the time of a marker is more than 1 s from its observation's"};
  }
  return {"label_confidence", i, "bad_label_confidence", "a label confidence is not within 0 to 1"};
}

// `previous_ns`: time of the last row that was not refused.
RowFault CheckRow(const ObservationBatch& batch, size_t row, int64_t previous_ns,
                  const Limits& limits) {
  const int64_t time_ns = batch.time_ns[row];
  if (time_ns < 0 || time_ns > kMaxTimeNs) {
    return {"time_ns", row, "implausible_time", "the time is negative or beyond 2^62 ns"};
  }
  if (time_ns < previous_ns) {
    return {"time_ns", row, "time_not_increasing",
            "the time is before that of the row ahead in the same clock epoch"};
  }
  const size_t first = row * batch.marker_count;
  const uint32_t mask = batch.visible_mask[row];
  for (uint32_t marker = 0; marker < batch.marker_count; ++marker) {
    if ((mask >> marker & 1u) == 0) continue;
    const RowFault fault = CheckMarker(batch, first + marker, limits);
    if (fault.field != nullptr) return fault;
  }
  return {};
}

absl::Status CheckKinds(const ObservationBatch& batch) {
  for (size_t row = 0; row < batch.rows(); ++row) {
    const uint32_t mask = batch.visible_mask[row];
    if (mask >> batch.marker_count != 0) {
      return absl::InvalidArgumentError(absl::StrCat("visible_mask[", row, "] has bits beyond the ",
                                                     batch.marker_count, " markers"));
    }
    for (uint32_t marker = 0; marker < batch.marker_count; ++marker) {
      const size_t i = row * batch.marker_count + marker;
      const uint8_t kind = batch.centre_kind[i];
      if ((mask >> marker & 1u) == 0 || kind == static_cast<uint8_t>(CentreKind::kImageBlob) ||
          kind == static_cast<uint8_t>(CentreKind::kSphereCentre)) {
        continue;
      }
      return absl::InvalidArgumentError(
          absl::StrCat("centre_kind[", i, "] is ", kind, ", which is no kind of centre"));
    }
  }
  return absl::OkStatus();
}

absl::Status CheckNumbers(const ObservationBatch& batch) {
  const auto fits = [](uint64_t first, uint64_t count) {
    return first >= 1 && first + count <= uint64_t{kMaxSeq} + 1;
  };
  if (batch.rows() > 0 && !fits(batch.first_seq, batch.rows())) {
    return absl::InvalidArgumentError(absl::StrCat("first_seq is ", batch.first_seq, ", and with ",
                                                   batch.rows(), " rows not within 1 to ",
                                                   kMaxSeq));
  }
  for (size_t i = 0; i < batch.dropped.size(); ++i) {
    const DroppedRange& dropped = batch.dropped[i];
    if (fits(dropped.first_seq, dropped.count)) continue;
    return absl::InvalidArgumentError(absl::StrCat("dropped[", i, "]: ", dropped.count, " from ",
                                                   dropped.first_seq, " are not within 1 to ",
                                                   kMaxSeq));
  }
  return absl::OkStatus();
}

}  // namespace

absl::Status ValidateBatch(const StreamContext& context, const ObservationBatch& batch,
                           BatchFaults* faults) {
  faults->rows.clear();
  faults->listed.clear();
  RIGCAL_RETURN_IF_ERROR(CheckNumbers(batch));
  if (batch.rows() == 0) return CheckColumns(batch);
  if (batch.marker_count != static_cast<uint32_t>(context.marker_count)) {
    return absl::InvalidArgumentError(absl::StrCat("marker_count is ", batch.marker_count,
                                                   ", but the session's target has ",
                                                   context.marker_count, " markers"));
  }
  RIGCAL_RETURN_IF_ERROR(CheckColumns(batch));
  RIGCAL_RETURN_IF_ERROR(CheckKinds(batch));

  const Limits limits = LimitsFor(context.image_size_px);
  int64_t previous_ns = std::numeric_limits<int64_t>::min();
  for (size_t row = 0; row < batch.rows(); ++row) {
    const RowFault fault = CheckRow(batch, row, previous_ns, limits);
    if (fault.field == nullptr) {
      previous_ns = batch.time_ns[row];
      continue;
    }
    faults->rows.push_back(
        {.row = static_cast<uint32_t>(row), .reason = fault.reason, .detail = fault.detail});
    if (faults->listed.size() < kMaxListedFaults) {
      faults->listed.push_back({.seq = batch.first_seq + static_cast<uint32_t>(row),
                                .field = absl::StrCat(fault.field, "[", fault.index, "]"),
                                .reason = fault.reason});
    }
  }
  return absl::OkStatus();
}

}  // namespace rigcal::server

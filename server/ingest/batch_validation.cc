// SPDX-License-Identifier: Apache-2.0
#include "server/ingest/batch_validation.h"

#include <cmath>
#include <limits>
#include <optional>
#include <string_view>

#include "absl/strings/str_cat.h"

namespace rigcal::server {
namespace {

constexpr int64_t kMaxTimeNs = int64_t{1} << 62;
constexpr int32_t kMaxTimeDeltaNs = 1'000'000'000;
constexpr double kMinVariancePx2 = 1e-8;

// The first fault of a row; `row` is filled in by ValidateBatch.
using RowFault = std::optional<RefusedRow>;

RowFault Fault(std::string_view field, size_t value, RefusalReason reason,
               std::string_view detail) {
  return RefusedRow{
      .value = static_cast<uint32_t>(value), .field = field, .reason = reason, .detail = detail};
}

// Limits of a centre's position and covariance.
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
bool IsPlausibleCovariance(double xx, double xy, double yy, double max) {
  const double low_x = xx - kMinVariancePx2;
  const double low_y = yy - kMinVariancePx2;
  const double high_x = max - xx;
  const double high_y = max - yy;
  return low_x > 0 && low_y > 0 && low_x * low_y - xy * xy > 0 && high_x > 0 && high_y > 0 &&
         high_x * high_y - xy * xy > 0;
}

RowFault CheckFinite(const ObservationBatch& batch, size_t i) {
  const struct {
    std::string_view field;
    float value;
    std::string_view detail;
  } values[] = {
      {"x_px", batch.x_px[i], "the x of a marker is not finite"},
      {"y_px", batch.y_px[i], "the y of a marker is not finite"},
      {"cov_xx_px2", batch.cov_xx_px2[i], "the covariance of a marker is not finite"},
      {"cov_xy_px2", batch.cov_xy_px2[i], "the covariance of a marker is not finite"},
      {"cov_yy_px2", batch.cov_yy_px2[i], "the covariance of a marker is not finite"},
      {"label_confidence", batch.label_confidence[i], "a label confidence is not finite"},
  };
  for (const auto& value : values) {
    if (!std::isfinite(value.value))
      return Fault(value.field, i, RefusalReason::kNotFinite, value.detail);
  }
  return std::nullopt;
}

// Element i of the columns is a visible marker. Written so that NaN fails each test.
RowFault CheckMarker(const ObservationBatch& batch, size_t i, const Limits& limits) {
  const bool x_inside = batch.x_px[i] >= limits.x_min_px && batch.x_px[i] <= limits.x_max_px;
  const bool y_inside = batch.y_px[i] >= limits.y_min_px && batch.y_px[i] <= limits.y_max_px;
  const bool covariance_plausible = IsPlausibleCovariance(
      batch.cov_xx_px2[i], batch.cov_xy_px2[i], batch.cov_yy_px2[i], limits.max_variance_px2);
  const bool time_near =
      batch.time_delta_ns[i] >= -kMaxTimeDeltaNs && batch.time_delta_ns[i] <= kMaxTimeDeltaNs;
  const bool confidence_valid = batch.label_confidence[i] >= 0 && batch.label_confidence[i] <= 1;
  if (x_inside && y_inside && covariance_plausible && time_near && confidence_valid)
    return std::nullopt;

  if (RowFault fault = CheckFinite(batch, i)) return fault;
  if (!x_inside || !y_inside) {
    return Fault(x_inside ? "y_px" : "x_px", i, RefusalReason::kFarOutsideImage,
                 "a marker lies more than one image size outside of the image");
  }
  if (!covariance_plausible) {
    return Fault("cov_xx_px2", i, RefusalReason::kBadCovariance,
                 "the covariance of a marker is not positive definite or has no plausible size");
  }
  if (!time_near) {
    return Fault("time_delta_ns", i, RefusalReason::kTimeDeltaTooLarge,
                 "the time of a marker is more than 1 s from its observation's");
  }
  return Fault("label_confidence", i, RefusalReason::kBadLabelConfidence,
               "a label confidence is not within 0 to 1");
}

// `previous_ns`: time of the last row that was not refused.
RowFault CheckRow(const ObservationBatch& batch, size_t row, int64_t previous_ns,
                  const Limits& limits) {
  const int64_t time_ns = batch.time_ns[row];
  if (time_ns < -kMaxTimeNs || time_ns > kMaxTimeNs) {
    return Fault("time_ns", row, RefusalReason::kImplausibleTime, "the time is beyond 2^62 ns");
  }
  if (time_ns < previous_ns) {
    return Fault("time_ns", row, RefusalReason::kTimeNotIncreasing,
                 "the time is before that of the previous row in the same clock epoch");
  }
  const size_t first = row * batch.marker_count;
  for (uint32_t marker = 0; marker < batch.marker_count; ++marker) {
    if (!batch.IsVisible(row, marker)) continue;
    if (RowFault fault = CheckMarker(batch, first + marker, limits)) return fault;
  }
  return std::nullopt;
}

}  // namespace

absl::StatusOr<std::vector<RefusedRow>> ValidateBatch(const StreamContext& context,
                                                      const ObservationBatch& batch) {
  std::vector<RefusedRow> refused_rows;
  if (batch.rows() == 0) return refused_rows;
  if (batch.marker_count != static_cast<uint32_t>(context.marker_count)) {
    return absl::InvalidArgumentError(absl::StrCat("marker_count is ", batch.marker_count,
                                                   ", but the session's target has ",
                                                   context.marker_count, " markers"));
  }
  const Limits limits = LimitsFor(context.image_size_px);
  int64_t previous_ns = std::numeric_limits<int64_t>::min();
  for (size_t row = 0; row < batch.rows(); ++row) {
    RowFault fault = CheckRow(batch, row, previous_ns, limits);
    if (!fault) {
      previous_ns = batch.time_ns[row];
      continue;
    }
    fault->row = static_cast<uint32_t>(row);
    refused_rows.push_back(*fault);
  }
  return refused_rows;
}

}  // namespace rigcal::server

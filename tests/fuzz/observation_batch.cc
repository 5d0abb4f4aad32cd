// SPDX-License-Identifier: Apache-2.0
// Batches from the wire: form, then values. What passes both must be what the store may take.
#include "common/session/observation_batch.h"

#include <cmath>
#include <cstdint>

#include "common/wire/observation_wire.h"
#include "rigcal/v1/observation.pb.h"
#include "server/ingest/batch_validation.h"
#include "tests/fuzz/fuzz_check.h"

using ::rigcal::Observation;
using ::rigcal::ObservationBatch;
using ::rigcal::server::StreamContext;

namespace {

void CheckKept(const Observation& row, const StreamContext& context) {
  FUZZ_CHECK(row.time_ns >= 0 && row.time_ns <= int64_t{1} << 62);
  const double width = context.image_size_px.width, height = context.image_size_px.height;
  for (const auto& marker : row.markers) {
    if (!marker.visible) continue;
    FUZZ_CHECK(marker.centre_px.x() >= -width && marker.centre_px.x() <= 2 * width);
    FUZZ_CHECK(marker.centre_px.y() >= -height && marker.centre_px.y() <= 2 * height);
    FUZZ_CHECK(marker.covariance_px2(0, 0) > 0 && marker.covariance_px2(1, 1) > 0);
    FUZZ_CHECK(std::isfinite(marker.covariance_px2(0, 1)));
    FUZZ_CHECK(std::abs(int64_t{marker.time_delta_ns}) <= 1'000'000'000);
    FUZZ_CHECK(marker.label_confidence >= 0 && marker.label_confidence <= 1);
  }
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  rigcal::v1::ObservationBatch proto;
  if (!proto.ParseFromArray(data, static_cast<int>(size))) return 0;
  const auto batch = rigcal::wire::FromProto(proto);
  if (!batch.ok()) {
    FUZZ_CHECK(batch.status().code() == absl::StatusCode::kInvalidArgument);
    return 0;
  }
  FUZZ_CHECK(rigcal::CheckShape(*batch).ok());
  const StreamContext context{.image_size_px = {640, 480}, .marker_count = 3};
  const auto refused_rows = ValidateBatch(context, *batch);
  if (!refused_rows.ok()) {
    FUZZ_CHECK(refused_rows.status().code() == absl::StatusCode::kInvalidArgument);
    return 0;
  }
  size_t next = 0;
  for (uint32_t i = 0; i < batch->rows(); ++i) {
    if (next < refused_rows->size() && (*refused_rows)[next].row == i) {
      FUZZ_CHECK((*refused_rows)[next].reason != rigcal::RefusalReason::kUnspecified);
      ++next;
    } else {
      CheckKept(batch->Row(i), context);
    }
  }
  FUZZ_CHECK(next == refused_rows->size());
  rigcal::v1::ObservationBatch again;
  rigcal::wire::ToProto(*batch, &again);
  FUZZ_CHECK(rigcal::wire::FromProto(again).ok());
  return 0;
}

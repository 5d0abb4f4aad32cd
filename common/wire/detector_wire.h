// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "absl/status/statusor.h"
#include "common/session/detector.h"
#include "rigcal/v1/detector.pb.h"

namespace rigcal::wire {

v1::ColourRange ToProto(const ColourRange& colour);
// INVALID_ARGUMENT lists every fault.
absl::StatusOr<ColourRange> FromProto(const v1::ColourRange& proto);
v1::Detector ToProto(const DetectorState& state);
v1::DetectorRequest ToProto(const DetectorRequest& request);
// INVALID_ARGUMENT names the field.
absl::StatusOr<DetectorRequest> FromProto(const v1::DetectorRequest& proto);
v1::DetectorAnswer ToProto(const DetectorAnswer& answer);
// INVALID_ARGUMENT names the field. Long messages are cut.
absl::StatusOr<DetectorAnswer> FromProto(const v1::DetectorAnswer& proto);

}  // namespace rigcal::wire

// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "absl/status/statusor.h"
#include "common/session/offer.h"
#include "rigcal/v1/offer.pb.h"

namespace rigcal::wire {

v1::OfferedCamera ToProto(const OfferedCamera& camera);
v1::OfferedCameras ToProto(const std::vector<OfferedCamera>& cameras);
// INVALID_ARGUMENT names the field: no device, one twice, too many, a use that is not known,
// control characters.
absl::StatusOr<std::vector<OfferedCamera>> FromProto(const v1::OfferedCameras& proto);

v1::ChoiceRequest ToProto(const ChoiceRequest& request);
// INVALID_ARGUMENT names the field.
absl::StatusOr<ChoiceRequest> FromProto(const v1::ChoiceRequest& proto);
v1::ChoiceAnswer ToProto(const ChoiceAnswer& answer);
// INVALID_ARGUMENT names the field. Long messages are cut.
absl::StatusOr<ChoiceAnswer> FromProto(const v1::ChoiceAnswer& proto);

}  // namespace rigcal::wire

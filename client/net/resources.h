// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <utility>

#include "absl/status/statusor.h"
#include "rigcal/v1/calibration.pb.h"
#include "rigcal/v1/session.pb.h"

namespace rigcal::client {

// The resource in a response.
template <typename Response>
absl::StatusOr<rigcal::v1::Session> SessionOf(absl::StatusOr<Response> response) {
  if (!response.ok()) return response.status();
  return std::move(*response->mutable_session());
}
template <typename Response>
absl::StatusOr<rigcal::v1::Calibration> CalibrationOf(absl::StatusOr<Response> response) {
  if (!response.ok()) return response.status();
  return std::move(*response->mutable_calibration());
}

}  // namespace rigcal::client

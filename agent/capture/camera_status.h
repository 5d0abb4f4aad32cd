// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include "absl/status/statusor.h"
#include "absl/strings/str_cat.h"

namespace rigcal::agent {

// `status` with the camera's name before its message, and `advice` behind it.
inline absl::Status OfCamera(const std::string& camera, const absl::Status& status,
                             const std::string& advice = "") {
  return absl::Status(status.code(),
                      absl::StrCat("camera ", camera, ": ", std::string(status.message()), advice));
}
template <typename T>
absl::StatusOr<T> OfCamera(const std::string& camera, absl::StatusOr<T> result,
                           const std::string& advice = "") {
  if (!result.ok()) return OfCamera(camera, result.status(), advice);
  return result;
}

}  // namespace rigcal::agent

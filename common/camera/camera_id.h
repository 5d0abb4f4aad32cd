// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <compare>
#include <string>
#include <string_view>

#include "absl/status/status.h"

namespace rigcal {

// A camera, known by `rig/camera`. The name is the file stem or the configured id.
struct CameraId {
  std::string rig;
  std::string camera;

  std::string ToString() const { return rig + "/" + camera; }
  friend auto operator<=>(const CameraId&, const CameraId&) = default;

  template <typename H>
  friend H AbslHashValue(H state, const CameraId& id) {
    return H::combine(std::move(state), id.rig, id.camera);
  }
};

// Names of rigs, cameras, sessions and agents: 1 to 64 letters, digits, '_', '-' or '.', not
// beginning with '.'. `what` begins the error message: "camera name".
absl::Status ValidateName(std::string_view what, std::string_view name);

}  // namespace rigcal

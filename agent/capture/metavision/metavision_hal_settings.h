// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <metavision/hal/device/device.h>

#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "agent/capture/metavision/metavision_device.h"

namespace rigcal::agent {

// Applies the settings to the camera before it streams and switches anti-flicker off. Returns the
// trigger inputs in use. Errors as in OpenMetavisionDevice, without the camera's name. The
// SDK may throw.
absl::StatusOr<std::vector<std::string>> ApplyMetavisionSettings(Metavision::Device& device,
                                                                 const MetavisionRequest& request);

}  // namespace rigcal::agent

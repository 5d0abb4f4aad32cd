// SPDX-License-Identifier: Apache-2.0
// What is linked where RIGCAL_METAVISION is off.
#include "absl/strings/str_cat.h"
#include "agent/capture/metavision/metavision_device.h"

namespace rigcal::agent {

absl::StatusOr<std::vector<std::string>> FindMetavisionDevices() {
  return std::vector<std::string>();
}

absl::StatusOr<std::unique_ptr<MetavisionDevice>> OpenMetavisionDevice(
    const MetavisionRequest& request) {
  return absl::FailedPreconditionError(absl::StrCat(
      "camera ", request.camera,
      ": this agent was built without live event cameras: install OpenEB or the Metavision SDK "
      "(4.1 to 5.x) and build it with cmake -DRIGCAL_METAVISION=ON (see docs/event_cameras.md); "
      "recordings need neither: raw:FILE"));
}

}  // namespace rigcal::agent

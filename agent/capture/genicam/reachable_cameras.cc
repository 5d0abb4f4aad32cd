// SPDX-License-Identifier: Apache-2.0
#include "agent/capture/genicam/reachable_cameras.h"

#include <algorithm>
#include <chrono>
#include <utility>

#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "agent/capture/genicam/gige_controller.h"
#include "agent/capture/genicam/usb_cameras.h"
#include "common/status/status_macros.h"

namespace rigcal::agent {
namespace {

ReachableCamera Examined(FoundCamera found, const std::string& network_interface) {
  constexpr std::chrono::milliseconds kWaitForHolder(500);
  ReachableCamera camera{.found = std::move(found)};
  if (camera.found.protocol != "GigEVision") return camera;
  const auto holder = GigeControllerOf(camera.found.address, network_interface, kWaitForHolder);
  if (!holder.ok()) {
    camera.state = ReachableCamera::State::kUnknown;
    camera.note = std::string(holder.status().message());
    return camera;
  }
  if (!holder->has_value()) return camera;
  camera.state = ReachableCamera::State::kInUse;
  const auto own = LocalAddressFor(camera.found.address, network_interface);
  camera.note = **holder == "0.0.0.0"          ? "by a program that the camera does not name"
                : own.ok() && *own == **holder ? std::string("by a program on this PC")
                                               : absl::StrCat("by a program at ", **holder);
  return camera;
}

ReachableCamera NotPermitted(const UsbCamera& usb) {
  return {.found = {.id = usb.serial,
                    .model = usb.model,
                    .serial = usb.serial,
                    .address = usb.node.string(),
                    .protocol = "USB3Vision",
                    .vendor = usb.vendor},
          .state = ReachableCamera::State::kNoPermission,
          .note = absl::StrCat("this user may not open ", usb.node.string(),
                               ": sudo adduser $USER rigcal, then sign in again; without the "
                               "package rigcal-agent install its udev rule first, and plug the "
                               "camera in again (docs/install.md)")};
}

}  // namespace

std::string_view NameOf(ReachableCamera::State state) {
  switch (state) {
    case ReachableCamera::State::kFree:
      return "free";
    case ReachableCamera::State::kInUse:
      return "in use";
    case ReachableCamera::State::kNoPermission:
      return "no permission";
    case ReachableCamera::State::kUnknown:
      return "unknown";
  }
  return "?";
}

std::string DeviceOf(const FoundCamera& found) {
  const bool by_id = found.serial.empty() || absl::StartsWith(found.id, "Fake_");
  return by_id ? found.id : found.serial;
}

absl::StatusOr<std::vector<ReachableCamera>> FindReachableCameras(
    const std::string& network_interface) {
  RIGCAL_ASSIGN_OR_RETURN(const std::vector<FoundCamera> found, FindCameras(network_interface));
  std::vector<ReachableCamera> cameras;
  for (const FoundCamera& camera : found) cameras.push_back(Examined(camera, network_interface));
  if (network_interface.empty()) {
    for (const UsbCamera& usb : FindUsbCameras()) {
      if (!usb.may_open) cameras.push_back(NotPermitted(usb));
    }
  }
  std::ranges::sort(cameras, {}, [](const auto& camera) { return camera.found.id; });
  return cameras;
}

}  // namespace rigcal::agent

// SPDX-License-Identifier: Apache-2.0
#include "agent/offer/camera_scan.h"

#include <spdlog/spdlog.h>

#include <algorithm>
#include <set>
#include <utility>

#include "absl/strings/match.h"
#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "agent/capture/genicam/reachable_cameras.h"
#include "agent/capture/metavision/metavision_device.h"
#include "agent/capture/registry/source_registry.h"
#include "common/status/status_macros.h"
#include "common/text/printable.h"

namespace rigcal::agent {
namespace {

constexpr int kMaxSimulated = 64;
constexpr size_t kMaxSeen = 256;
constexpr size_t kMaxWordBytes = 256;

// What a camera says of itself need not be text.
std::string Word(const std::string& text) {
  return std::string(Beginning(Printable(text), kMaxWordBytes));
}

OfferedCamera::Use UseOf(ReachableCamera::State state) {
  switch (state) {
    case ReachableCamera::State::kInUse:
      return OfferedCamera::Use::kBusy;
    case ReachableCamera::State::kNoPermission:
      return OfferedCamera::Use::kNoPermission;
    case ReachableCamera::State::kFree:
    case ReachableCamera::State::kUnknown:  // to open it will tell
      break;
  }
  return OfferedCamera::Use::kFree;
}

SeenCamera Seen(const ReachableCamera& camera) {
  const FoundCamera& found = camera.found;
  const std::string device = DeviceOf(found);
  return {.offer = {.device = Word(device),
                    .kind = "aravis",
                    .vendor = Word(found.vendor),
                    .model = Word(found.model),
                    // Aravis' fake camera has none.
                    .address = found.address == "0.0.0.0" ? "" : Word(found.address),
                    .use = UseOf(camera.state),
                    .note = camera.state == ReachableCamera::State::kInUse
                                ? absl::StrCat("in use ", camera.note, ": end that program")
                                : camera.note},
          .source = absl::StrCat("aravis:", device),
          .names = {found.id, found.serial, found.address}};
}

// `opened_as` is "integrator:plugin:serial".
SeenCamera SeenEventCamera(const std::string& opened_as) {
  const std::string serial = opened_as.substr(opened_as.rfind(':') + 1);  // npos + 1 is 0
  const std::string integrator = opened_as.substr(0, std::min(opened_as.find(':'), size_t{64}));
  return {.offer = {.device = Word(serial),
                    .kind = "metavision",
                    .vendor = serial == opened_as ? "" : Word(integrator)},
          .source = absl::StrCat("metavision:serial=", opened_as),
          .names = {opened_as, serial}};
}

SeenCamera SeenSimulated(int index, const ScanOptions& options) {
  const std::string& more = options.simulated_options;
  return {.offer = {.device = absl::StrCat("sim-", index),
                    .kind = "sim",
                    .vendor = "rigcal",
                    .model = "simulated camera"},
          .source = absl::StrCat("sim:camera=", index, ";cameras=", options.simulated_count,
                                 more.empty() ? "" : ";", more),
          .names = {}};
}

}  // namespace

absl::Status ReadSimulatedOffer(const std::string& text, ScanOptions* options) {
  const size_t end = std::min(text.find(';'), text.size());
  if (!absl::SimpleAtoi(text.substr(0, end), &options->simulated_count) ||
      options->simulated_count < 1 || options->simulated_count > kMaxSimulated) {
    return absl::InvalidArgumentError(absl::StrCat("--offer-simulated ", Printable(text),
                                                   ": the number of cameras must be 1 to ",
                                                   kMaxSimulated, ", such as 3 or '3;speed=max'"));
  }
  options->simulated_options = end == text.size() ? "" : text.substr(end + 1);
  const auto spec = ParseSourceSpec(SeenSimulated(0, *options).source);
  if (spec.ok()) return absl::OkStatus();
  return absl::InvalidArgumentError(
      absl::StrCat("--offer-simulated: ", std::string(spec.status().message())));
}

bool SeenCamera::IsSource(std::string_view running) const {
  // "aravis:NAME", "metavision:serial=NAME"
  const size_t at = running.find(':');
  if (at == running.npos || running.substr(0, at) != offer.kind) return false;
  const std::string_view rest = running.substr(at + 1);
  return std::ranges::any_of(names, [&](const std::string& name) {
    return !name.empty() && (rest == name || rest == "serial=" + name);
  });
}

absl::StatusOr<std::vector<SeenCamera>> ScanCameras(const ScanOptions& options) {
  std::vector<SeenCamera> cameras;
  if (options.devices || options.fake) {
    if (options.fake) FindFakeCameraToo();
    RIGCAL_ASSIGN_OR_RETURN(const std::vector<ReachableCamera> reachable, FindReachableCameras(""));
    for (const ReachableCamera& camera : reachable) cameras.push_back(Seen(camera));
  }
  if (options.devices) {
    const absl::StatusOr<std::vector<std::string>> found = FindMetavisionDevices();
    // The others can be offered all the same.
    if (!found.ok()) spdlog::debug("event cameras: {}", std::string(found.status().message()));
    for (const std::string& camera : found.value_or(std::vector<std::string>())) {
      cameras.push_back(SeenEventCamera(camera));
    }
  }
  for (int i = 0; i < options.simulated_count; ++i) cameras.push_back(SeenSimulated(i, options));
  std::set<std::string> devices;
  std::erase_if(cameras, [&](const SeenCamera& camera) {
    return camera.offer.device.empty() || !devices.insert(camera.offer.device).second;
  });
  if (cameras.size() > kMaxSeen) cameras.resize(kMaxSeen);
  return cameras;
}

}  // namespace rigcal::agent

// SPDX-License-Identifier: Apache-2.0
#include "agent/capture/genicam/aravis_ptp.h"

#include <chrono>
#include <thread>

#include "absl/strings/str_cat.h"
#include "agent/capture/genicam/aravis_features.h"
#include "common/status/status_macros.h"

namespace rigcal::agent {
namespace {

constexpr std::chrono::seconds kLimit(20);
constexpr std::chrono::milliseconds kInterval(200);

std::string PtpStatus(ArvCamera* camera) {
  if (FeatureIsAvailable(camera, "PtpDataSetLatch")) {
    GErrorSlot error;
    arv_camera_execute_command(camera, "PtpDataSetLatch", error.out());
  }
  const char* feature = FirstAvailableFeature(camera, {"PtpStatus", "GevIEEE1588Status"});
  return feature == nullptr ? "" : ReadStringFeature(camera, feature);
}

bool IsLocked(const std::string& status) { return status == "Slave" || status == "Master"; }

}  // namespace

absl::Status SwitchPtpOn(ArvCamera* camera, const std::string& prefix) {
  const char* feature = FirstAvailableFeature(camera, {"PtpEnable", "GevIEEE1588"});
  if (feature == nullptr) {
    return absl::InvalidArgumentError(absl::StrCat(
        prefix, "the camera has no PTP (neither PtpEnable nor GevIEEE1588); leave ptp out"));
  }
  GErrorSlot error;
  arv_camera_set_boolean(camera, feature, TRUE, error.out());
  RIGCAL_RETURN_IF_ERROR(error.ToStatus(absl::StrCat(prefix, "cannot switch PTP on")));
  const auto deadline = std::chrono::steady_clock::now() + kLimit;
  std::string status = PtpStatus(camera);
  while (!IsLocked(status) && std::chrono::steady_clock::now() < deadline) {
    std::this_thread::sleep_for(kInterval);
    status = PtpStatus(camera);
  }
  if (IsLocked(status)) return absl::OkStatus();
  return absl::UnavailableError(
      absl::StrCat(prefix, "PTP did not lock within ", kLimit.count(), " s (status ",
                   status.empty() ? "unknown" : status,
                   "); is there a PTP clock on this network? Or leave ptp out"));
}

std::string PtpClockId(ArvCamera* camera) {
  const char* enabled = FirstAvailableFeature(camera, {"PtpEnable", "GevIEEE1588"});
  GErrorSlot error;
  if (enabled == nullptr || !arv_camera_get_boolean(camera, enabled, error.out()) || !error.ok() ||
      !IsLocked(PtpStatus(camera))) {
    return "";
  }
  // What keeps the time tells two PTP domains apart.
  constexpr const char* kMaster = "PtpGrandmasterClockID";
  if (!FeatureIsAvailable(camera, kMaster)) return "ptp";
  const int64_t id = arv_camera_get_integer(camera, kMaster, error.out());
  return error.ok() ? absl::StrCat("ptp-", absl::Hex(static_cast<uint64_t>(id))) : "ptp";
}

}  // namespace rigcal::agent

// SPDX-License-Identifier: Apache-2.0
#include "agent/capture/genicam/aravis_settings.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <initializer_list>
#include <thread>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "agent/capture/genicam/aravis_pixel_formats.h"
#include "common/status/status_macros.h"

namespace rigcal::agent {
namespace {

constexpr double kMicro = 1e-6;

constexpr std::chrono::seconds kPtpLimit(20);
constexpr std::chrono::milliseconds kPtpInterval(200);

// The first of several names (they changed between versions of the convention) that the camera has.
// None: it has none of them.
const char* FirstAvailableFeature(ArvCamera* camera, std::initializer_list<const char*> names) {
  for (const char* name : names) {
    if (FeatureIsAvailable(camera, name)) return name;
  }
  return nullptr;
}

// Empty: the camera does not say.
std::string ReadStringFeature(ArvCamera* camera, const char* feature) {
  if (!FeatureIsAvailable(camera, feature)) return "";
  GErrorSlot error;
  const char* const text = arv_camera_get_string(camera, feature, error.out());
  return text == nullptr || !error.ok() ? "" : text;
}

std::string PtpStatus(ArvCamera* camera) {
  if (FeatureIsAvailable(camera, "PtpDataSetLatch")) {
    GErrorSlot error;
    arv_camera_execute_command(camera, "PtpDataSetLatch", error.out());
  }
  const char* feature = FirstAvailableFeature(camera, {"PtpStatus", "GevIEEE1588Status"});
  return feature == nullptr ? "" : ReadStringFeature(camera, feature);
}

bool PtpIsLocked(const std::string& status) { return status == "Slave" || status == "Master"; }

// What `list` of Aravis gives: pixel formats, or trigger sources.
std::vector<std::string> Offered(ArvCamera* camera,
                                 const char** (*list)(ArvCamera*, guint*, GError**)) {
  GErrorSlot error;
  guint count = 0;
  const GStringList names(list(camera, &count, error.out()));
  if (!names) return {};
  return std::vector<std::string>(names.get(), names.get() + count);
}

absl::Status SetPixelFormat(ArvCamera* camera, const AravisSourceOptions& options) {
  const std::vector<std::string> offered =
      Offered(camera, arv_camera_dup_available_pixel_formats_as_strings);
  const auto offers = [&](const std::string& name) {
    return std::ranges::find(offered, name) != offered.end();
  };
  std::string wanted = options.pixel_format;
  if (wanted.empty()) {
    GErrorSlot error;
    if (FindPixelFormat(arv_camera_get_pixel_format(camera, error.out()))) return absl::OkStatus();
    const auto best = std::ranges::find_if(SupportedPixelFormats(), offers);
    if (best != SupportedPixelFormats().end()) wanted = *best;
  }
  if (!FindPixelFormat(wanted) || (!offered.empty() && !offers(wanted))) {
    return absl::InvalidArgumentError(absl::StrCat(
        wanted.empty() ? "no pixel format of the camera is supported"
                       : absl::StrCat("pixel format ", wanted,
                                      FindPixelFormat(wanted) ? " is not offered by the camera"
                                                              : " is not supported"),
        "; the camera offers: ", absl::StrJoin(offered, ", "),
        "; supported are: ", absl::StrJoin(SupportedPixelFormats(), ", ")));
  }
  GErrorSlot error;
  arv_camera_set_pixel_format_from_string(camera, wanted.c_str(), error.out());
  return error.ToStatus("cannot set pixel format " + wanted);
}

absl::Status SetTrigger(ArvCamera* camera, const AravisSourceOptions& options) {
  GErrorSlot error;
  if (options.trigger == "free") {
    if (FeatureIsAvailable(camera, "TriggerMode")) arv_camera_clear_triggers(camera, error.out());
    return error.ToStatus("cannot switch the trigger off");
  }
  const std::string wanted = options.trigger == "software" ? "Software" : options.trigger;
  const std::vector<std::string> offered =
      Offered(camera, arv_camera_dup_available_trigger_sources);
  if (std::ranges::find(offered, wanted) == offered.end()) {
    return absl::InvalidArgumentError(
        absl::StrCat("the camera has no trigger ", wanted,
                     "; it offers: ", offered.empty() ? "none" : absl::StrJoin(offered, ", ")));
  }
  arv_camera_set_trigger(camera, wanted.c_str(), error.out());
  return error.ToStatus("cannot set trigger " + wanted);
}

struct Quantity {
  const char* what;
  const char* unit;
  double per_unit;  // the camera's unit in ours
  gboolean (*is_available)(ArvCamera*, GError**);
  void (*bounds)(ArvCamera*, double*, double*, GError**);
  void (*set)(ArvCamera*, double, GError**);
};

absl::Status SetQuantity(ArvCamera* camera, const Quantity& quantity, double value) {
  GErrorSlot error;
  if (!quantity.is_available(camera, error.out())) {
    return absl::InvalidArgumentError(
        absl::StrCat("the camera has no ", quantity.what, " to set; leave it out"));
  }
  double lowest = 0;
  double highest = 0;
  quantity.bounds(camera, &lowest, &highest, error.out());
  const double device_value = value / quantity.per_unit;
  const double slack = 1e-9 * std::abs(device_value);
  if (error.ok() && lowest < highest &&
      (device_value < lowest - slack || device_value > highest + slack)) {
    return absl::InvalidArgumentError(absl::StrCat(
        quantity.what, " is to be ", value, " ", quantity.unit, ", but the camera offers ",
        lowest * quantity.per_unit, " to ", highest * quantity.per_unit, " ", quantity.unit));
  }
  quantity.set(camera, device_value, error.out());
  return error.ToStatus(
      absl::StrCat("cannot set ", quantity.what, " to ", value, " ", quantity.unit));
}

absl::Status SetQuantities(ArvCamera* camera, const AravisSourceOptions& options) {
  constexpr Quantity kExposure{"exposure",
                               "s",
                               kMicro,
                               arv_camera_is_exposure_time_available,
                               arv_camera_get_exposure_time_bounds,
                               arv_camera_set_exposure_time};
  constexpr Quantity kGain{"gain",
                           "dB",
                           1,
                           arv_camera_is_gain_available,
                           arv_camera_get_gain_bounds,
                           arv_camera_set_gain};
  constexpr Quantity kRate{"frame rate",
                           "Hz",
                           1,
                           arv_camera_is_frame_rate_available,
                           arv_camera_get_frame_rate_bounds,
                           arv_camera_set_frame_rate};
  GErrorSlot error;
  if (options.exposure_s) {
    if (arv_camera_is_exposure_auto_available(camera, error.out())) {
      arv_camera_set_exposure_time_auto(camera, ARV_AUTO_OFF, error.out());
    }
    RIGCAL_RETURN_IF_ERROR(SetQuantity(camera, kExposure, *options.exposure_s));
  }
  if (options.gain_db) {
    if (arv_camera_is_gain_auto_available(camera, error.out())) {
      arv_camera_set_gain_auto(camera, ARV_AUTO_OFF, error.out());
    }
    RIGCAL_RETURN_IF_ERROR(SetQuantity(camera, kGain, *options.gain_db));
  }
  // With a trigger the frames come when they are asked for; Aravis would switch it off.
  if (options.frame_rate_hz && options.trigger == "free") {
    RIGCAL_RETURN_IF_ERROR(SetQuantity(camera, kRate, *options.frame_rate_hz));
  }
  return absl::OkStatus();
}

absl::Status SwitchPtpOn(ArvCamera* camera) {
  const char* feature = FirstAvailableFeature(camera, {"PtpEnable", "GevIEEE1588"});
  if (feature == nullptr) {
    return absl::InvalidArgumentError(
        "the camera has no PTP (neither PtpEnable nor GevIEEE1588); leave ptp out");
  }
  GErrorSlot error;
  arv_camera_set_boolean(camera, feature, TRUE, error.out());
  RIGCAL_RETURN_IF_ERROR(error.ToStatus("cannot switch PTP on"));
  const auto deadline = std::chrono::steady_clock::now() + kPtpLimit;
  std::string status = PtpStatus(camera);
  while (!PtpIsLocked(status) && std::chrono::steady_clock::now() < deadline) {
    std::this_thread::sleep_for(kPtpInterval);
    status = PtpStatus(camera);
  }
  if (PtpIsLocked(status)) return absl::OkStatus();
  return absl::UnavailableError(
      absl::StrCat("PTP did not lock within ", kPtpLimit.count(), " s (status ",
                   status.empty() ? "unknown" : status,
                   "); is there a PTP clock on this network? Or leave ptp out"));
}

}  // namespace

absl::Status ApplySettings(ArvCamera* camera, const AravisSourceOptions& options) {
  RIGCAL_RETURN_IF_ERROR(SetPixelFormat(camera, options));
  GErrorSlot error;  // cameras that know one mode only have no such feature
  arv_camera_set_acquisition_mode(camera, ARV_ACQUISITION_MODE_CONTINUOUS, error.out());
  RIGCAL_RETURN_IF_ERROR(SetTrigger(camera, options));
  RIGCAL_RETURN_IF_ERROR(SetQuantities(camera, options));
  return options.ptp ? SwitchPtpOn(camera) : absl::OkStatus();
}

absl::Status CheckPixelFormat(ArvCamera* camera) {
  GErrorSlot error;
  const uint32_t code = arv_camera_get_pixel_format(camera, error.out());
  RIGCAL_RETURN_IF_ERROR(error.ToStatus("cannot read its pixel format"));
  if (FindPixelFormat(code)) return absl::OkStatus();
  return absl::InvalidArgumentError(absl::StrCat(
      "its pixel format 0x", absl::Hex(code), " is not supported; it offers: ",
      absl::StrJoin(Offered(camera, arv_camera_dup_available_pixel_formats_as_strings), ", "),
      "; supported are: ", absl::StrJoin(SupportedPixelFormats(), ", ")));
}

std::string PtpClockId(ArvCamera* camera) {
  const char* enabled = FirstAvailableFeature(camera, {"PtpEnable", "GevIEEE1588"});
  GErrorSlot error;
  if (enabled == nullptr || !arv_camera_get_boolean(camera, enabled, error.out()) || !error.ok() ||
      !PtpIsLocked(PtpStatus(camera))) {
    return "";
  }
  // What keeps the time tells two PTP domains apart.
  constexpr const char* kMaster = "PtpGrandmasterClockID";
  if (!FeatureIsAvailable(camera, kMaster)) return "ptp";
  const int64_t id = arv_camera_get_integer(camera, kMaster, error.out());
  return error.ok() ? absl::StrCat("ptp-", absl::Hex(static_cast<uint64_t>(id))) : "ptp";
}

double ExposureSeconds(ArvCamera* camera) {
  GErrorSlot error;
  if (!arv_camera_is_exposure_time_available(camera, error.out())) return 0;
  const double exposure_us = arv_camera_get_exposure_time(camera, error.out());
  return error.ok() && std::isfinite(exposure_us) && exposure_us > 0 ? exposure_us * kMicro : 0;
}

bool ExposureIsAutomatic(ArvCamera* camera) {
  GErrorSlot error;
  if (!arv_camera_is_exposure_auto_available(camera, error.out())) return false;
  return arv_camera_get_exposure_time_auto(camera, error.out()) == ARV_AUTO_CONTINUOUS &&
         error.ok();
}

CameraSettings ReadSettings(ArvCamera* camera) {
  GErrorSlot error;
  const auto text = [](const char* value) { return std::string(value == nullptr ? "" : value); };
  CameraSettings settings;
  settings.model = absl::StrCat(text(arv_camera_get_vendor_name(camera, error.out())), " ",
                                text(arv_camera_get_model_name(camera, error.out())));
  const std::string serial = text(arv_camera_get_device_serial_number(camera, error.out()));
  if (error.ok() && !serial.empty()) absl::StrAppend(&settings.model, " ", serial);
  settings.pixel_format = text(arv_camera_get_pixel_format_as_string(camera, error.out()));
  settings.exposure_s = ExposureSeconds(camera);
  const auto read = [&](auto is_available, auto get, double* value) {
    if (!is_available(camera, error.out())) return;
    const double read_value = get(camera, error.out());
    if (error.ok() && std::isfinite(read_value)) *value = read_value;
  };
  read(arv_camera_is_gain_available, arv_camera_get_gain, &settings.gain_db);
  read(arv_camera_is_frame_rate_available, arv_camera_get_frame_rate, &settings.frame_rate_hz);
  const std::string mode = ReadStringFeature(camera, "TriggerMode");
  settings.trigger = "free";
  if (mode == "On") {
    const std::string source = ReadStringFeature(camera, "TriggerSource");
    settings.trigger = source == "Software" ? "software" : source;
  }
  settings.ptp = !PtpClockId(camera).empty();
  return settings;
}

std::vector<std::string> SettingWarnings(ArvCamera* camera, const AravisSourceOptions& options,
                                         const CameraSettings& settings) {
  constexpr double kBlinkS = 0.002;  // of the usual wand: 500 Hz
  std::vector<std::string> warnings;
  const double exposure_s = settings.exposure_s;
  if (exposure_s <= 0) {
    warnings.push_back(
        "the camera does not say its exposure: times are those of its stamps, not of the middle "
        "of the exposure");
  } else if (exposure_s < kBlinkS) {
    warnings.push_back(absl::StrCat(
        "an exposure of ", exposure_s * 1e3, " ms is shorter than one blink of the wand (",
        kBlinkS * 1e3, " ms at ", 1 / kBlinkS,
        " Hz): markers will be missing or dark in some frames; set exposure to at least ",
        kBlinkS * 1e3, " ms"));
  }
  if (ExposureIsAutomatic(camera)) {
    warnings.push_back(
        "automatic exposure is on: the middle of an exposure is known only roughly; set exposure");
  }
  const auto changed = [&](const char* what, const std::optional<double>& asked, double got) {
    if (asked && std::abs(got - *asked) > 0.01 * std::abs(*asked)) {
      warnings.push_back(absl::StrCat(what, " was to be ", *asked, ", the camera made it ", got));
    }
  };
  changed("exposure in s", options.exposure_s, exposure_s);
  changed("gain in dB", options.gain_db, settings.gain_db);
  if (options.trigger == "free") {
    changed("frame rate in Hz", options.frame_rate_hz, settings.frame_rate_hz);
  }
  return warnings;
}

}  // namespace rigcal::agent

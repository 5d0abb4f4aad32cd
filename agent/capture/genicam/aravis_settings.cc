// SPDX-License-Identifier: Apache-2.0
#include "agent/capture/genicam/aravis_settings.h"

#include <algorithm>
#include <cmath>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "agent/capture/genicam/aravis_features.h"
#include "agent/capture/genicam/aravis_ptp.h"
#include "common/status/status_macros.h"

namespace rigcal::agent {
namespace {

constexpr double kMicro = 1e-6;

std::string Prefix(const AravisSourceOptions& options) {
  return absl::StrCat("camera ", options.camera, ": ");
}

std::vector<std::string> ToVector(const char** list, unsigned int count) {
  const GStringList owner(list);
  std::vector<std::string> names;
  if (list == nullptr) return names;
  for (unsigned int i = 0; i < count; ++i) names.emplace_back(list[i]);
  return names;
}

std::vector<std::string> OfferedPixelFormats(ArvCamera* camera) {
  GErrorSlot error;
  unsigned int count = 0;
  const char** list =
      arv_camera_dup_available_pixel_formats_as_strings(camera, &count, error.out());
  return ToVector(list, count);
}

std::vector<std::string> TriggerSources(ArvCamera* camera) {
  GErrorSlot error;
  unsigned int count = 0;
  const char** list = arv_camera_dup_available_trigger_sources(camera, &count, error.out());
  return ToVector(list, count);
}

absl::Status SetPixelFormat(ArvCamera* camera, const AravisSourceOptions& options) {
  const std::vector<std::string> offered = OfferedPixelFormats(camera);
  const auto offers = [&](const std::string& name) {
    return std::find(offered.begin(), offered.end(), name) != offered.end();
  };
  std::string wanted = options.pixel_format;
  if (wanted.empty()) {
    GErrorSlot error;
    if (FindPixelFormat(arv_camera_get_pixel_format(camera, error.out()))) return absl::OkStatus();
    const auto best =
        std::find_if(SupportedPixelFormats().begin(), SupportedPixelFormats().end(), offers);
    if (best != SupportedPixelFormats().end()) wanted = *best;
  }
  if (!FindPixelFormat(wanted) || (!offered.empty() && !offers(wanted))) {
    return absl::InvalidArgumentError(absl::StrCat(
        Prefix(options),
        wanted.empty() ? "no pixel format of the camera is supported"
                       : absl::StrCat("pixel format ", wanted,
                                      FindPixelFormat(wanted) ? " is not offered by the camera"
                                                              : " is not supported"),
        "; the camera offers: ", absl::StrJoin(offered, ", "),
        "; supported are: ", absl::StrJoin(SupportedPixelFormats(), ", ")));
  }
  GErrorSlot error;
  arv_camera_set_pixel_format_from_string(camera, wanted.c_str(), error.out());
  return error.ToStatus(absl::StrCat(Prefix(options), "cannot set pixel format ", wanted));
}

absl::Status SetTrigger(ArvCamera* camera, const AravisSourceOptions& options) {
  GErrorSlot error;
  if (options.trigger == "free") {
    if (FeatureIsAvailable(camera, "TriggerMode")) arv_camera_clear_triggers(camera, error.out());
    return error.ToStatus(absl::StrCat(Prefix(options), "cannot switch the trigger off"));
  }
  const std::string wanted = options.trigger == "software" ? "Software" : options.trigger;
  const std::vector<std::string> offered = TriggerSources(camera);
  if (std::find(offered.begin(), offered.end(), wanted) == offered.end()) {
    return absl::InvalidArgumentError(
        absl::StrCat(Prefix(options), "the camera has no trigger ", wanted,
                     "; it offers: ", offered.empty() ? "none" : absl::StrJoin(offered, ", ")));
  }
  arv_camera_set_trigger(camera, wanted.c_str(), error.out());
  return error.ToStatus(absl::StrCat(Prefix(options), "cannot set trigger ", wanted));
}

using BoundsGetter = void (*)(ArvCamera*, double*, double*, GError**);
using Setter = void (*)(ArvCamera*, double, GError**);

struct Quantity {
  const char* what;
  const char* unit;
  double per_unit;  // the camera's unit in ours
  gboolean (*is_available)(ArvCamera*, GError**);
  BoundsGetter bounds;
  Setter set;
};

absl::Status SetQuantity(ArvCamera* camera, const AravisSourceOptions& options,
                         const Quantity& quantity, double value) {
  GErrorSlot error;
  if (!quantity.is_available(camera, error.out())) {
    return absl::InvalidArgumentError(absl::StrCat(Prefix(options), "the camera has no ",
                                                   quantity.what, " to set; leave it out"));
  }
  double lowest = 0;
  double highest = 0;
  quantity.bounds(camera, &lowest, &highest, error.out());
  const double device_value = value / quantity.per_unit;
  const double slack = 1e-9 * std::abs(device_value);
  if (error.ok() && lowest < highest &&
      (device_value < lowest - slack || device_value > highest + slack)) {
    return absl::InvalidArgumentError(
        absl::StrCat(Prefix(options), quantity.what, " is to be ", value, " ", quantity.unit,
                     ", but the camera offers ", lowest * quantity.per_unit, " to ",
                     highest * quantity.per_unit, " ", quantity.unit));
  }
  quantity.set(camera, device_value, error.out());
  return error.ToStatus(absl::StrCat(Prefix(options), "cannot set ", quantity.what, " to ", value,
                                     " ", quantity.unit));
}

absl::Status SetQuantities(ArvCamera* camera, const AravisSourceOptions& options) {
  constexpr Quantity kExposure{"exposure",
                               "s",
                               kMicro,
                               &arv_camera_is_exposure_time_available,
                               &arv_camera_get_exposure_time_bounds,
                               &arv_camera_set_exposure_time};
  constexpr Quantity kGain{"gain",
                           "dB",
                           1,
                           &arv_camera_is_gain_available,
                           &arv_camera_get_gain_bounds,
                           &arv_camera_set_gain};
  constexpr Quantity kRate{"frame rate",
                           "Hz",
                           1,
                           &arv_camera_is_frame_rate_available,
                           &arv_camera_get_frame_rate_bounds,
                           &arv_camera_set_frame_rate};
  GErrorSlot error;
  if (options.exposure_s) {
    if (arv_camera_is_exposure_auto_available(camera, error.out())) {
      arv_camera_set_exposure_time_auto(camera, ARV_AUTO_OFF, error.out());
    }
    RIGCAL_RETURN_IF_ERROR(SetQuantity(camera, options, kExposure, *options.exposure_s));
  }
  if (options.gain_db) {
    if (arv_camera_is_gain_auto_available(camera, error.out())) {
      arv_camera_set_gain_auto(camera, ARV_AUTO_OFF, error.out());
    }
    RIGCAL_RETURN_IF_ERROR(SetQuantity(camera, options, kGain, *options.gain_db));
  }
  // With a trigger the frames come when they are asked for; Aravis would switch it off.
  if (options.frame_rate_hz && options.trigger == "free") {
    RIGCAL_RETURN_IF_ERROR(SetQuantity(camera, options, kRate, *options.frame_rate_hz));
  }
  return absl::OkStatus();
}

}  // namespace

absl::Status ApplySettings(ArvCamera* camera, const AravisSourceOptions& options) {
  RIGCAL_RETURN_IF_ERROR(SetPixelFormat(camera, options));
  GErrorSlot error;  // cameras that know one mode only have no such feature
  arv_camera_set_acquisition_mode(camera, ARV_ACQUISITION_MODE_CONTINUOUS, error.out());
  RIGCAL_RETURN_IF_ERROR(SetTrigger(camera, options));
  RIGCAL_RETURN_IF_ERROR(SetQuantities(camera, options));
  return options.ptp ? SwitchPtpOn(camera, Prefix(options)) : absl::OkStatus();
}

absl::StatusOr<GenicamPixelFormat> CurrentPixelFormat(ArvCamera* camera, const std::string& name) {
  GErrorSlot error;
  const uint32_t code = arv_camera_get_pixel_format(camera, error.out());
  RIGCAL_RETURN_IF_ERROR(
      error.ToStatus(absl::StrCat("camera ", name, ": cannot read its pixel format")));
  if (const auto format = FindPixelFormat(code)) return *format;
  return absl::InvalidArgumentError(absl::StrCat(
      "camera ", name, ": its pixel format 0x", absl::Hex(code),
      " is not supported; it offers: ", absl::StrJoin(OfferedPixelFormats(camera), ", "),
      "; supported are: ", absl::StrJoin(SupportedPixelFormats(), ", ")));
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
  if (arv_camera_is_gain_available(camera, error.out())) {
    const double gain_db = arv_camera_get_gain(camera, error.out());
    if (error.ok() && std::isfinite(gain_db)) settings.gain_db = gain_db;
  }
  if (arv_camera_is_frame_rate_available(camera, error.out())) {
    const double rate_hz = arv_camera_get_frame_rate(camera, error.out());
    if (error.ok() && std::isfinite(rate_hz)) settings.frame_rate_hz = rate_hz;
  }
  const std::string mode = ReadStringFeature(camera, "TriggerMode");
  settings.trigger = "free";
  if (mode == "On") {
    const std::string source = ReadStringFeature(camera, "TriggerSource");
    settings.trigger = source == "Software" ? "software" : source;
  }
  settings.ptp = !PtpClockId(camera).empty();
  return settings;
}

std::optional<std::string> ShortExposureWarning(const std::string& camera, double exposure_s,
                                                double blink_hz) {
  if (exposure_s <= 0 || blink_hz <= 0 || exposure_s * blink_hz >= 1) return std::nullopt;
  return absl::StrCat("camera ", camera, ": an exposure of ", exposure_s * 1e3,
                      " ms is shorter than one blink of the wand (", 1e3 / blink_hz, " ms at ",
                      blink_hz,
                      " Hz): markers will be missing or dark in some frames; set "
                      "exposure to at least ",
                      1e3 / blink_hz, " ms");
}

std::vector<std::string> SettingWarnings(ArvCamera* camera, const AravisSourceOptions& options,
                                         const CameraSettings& settings) {
  std::vector<std::string> warnings;
  const double exposure_s = settings.exposure_s;
  if (auto warning = ShortExposureWarning(options.camera, exposure_s, options.blink_hz)) {
    warnings.push_back(*std::move(warning));
  }
  if (exposure_s <= 0) {
    warnings.push_back(
        absl::StrCat(Prefix(options),
                     "the camera does not say its exposure: times are those of its stamps, "
                     "not of the middle of the exposure"));
  }
  if (ExposureIsAutomatic(camera)) {
    warnings.push_back(
        absl::StrCat(Prefix(options),
                     "automatic exposure is on: the middle of an exposure is known only "
                     "roughly; set exposure"));
  }
  const auto changed = [&](const char* what, const std::optional<double>& asked, double got) {
    if (asked && std::abs(got - *asked) > 0.01 * std::abs(*asked)) {
      warnings.push_back(
          absl::StrCat(Prefix(options), what, " was to be ", *asked, ", the camera made it ", got));
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

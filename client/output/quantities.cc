// SPDX-License-Identifier: Apache-2.0
#include "client/output/quantities.h"

#include <google/protobuf/descriptor.h>

#include <cmath>
#include <numbers>

#include "absl/strings/ascii.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/time/time.h"

namespace rigcal::client {
namespace {

// Of the wand's length: 0.2 mm of 0.39 m. A tape measure is good to a millimetre.
constexpr double kScaleWorthMeasuring = 5e-4;

}  // namespace

std::string FormatFixed(double value, int digits) {
  std::string text = absl::StrFormat("%.*f", digits, value);
  if (text.starts_with('-') && text.find_first_of("123456789nf") == std::string::npos) {
    text.erase(0, 1);
  }
  return text;
}

std::string FormatTime(bool is_set, const google::protobuf::Timestamp& time) {
  if (!is_set) return "-";
  return absl::FormatTime("%Y-%m-%d %H:%M:%S %Z", absl::FromUnixSeconds(time.seconds()),
                          absl::LocalTimeZone());
}

std::string FormatDuration(double seconds) {
  if (!(seconds >= 60)) return absl::StrCat(FormatFixed(seconds, 2), " s");
  if (seconds >= 1e9) return absl::StrFormat("%.3g s", seconds);
  const auto whole = static_cast<int64_t>(std::lround(seconds));
  return absl::StrFormat("%d min %d s", whole / 60, whole % 60);
}

std::string FormatCount(uint64_t count, const char* singular) {
  return absl::StrCat(count, " ", singular, count == 1 ? "" : "s");
}

std::string FormatBytes(uint64_t bytes) {
  const double kib = static_cast<double>(bytes) / 1024;
  if (kib < 1024) return absl::StrFormat("%.0f KiB", kib);
  if (kib < 1024 * 1024) return absl::StrFormat("%.1f MiB", kib / 1024);
  return absl::StrFormat("%.1f GiB", kib / 1024 / 1024);
}

std::string EnumWord(const google::protobuf::EnumDescriptor& type, int value) {
  const std::string none = type.FindValueByNumber(0)->name();  // "FINDING_KIND_UNSPECIFIED"
  const size_t prefix = none.rfind('_');
  const auto* known = value == 0 ? nullptr : type.FindValueByNumber(value);
  return absl::AsciiStrToLower(known == nullptr ? absl::StrCat(none.substr(0, prefix), " ", value)
                                                : known->name().substr(prefix + 1));
}

double DegreesFromRadians(double radians) { return radians * 180 / std::numbers::pi; }

std::string FormatMagnitude(double value) {
  // From 9999.5 on "%.4g" would write a power of ten.
  return std::abs(value) < 9999.5 ? absl::StrFormat("%.4g", value)
                                  : absl::StrFormat("%.0f", value);
}

std::string FormatPointError(double point_error_m, double scale_sigma_rel) {
  const double mm = 1000 * point_error_m;
  // Three digits that say something, as on the page.
  const int digits = mm < 0.0995 ? 3 : mm < 9.95 ? 2 : mm < 99.5 ? 1 : 0;
  return absl::StrCat(
      FormatFixed(mm, digits), " mm",
      scale_sigma_rel > 0
          ? absl::StrCat(" + ", FormatFixed(100 * scale_sigma_rel, 2), " % of every length")
          : "");
}

std::string FormatScaleAdvice(double scale_sigma_rel, double wand_length_m) {
  if (!(scale_sigma_rel > kScaleWorthMeasuring) || !(wand_length_m > 0)) return "";
  const double mm = 1000 * kScaleWorthMeasuring * wand_length_m;
  return absl::StrCat("measure the wand to ", FormatFixed(mm, mm < 0.1 ? 2 : 1),
                      " mm for a better scale");
}

}  // namespace rigcal::client

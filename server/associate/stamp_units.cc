// SPDX-License-Identifier: Apache-2.0
#include "server/associate/stamp_units.h"

#include <algorithm>
#include <cstdint>
#include <optional>
#include <string>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/strings/str_join.h"
#include "common/statistics/robust_statistics.h"

namespace rigcal::server {
namespace {

constexpr size_t kMinRows = 20;
constexpr double kMinPeriodNs = 1e9 / 20'000;
constexpr double kMaxPeriodNs = 1e9 / 0.1;
// What a unit would make of the rows is likely where it is a usual frame rate.
constexpr double kUsualMinHz = 1, kUsualMaxHz = 2'000;
// A wand at 5 m/s one metre before a lens of 2 000 px moves by 10 000 px/s.
constexpr double kMaxSpeedPxS = 30'000;
// Steps below this may be noise.
constexpr double kMinStepPx = 2;

struct Unit {
  const char* name;
  int64_t factor;  // to nanoseconds
};
constexpr Unit kUnits[] = {
    {"microseconds", 1'000}, {"milliseconds", 1'000'000}, {"seconds", 1'000'000'000}};

struct Steps {
  double median_ns = 0;
  // Of a marker from one row to the next, medians; 0 where it was hardly seen.
  double image_px = 0;
};

// Delivered twice.
bool IsSameRow(const Observation& a, const Observation& b) {
  return a.time_ns == b.time_ns &&
         std::ranges::equal(a.markers, b.markers,
                            [](const MarkerObservation& left, const MarkerObservation& right) {
                              return left.visible == right.visible &&
                                     left.centre_px == right.centre_px;
                            });
}

Steps MeasureSteps(const CameraTrack& track) {
  std::vector<const Observation*> rows;
  for (const Observation& row : track.observations) rows.push_back(&row);
  std::ranges::stable_sort(rows, [](const Observation* a, const Observation* b) {
    return std::pair(a->clock_epoch, a->time_ns) < std::pair(b->clock_epoch, b->time_ns);
  });
  std::vector<double> steps_ns, steps_px;
  for (size_t i = 1; i < rows.size(); ++i) {
    const Observation& before = *rows[i - 1];
    const Observation& row = *rows[i];
    if (row.clock_epoch != before.clock_epoch || IsSameRow(row, before)) continue;
    steps_ns.push_back(static_cast<double>(row.time_ns) - static_cast<double>(before.time_ns));
    for (size_t m = 0; m < std::min(row.markers.size(), before.markers.size()); ++m) {
      if (!row.markers[m].visible || !before.markers[m].visible) continue;
      steps_px.push_back((row.markers[m].centre_px - before.markers[m].centre_px).norm());
    }
  }
  Steps steps;
  if (!steps_ns.empty()) steps.median_ns = UpperMedian(&steps_ns);
  if (steps_px.size() >= kMinRows) steps.image_px = UpperMedian(&steps_px);
  return steps;
}

bool IsPlausible(const Steps& steps) {
  if (!(steps.median_ns >= kMinPeriodNs) || steps.median_ns > kMaxPeriodNs) return false;
  return steps.image_px < kMinStepPx || steps.image_px / (1e-9 * steps.median_ns) < kMaxSpeedPxS;
}

// The only unit that makes a usual camera of these steps; none where several do, or none.
std::optional<Unit> LikelyUnit(const Steps& steps) {
  for (const Unit& unit : kUnits) {
    Steps meant = steps;
    meant.median_ns *= static_cast<double>(unit.factor);
    const double rate_hz = 1e9 / meant.median_ns;
    if (rate_hz >= kUsualMinHz && rate_hz <= kUsualMaxHz && IsPlausible(meant)) return unit;
  }
  return std::nullopt;
}

// A header that names a larger unit than the stamps have makes them too large.
std::string TooLarge(const Steps& steps) {
  const char* const units[][2] = {
      {"seconds", "milliseconds"}, {"seconds", "microseconds"}, {"seconds", "nanoseconds"}};
  double factor = 1;
  for (const auto& [named, meant] : units) {
    factor *= 1000;
    Steps divided = steps;
    divided.median_ns /= factor;
    const double rate_hz = 1e9 / divided.median_ns;
    if (rate_hz < kUsualMinHz || rate_hz > kUsualMaxHz || !IsPlausible(divided)) continue;
    return absl::StrFormat(
        "they are %.0f times too large (%.4g frames a second otherwise): if a header or a program "
        "gave them as %s, they are %s",
        factor, rate_hz, named, meant);
  }
  return "give them in nanoseconds";
}

std::string Describe(const CameraTrack& track, const Steps& steps) {
  const std::string name = absl::StrCat("camera ", track.camera.camera, ": ");
  if (steps.median_ns < 0.5) {
    return absl::StrCat(name,
                        "most of its rows have the stamp of the row before, as stamps in whole "
                        "seconds have: give them in nanoseconds (likely factor 1000000000)");
  }
  if (steps.median_ns < 1.5) {
    return absl::StrCat(name,
                        "its stamps count 1, 2, 3: they are row numbers, not times. Multiply them "
                        "by the period of its frames in nanoseconds (10 frames per second: "
                        "100000000)");
  }
  const double rate_hz = 1e9 / steps.median_ns;
  std::string text = absl::StrFormat("%sits rows are %.4g ns apart (median), %.4g frames a second",
                                     name, steps.median_ns, rate_hz);
  if (rate_hz <= 20'000 && steps.median_ns <= kMaxPeriodNs) {
    absl::StrAppendFormat(&text, ", and its wand moves at %.3g px/s",
                          steps.image_px / (1e-9 * steps.median_ns));
  }
  const std::optional<Unit> unit = LikelyUnit(steps);
  if (unit) {
    absl::StrAppendFormat(&text,
                          ": its stamps are likely in %s (%.4g frames a second), not in "
                          "nanoseconds: multiply them by %d",
                          unit->name, rate_hz / static_cast<double>(unit->factor), unit->factor);
  } else {
    absl::StrAppend(&text, ": its stamps cannot be nanoseconds; ", TooLarge(steps));
  }
  return text;
}

}  // namespace

absl::Status CheckStampUnits(const std::vector<CameraTrack>& tracks) {
  std::vector<std::string> faults;
  for (const CameraTrack& track : tracks) {
    if (track.observations.size() < kMinRows) continue;
    const Steps steps = MeasureSteps(track);
    if (!IsPlausible(steps)) faults.push_back(Describe(track, steps));
  }
  if (faults.empty()) return absl::OkStatus();
  std::ranges::sort(faults);
  return absl::InvalidArgumentError(
      absl::StrCat("units of time stamps: ", absl::StrJoin(faults, "; ")));
}

}  // namespace rigcal::server

// SPDX-License-Identifier: Apache-2.0
#include "server/solve/diagnose/lamp_phases.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <optional>
#include <tuple>
#include <utility>

#include "absl/numeric/int128.h"
#include "absl/strings/str_format.h"
#include "common/statistics/robust_statistics.h"

namespace rigcal::server {
namespace {

constexpr double kTogetherS = 0.75;  // readings of two cameras; each has one a second
constexpr double kSameFrequency = 0.02;
constexpr double kLeastS = 5e-4, kSigmas = 5;
constexpr size_t kFewest = 5, kFewestToDrift = 9;
constexpr double kMedianVariance = 1.57;  // of a median, in terms of a mean's (pi / 2)

struct Contradiction {
  size_t a = 0, b = 0;  // cameras; a's name is the lesser one
  bool drifts = false;
  double value_s = 0;  // the lamps are later by the clock of b, or get later
  double sigma_s = 0;
  double period_s = 0;
};

double MedianOf(const std::vector<double>& values, size_t begin, size_t end) {
  return Median({values.begin() + static_cast<std::ptrdiff_t>(begin),
                 values.begin() + static_cast<std::ptrdiff_t>(end)});
}

// By how much one camera's readings are later than another's.
struct Comparison {
  std::vector<double> later_s;  // in the order of time; without jumps of thirds of a period
  std::vector<double> sigma_s;  // of both readings
  double period_s = 0;
};

Comparison Compare(const LampPhases& a, const LampPhases& b, double hz) {
  const auto is_of = [hz](const LampMoment& moment) {
    return std::abs(moment.period_s * hz - 1) < kSameFrequency;
  };
  Comparison comparison;
  size_t next = 0;
  for (const LampMoment& at : a.moments) {
    if (!is_of(at)) continue;
    const auto away_s = [&at](const LampMoment& moment) {
      return 1e-9 * static_cast<double>(absl::int128(moment.rig_time_ns) - at.rig_time_ns);
    };
    while (next < b.moments.size() &&
           (!is_of(b.moments[next]) || away_s(b.moments[next]) < -kTogetherS)) {
      ++next;
    }
    if (next == b.moments.size() || away_s(b.moments[next]) > kTogetherS) continue;
    const LampMoment& other = b.moments[next++];
    const double third_s = (at.period_s + other.period_s) / 6;
    const double before_s = comparison.later_s.empty() ? 0 : comparison.later_s.back();
    comparison.later_s.push_back(before_s + std::remainder(away_s(other) - before_s, third_s));
    comparison.sigma_s.push_back(std::hypot(at.sigma_s, other.sigma_s));
    comparison.period_s = 3 * third_s;
  }
  return comparison;
}

bool IsMuch(double value_s, double sigma_s) {
  return std::abs(value_s) > std::max(kLeastS, kSigmas * sigma_s);
}

std::optional<Contradiction> Contradict(const LampPhases& a, const LampPhases& b, double hz) {
  const Comparison comparison = Compare(a, b, hz);
  const size_t count = comparison.later_s.size();
  if (count < kFewest) return std::nullopt;
  const double sigma_s = Median(comparison.sigma_s);
  Contradiction found{.period_s = comparison.period_s};
  if (count >= kFewestToDrift) {
    const size_t third = count / 3;
    found.drifts = true;
    found.value_s =
        MedianOf(comparison.later_s, count - third, count) - MedianOf(comparison.later_s, 0, third);
    found.sigma_s = sigma_s * std::sqrt(2 * kMedianVariance / static_cast<double>(third));
    if (IsMuch(found.value_s, found.sigma_s)) return found;
  }
  found.drifts = false;
  found.value_s = std::remainder(Median(comparison.later_s), comparison.period_s / 3);
  // What differs between the parts of two images stays however many readings there are.
  found.sigma_s = std::hypot(sigma_s, a.offset_sigma_s, b.offset_sigma_s);
  if (!IsMuch(found.value_s, found.sigma_s)) return std::nullopt;
  return found;
}

std::string Advice(const Contradiction& found, const std::string& other, bool is_one_of_two) {
  const double hz = 1 / found.period_s;
  const char* const later = found.value_s > 0 ? "later" : "earlier";
  std::string advice =
      found.drifts
          ? absl::StrFormat(
                "lamps of %.0f Hz get %.2f ms %s (+-%.2f ms) by its clock during the recording, "
                "against camera %s: one of both clocks runs at another rate than was estimated",
                hz, 1e3 * std::abs(found.value_s), later, 1e3 * found.sigma_s, other)
          : absl::StrFormat(
                "lamps of %.0f Hz flicker %.2f ms %s (+-%.2f ms) by its clock than by that of "
                "camera %s, or as much beside a multiple of %.2f ms: the offset of one of both "
                "clocks is wrong",
                hz, 1e3 * std::abs(found.value_s), later, 1e3 * found.sigma_s, other,
                1e3 * found.period_s / 3);
  if (is_one_of_two) advice += " (either may be the one)";
  advice +=
      ". Look at their stamps and triggers, and wave longer where both see the wand. Unless they "
      "see lamps that do not hang on one mains (a screen, an inverter, another room)";
  return advice;
}

// The camera that most contradict.
size_t MostContradicted(const std::vector<Contradiction>& all,
                        const std::vector<LampPhases>& cameras) {
  std::map<std::string, std::pair<size_t, double>> by_name;
  for (const Contradiction& found : all) {
    for (const size_t camera : {found.a, found.b}) {
      auto& [count, size_s] = by_name[cameras[camera].camera];
      ++count;
      size_s += std::abs(found.value_s);
    }
  }
  size_t most = all.front().b;
  for (const Contradiction& found : all) {
    for (const size_t camera : {found.a, found.b}) {
      if (by_name[cameras[camera].camera] > by_name[cameras[most].camera]) most = camera;
    }
  }
  return most;
}

}  // namespace

std::vector<Finding> FindLampContradictions(std::vector<LampPhases> cameras) {
  std::ranges::sort(cameras, {}, [](const LampPhases& camera) {
    return std::tie(camera.session_id, camera.camera, camera.clock);
  });
  for (LampPhases& camera : cameras) {
    std::ranges::sort(camera.moments, {}, &LampMoment::rig_time_ns);
  }
  std::vector<Contradiction> all;
  for (size_t a = 0; a < cameras.size(); ++a) {
    for (size_t b = a + 1; b < cameras.size(); ++b) {
      if (cameras[a].session_id != cameras[b].session_id || cameras[a].clock == cameras[b].clock ||
          cameras[a].camera == cameras[b].camera) {
        continue;
      }
      std::optional<Contradiction> largest;
      for (const double hz : {100.0, 120.0}) {
        const auto found = Contradict(cameras[a], cameras[b], hz);
        if (!found) continue;
        if (!largest || std::abs(found->value_s) > std::abs(largest->value_s)) largest = found;
      }
      if (!largest) continue;
      largest->a = a;
      largest->b = b;
      all.push_back(*largest);
    }
  }
  std::vector<Finding> findings;
  while (!all.empty()) {
    const std::string name = cameras[MostContradicted(all, cameras)].camera;
    const auto has = [&](const Contradiction& found) {
      return cameras[found.a].camera == name || cameras[found.b].camera == name;
    };
    Contradiction worst;
    size_t count = 0;
    for (const Contradiction& found : all) {
      if (!has(found)) continue;
      ++count;
      if (std::abs(found.value_s) > std::abs(worst.value_s)) worst = found;
    }
    const bool is_b = cameras[worst.b].camera == name;
    const std::string& other = cameras[is_b ? worst.a : worst.b].camera;
    if (!is_b) worst.value_s = -worst.value_s;
    findings.push_back({.kind = FindingKind::kLampFlickerContradicts,
                        .camera = name,
                        .value = 1e3 * worst.value_s,
                        .unit = "ms",
                        .advice = Advice(worst, other, count == 1)});
    std::erase_if(all, has);
  }
  return findings;
}

}  // namespace rigcal::server

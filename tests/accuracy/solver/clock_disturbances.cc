// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <utility>

#include "absl/strings/str_format.h"
#include "tests/accuracy/solver/disturbance.h"

namespace rigcal::accuracy {
namespace {

// Seconds that are added to the stamp of a row `share` of the way through the recording.
void MoveStamps(const std::function<double(double share)>& added_s, DoctorPatient* patient) {
  std::vector<Observation>& rows = TrackOf(patient).observations;
  const auto [first_ns, span_s] = SpanOf(rows);
  for (Observation& row : rows) {
    const double share = 1e-9 * static_cast<double>(row.time_ns - first_ns) / span_s;
    row.time_ns += std::llround(1e9 * added_s(share));
  }
}

void ScaleStamps(double factor, server::CameraTrack* track) {
  for (Observation& row : track->observations) {
    row.time_ns = std::llround(factor * static_cast<double>(row.time_ns));
  }
}

void CountRows(server::CameraTrack* track) {
  int64_t number = 0;
  for (Observation& row : track->observations) row.time_ns = number++;
}

Disturbance OfClock(const std::string& name, std::vector<FindingKind> causes,
                    std::function<double(double share, double span_s)> added_s) {
  return {name, std::move(causes), "", true, true, [added_s](uint32_t, DoctorPatient* patient) {
            const double span_s = SpanOf(TrackOf(patient).observations).second;
            MoveStamps([&](double share) { return added_s(share, span_s); }, patient);
          }};
}

Disturbance OfUnits(const std::string& name, const std::string& unit, bool all,
                    const std::function<void(server::CameraTrack*)>& change) {
  return {name, {}, unit, true, false, [all, change](uint32_t, DoctorPatient* patient) {
            if (all) {
              for (server::CameraTrack& track : patient->input.tracks) change(&track);
            } else {
              change(&TrackOf(patient));
            }
          }};
}

}  // namespace

std::vector<Disturbance> ClockDisturbances() {
  const std::vector<FindingKind> jump = {FindingKind::kClockJump};
  const std::vector<FindingKind> drift = {FindingKind::kClockDrift};
  std::vector<Disturbance> list;
  for (const double jump_s : {0.008, 0.03, -0.1}) {
    list.push_back(OfClock(absl::StrFormat("clock jumps %.0f ms", 1e3 * jump_s), jump,
                           [jump_s](double share, double) { return share < 0.5 ? 0 : jump_s; }));
  }
  list.push_back(OfClock("clock jumps 30 ms late", jump,
                         [](double share, double) { return share < 0.8 ? 0 : 0.03; }));
  list.push_back(OfClock("clock jumps 20 and 25 ms", jump, [](double share, double) {
    return (share < 1.0 / 3 ? 0 : 0.02) + (share < 2.0 / 3 ? 0 : 0.025);
  }));
  list.push_back(OfClock("clock jumps 30 ms and back", jump, [](double share, double) {
    return share < 0.4 || share >= 0.65 ? 0 : 0.03;
  }));
  list.push_back(OfClock("clock 2000 ppm faster half-way", drift, [](double share, double span_s) {
    return 2e-3 * span_s * std::max(0.0, share - 0.5);
  }));
  for (const double drift_s : {0.02, 0.05}) {
    list.push_back(OfClock(absl::StrFormat("quadratic drift %.0f ms", 1e3 * drift_s), drift,
                           [drift_s](double share, double) { return drift_s * share * share; }));
  }
  for (const double offset_s : {0.02, 0.3, 1.5, 12.0}) {
    list.push_back(OfClock(absl::StrFormat("clock %.0f ms off", 1e3 * offset_s),
                           {FindingKind::kClockOffset},
                           [offset_s](double, double) { return offset_s; }));
  }
  for (const double rate_ppm : {1000.0, 3228.0}) {
    // Which the solve estimates.
    list.push_back(OfClock(
        absl::StrFormat("clock %.0f ppm fast", rate_ppm), drift,
        [rate_ppm](double share, double span_s) { return 1e-6 * rate_ppm * share * span_s; }));
  }
  return list;
}

std::vector<Disturbance> UnitDisturbances() {
  const auto scaled = [](double factor) {
    return [factor](server::CameraTrack* track) { ScaleStamps(factor, track); };
  };
  return {OfUnits("stamps in us, one", "microseconds", false, scaled(1e-3)),
          OfUnits("stamps in us, all", "microseconds", true, scaled(1e-3)),
          OfUnits("stamps in ms, one", "milliseconds", false, scaled(1e-6)),
          OfUnits("stamps in ms, all", "milliseconds", true, scaled(1e-6)),
          OfUnits("stamps in s, one", "seconds", false, scaled(1e-9)),
          OfUnits("row numbers, one", "row numbers", false, CountRows),
          OfUnits("row numbers, all", "row numbers", true, CountRows)};
}

}  // namespace rigcal::accuracy

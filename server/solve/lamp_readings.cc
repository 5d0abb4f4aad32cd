// SPDX-License-Identifier: Apache-2.0
#include "server/solve/lamp_readings.h"

#include <cmath>
#include <utility>

#include "server/solve/clock_report.h"

namespace rigcal::server {
namespace {

constexpr uint32_t kUnknownSigmaNs = 1'000'000;  // as ClockSample says

std::vector<ClockSample> LampSamplesOf(const std::vector<CameraTrack>& tracks,
                                       const CleanTrack& wanted) {
  std::vector<ClockSample> samples;
  for (const CameraTrack& track : tracks) {
    if (track.session_id != wanted.session_id || track.camera.camera != wanted.camera.camera) {
      continue;
    }
    for (const CameraTrack::EpochSample& sample : track.clock_samples) {
      if (sample.clock_epoch != wanted.clock_epoch || sample.sample.light != kLamps) continue;
      samples.push_back(sample.sample);
    }
  }
  return samples;
}

}  // namespace

std::vector<LampPhases> LampPhasesOf(const std::vector<CameraTrack>& tracks,
                                     const RigObservations& rig,
                                     const EvaluatedSolution& evaluated) {
  const RigSolution& solution = evaluated.solution;
  const ClockReport report = ReportClocks(rig, evaluated);
  std::vector<LampPhases> all;
  for (size_t t = 0; t < rig.tracks.size(); ++t) {
    const AlignedTrack& track = rig.tracks[t];
    if (track.is_static) continue;
    const auto clock = static_cast<size_t>(rig.index.clock_of_track[t]);
    LampPhases phases{.session_id = track.track.session_id,
                      .camera = track.track.camera.camera,
                      .clock = static_cast<int>(clock),
                      .offset_sigma_s = report.offset_sigma_s[clock]};
    ClockCorrection correction = solution.clocks[clock];
    correction.time_offset_s += solution.built.problem.clocks[clock].time_offset_s;
    correction.time_rate += solution.built.problem.clocks[clock].time_rate;
    for (const ClockSample& sample : LampSamplesOf(tracks, track.track)) {
      const uint32_t sigma_ns = sample.uncertainty_ns > 0 ? sample.uncertainty_ns : kUnknownSigmaNs;
      phases.moments.push_back({.rig_time_ns = track.CoarseRigTimeNs(sample.device_ns) +
                                               std::llround(1e9 * correction.At(sample.device_ns)),
                                .period_s = 1e-9 * static_cast<double>(sample.light_ns),
                                .sigma_s = 1e-9 * sigma_ns});
    }
    if (!phases.moments.empty()) all.push_back(std::move(phases));
  }
  return all;
}

}  // namespace rigcal::server

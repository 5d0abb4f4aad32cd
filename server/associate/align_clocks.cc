// SPDX-License-Identifier: Apache-2.0
#include "server/associate/align_clocks.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <map>
#include <set>
#include <tuple>
#include <utility>

#include "absl/numeric/int128.h"
#include "absl/strings/str_cat.h"
#include "common/statistics/robust_statistics.h"
#include "server/associate/far_clocks.h"
#include "server/associate/light_clocks.h"

namespace rigcal::server {
namespace {

constexpr double kDefaultSampleSigmaS = 1e-3;
// A host's UTC that moves by more against its monotonic clock has been set; readings are better.
constexpr int64_t kStepNs = 50'000'000;

// Server UTC minus host UTC: the median of the pings that were about as good as the best.
int64_t HostCorrectionNs(const std::vector<HostAlignment>& alignments) {
  if (alignments.empty()) return 0;
  const uint32_t best =
      std::ranges::min(alignments, {}, &HostAlignment::uncertainty_ns).uncertainty_ns;
  std::vector<int64_t> corrections;
  for (const HostAlignment& alignment : alignments) {
    if (alignment.uncertainty_ns / 2 <= best) corrections.push_back(alignment.server_minus_host_ns);
  }
  return LowerMedian(std::move(corrections));
}

// What clocks say may be anything; what is beyond this, 146 years, says nothing. Differences of two
// such times, and sums of one with a period, are within 64 bits.
constexpr int64_t kMaxRigTimeNs = (int64_t{1} << 62) - 1;
constexpr double kMaxPeriodS = 1e9;

int64_t Bounded(absl::int128 value) {
  return static_cast<int64_t>(
      std::clamp<absl::int128>(value, -absl::int128(kMaxRigTimeNs), kMaxRigTimeNs));
}

// Every row of the track has a rig time that can be calculated with.
bool IsWithinReach(const CleanTrack& track, int64_t offset_ns, int64_t latency_ns) {
  const auto within = [&](size_t row) {
    const absl::int128 rig_time_ns =
        absl::int128(track.observations.time_ns(row)) + offset_ns - latency_ns;
    return rig_time_ns >= -kMaxRigTimeNs && rig_time_ns <= kMaxRigTimeNs;
  };
  return within(0) && within(track.observations.size() - 1);
}

// How the host of a camera relates to the server: UTC of the server minus the host's UTC, or where
// that has been set in between, minus its monotonic clock, which nobody sets.
struct HostRelation {
  bool by_monotonic = false;
  int64_t correction_ns = 0;

  int64_t ServerMinusDeviceNs(const ClockSample& sample) const {
    const int64_t host_ns = by_monotonic ? sample.host_monotonic_ns : sample.host_utc_ns;
    return Bounded(absl::int128(host_ns) - sample.device_ns + correction_ns);
  }
};

bool UtcWasSetBetween(const ClockSample& a, const ClockSample& b) {
  const absl::int128 utc_ns = absl::int128(b.host_utc_ns) - a.host_utc_ns;
  const absl::int128 monotonic_ns = absl::int128(b.host_monotonic_ns) - a.host_monotonic_ns;
  const absl::int128 step_ns = utc_ns - monotonic_ns;
  return monotonic_ns > 0 && (step_ns > kStepNs || step_ns < -kStepNs);
}

HostRelation RelateHost(const CameraTrack& track) {
  std::vector<ClockSample> samples;
  for (const CameraTrack::EpochSample& sample : track.clock_samples) {
    if (sample.sample.IsOfHost()) samples.push_back(sample.sample);
  }
  const auto key = [](const ClockSample& sample) {
    return std::pair(sample.host_monotonic_ns, sample.host_utc_ns);
  };
  std::ranges::sort(samples, {}, key);
  // Each ping with the samples around it: a ping between two that differ could be of either.
  std::vector<HostAlignment> to_monotonic;
  for (const HostAlignment& ping : track.host_alignments) {
    const auto after = std::ranges::lower_bound(samples, ping.host_monotonic_ns, {},
                                                &ClockSample::host_monotonic_ns);
    const bool is_between = after != samples.begin() && after != samples.end();
    if (samples.empty() || (is_between && UtcWasSetBetween(*std::prev(after), *after))) continue;
    const ClockSample& nearby = after == samples.end() ? samples.back() : *after;
    HostAlignment alignment = ping;
    alignment.server_minus_host_ns = Bounded(absl::int128(ping.server_minus_host_ns) +
                                             nearby.host_utc_ns - nearby.host_monotonic_ns);
    to_monotonic.push_back(alignment);
  }
  if (std::ranges::adjacent_find(samples, UtcWasSetBetween) == samples.end() ||
      to_monotonic.empty()) {
    return {.by_monotonic = false, .correction_ns = HostCorrectionNs(track.host_alignments)};
  }
  return {.by_monotonic = true, .correction_ns = HostCorrectionNs(to_monotonic)};
}

std::map<ClockKey, ClockOffset> OffsetsFromSamples(const std::vector<CameraTrack>& tracks) {
  std::map<ClockKey, std::vector<int64_t>> differences;
  std::map<ClockKey, double> sigmas;
  for (const CameraTrack& track : tracks) {
    const HostRelation host = RelateHost(track);
    for (const CameraTrack::EpochSample& sample : track.clock_samples) {
      if (!sample.sample.IsOfHost()) continue;
      const ClockKey key = {track.session_id, track.camera.clock.clock_id, sample.clock_epoch};
      differences[key].push_back(host.ServerMinusDeviceNs(sample.sample));
      const double sigma = sample.sample.uncertainty_ns > 0
                               ? static_cast<double>(sample.sample.uncertainty_ns) * 1e-9
                               : kDefaultSampleSigmaS;
      sigmas[key] = std::max(sigmas[key], sigma);
    }
  }
  std::map<ClockKey, ClockOffset> offsets;
  for (auto& [key, values] : differences) {
    const int64_t median = LowerMedian(values);
    for (int64_t& value : values) value = std::abs(value - median);
    const double spread = 1e-9 * kSigmaOverMad * static_cast<double>(LowerMedian(values));
    offsets[key] = {.offset_ns = median, .sigma_s = std::max(sigmas[key], spread)};
  }
  return offsets;
}

// Of the steps up to kMaxSteps periods, those that are multiples of the period and those that are
// one period.
constexpr double kMinMultiples = 0.9, kMinSingles = 0.05;
constexpr double kMultipleTolerance = 0.15;  // periods
constexpr int kMaxSteps = 10;
constexpr int kMaxPeriodsInMedian = 16;
constexpr int kMinSteps = 20;  // fewer tell nothing

// The steps between rows are those of frames of this period, some of which have no row.
bool AreFramesOf(double period_ns, const std::vector<int64_t>& steps_ns) {
  int singles = 0, multiples = 0, all = 0;
  for (const int64_t step_ns : steps_ns) {
    const double periods = static_cast<double>(step_ns) / period_ns;
    if (periods > kMaxSteps + kMultipleTolerance) continue;
    const double whole = std::round(periods);
    const bool is_multiple = whole >= 1 && std::abs(periods - whole) < kMultipleTolerance;
    ++all;
    multiples += is_multiple ? 1 : 0;
    singles += is_multiple && whole == 1 ? 1 : 0;
  }
  return all >= kMinSteps && multiples >= kMinMultiples * all && singles >= kMinSingles * all;
}

// The median step, and the step of the frames that the rows are of, of which most may be lost.
void MeasurePeriods(AlignedTrack* track) {
  const ObservationTable& observations = track->track.observations;
  if (observations.size() < 2) return;
  std::vector<int64_t> steps_ns;
  steps_ns.reserve(observations.size() - 1);
  for (size_t i = 1; i < observations.size(); ++i) {
    steps_ns.push_back(observations.time_ns(i) - observations.time_ns(i - 1));
  }
  const auto median_ns = static_cast<double>(LowerMedian(steps_ns));
  track->period_s = std::min(kMaxPeriodS, 1e-9 * median_ns);
  for (int count = 1; count <= kMaxPeriodsInMedian; ++count) {
    if (!AreFramesOf(median_ns / count, steps_ns)) continue;
    track->frame_period_s = track->period_s / count;
    return;
  }
}

}  // namespace

std::vector<AlignedTrack> AlignClocks(const std::vector<CameraTrack>& tracks,
                                      std::vector<CleanTrack> clean, RefusalCounter* refused,
                                      std::vector<StampFault>* faults) {
  std::map<ClockKey, ClockOffset> offsets = OffsetsFromSamples(tracks);
  std::map<std::string, std::set<std::string>> timebases;  // by session
  for (const CleanTrack& track : clean) {
    timebases[track.session_id].insert(track.camera.clock.timebase);
  }
  const auto key_of = [](const CleanTrack& track) {
    return ClockKey{track.session_id, track.camera.clock.clock_id, track.clock_epoch};
  };
  for (const CleanTrack& track : clean) {
    const std::set<std::string>& bases = timebases[track.session_id];
    if (bases.size() == 1 && !bases.begin()->empty()) offsets[key_of(track)] = {};
  }
  BringFarClocksTogether(clean, &offsets, faults);
  RelateByLight(tracks, &offsets, faults);
  std::vector<AlignedTrack> aligned;
  for (CleanTrack& track : clean) {
    const auto found = offsets.find(key_of(track));
    if (found == offsets.end()) {
      refused->Add(
          track.camera.camera, RefusalReason::kClockEpochWithoutOffset, track.observations.size(),
          absl::StrCat("clock epoch ", track.clock_epoch, " of clock ", track.camera.clock.clock_id,
                       ": no clock samples, no light code of a wand, and no time base that all "
                       "cameras share"));
      continue;
    }
    const ClockOffset offset = found->second;
    const int64_t latency_ns = std::llround(track.camera.latency_s * 1e9);
    if (!IsWithinReach(track, offset.offset_ns, latency_ns)) {
      refused->Add(
          track.camera.camera, RefusalReason::kClockEpochWithoutOffset, track.observations.size(),
          absl::StrCat("clock epoch ", track.clock_epoch, " of clock ", track.camera.clock.clock_id,
                       ": its times are more than 146 years from the server's"));
      continue;
    }
    AlignedTrack result;
    result.clock_offset_ns = offset.offset_ns;
    result.offset_sigma_s = offset.sigma_s;
    result.wand = offset.wand;
    result.latency_ns = latency_ns;
    result.track = std::move(track);
    MeasurePeriods(&result);
    aligned.push_back(std::move(result));
  }
  return aligned;
}

}  // namespace rigcal::server

// SPDX-License-Identifier: Apache-2.0
#include "server/associate/align_clocks.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <set>
#include <tuple>
#include <utility>

#include "absl/strings/str_cat.h"
#include "common/statistics/robust_statistics.h"

namespace rigcal::server {
namespace {

constexpr double kDefaultSampleSigmaS = 1e-3;

using ClockKey = std::tuple<std::string, std::string, uint32_t>;  // session, clock, epoch

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

struct Offset {
  int64_t offset_ns = 0;
  double sigma_s = 0;
};

std::map<ClockKey, Offset> OffsetsFromSamples(const std::vector<CameraTrack>& tracks) {
  std::map<ClockKey, std::vector<int64_t>> differences;
  std::map<ClockKey, double> sigmas;
  for (const CameraTrack& track : tracks) {
    const int64_t correction = HostCorrectionNs(track.host_alignments);
    for (const CameraTrack::EpochSample& sample : track.clock_samples) {
      const ClockKey key = {track.session_id, track.camera.clock.clock_id, sample.clock_epoch};
      differences[key].push_back(sample.sample.host_utc_ns - sample.sample.device_ns + correction);
      const double sigma = sample.sample.uncertainty_ns > 0
                               ? static_cast<double>(sample.sample.uncertainty_ns) * 1e-9
                               : kDefaultSampleSigmaS;
      sigmas[key] = std::max(sigmas[key], sigma);
    }
  }
  std::map<ClockKey, Offset> offsets;
  for (auto& [key, values] : differences) {
    const int64_t median = LowerMedian(values);
    for (int64_t& value : values) value = std::abs(value - median);
    const double spread = 1e-9 * kSigmaOverMad * static_cast<double>(LowerMedian(values));
    offsets[key] = {median, std::max(sigmas[key], spread)};
  }
  return offsets;
}

double MedianPeriodS(const std::vector<Observation>& observations) {
  if (observations.size() < 2) return 0;
  std::vector<int64_t> steps;
  for (size_t i = 1; i < observations.size(); ++i) {
    steps.push_back(observations[i].time_ns - observations[i - 1].time_ns);
  }
  return 1e-9 * static_cast<double>(LowerMedian(std::move(steps)));
}

// Index into `clean` of the epoch that stands for each (session, camera) without clock samples.
std::set<size_t> LargestEpochs(const std::vector<CleanTrack>& clean) {
  std::map<std::pair<std::string, std::string>, size_t> largest;
  for (size_t i = 0; i < clean.size(); ++i) {
    const auto [entry, inserted] =
        largest.try_emplace({clean[i].session_id, clean[i].camera.camera}, i);
    // Epochs come in ascending order, so that of equal ones the lowest stays.
    if (!inserted && clean[i].observations.size() > clean[entry->second].observations.size()) {
      entry->second = i;
    }
  }
  std::set<size_t> chosen;
  for (const auto& [key, index] : largest) chosen.insert(index);
  return chosen;
}

}  // namespace

std::vector<AlignedTrack> AlignClocks(const std::vector<CameraTrack>& tracks,
                                      std::vector<CleanTrack> clean, RefusalCounter* refused) {
  const std::map<ClockKey, Offset> offsets = OffsetsFromSamples(tracks);
  const std::set<size_t> largest = LargestEpochs(clean);
  std::map<std::string, std::set<std::string>> timebases;  // by session
  for (const CleanTrack& track : clean) {
    timebases[track.session_id].insert(track.camera.clock.timebase);
  }
  std::vector<AlignedTrack> aligned;
  for (size_t i = 0; i < clean.size(); ++i) {
    CleanTrack& track = clean[i];
    const std::set<std::string>& bases = timebases[track.session_id];
    const bool has_timebase = bases.size() == 1 && !bases.begin()->empty();
    const auto found =
        offsets.find({track.session_id, track.camera.clock.clock_id, track.clock_epoch});
    if (has_timebase ? !largest.contains(i) : found == offsets.end()) {
      refused->Add(
          track.camera.camera, RefusalReason::kClockEpochWithoutOffset, track.observations.size(),
          absl::StrCat("clock epoch ", track.clock_epoch, " of clock ", track.camera.clock.clock_id,
                       has_timebase
                           ? ": the clock jumped back"
                           : ": no clock samples, and no time base that all cameras share"));
      continue;
    }
    const Offset offset = has_timebase ? Offset{} : found->second;
    AlignedTrack result;
    result.clock_offset_ns = offset.offset_ns;
    result.offset_sigma_s = offset.sigma_s;
    result.latency_ns = std::llround(track.camera.latency_s * 1e9);
    result.period_s = MedianPeriodS(track.observations);
    result.track = std::move(track);
    aligned.push_back(std::move(result));
  }
  return aligned;
}

}  // namespace rigcal::server

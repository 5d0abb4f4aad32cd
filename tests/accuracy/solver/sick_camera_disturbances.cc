// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <random>
#include <utility>

#include "tests/accuracy/solver/disturbance.h"

namespace rigcal::accuracy {
namespace {

constexpr int64_t kSinceBootNs = 1'000'000'000'000;  // a quarter of an hour
constexpr int64_t kSince1970Ns = 1'700'000'000'000'000'000;

server::CameraTrack& OtherTrackOf(DoctorPatient* patient) {
  return *std::ranges::find(patient->input.tracks, patient->other_camera,
                            [](const server::CameraTrack& track) { return track.camera.camera; });
}

// The camera's rows between two shares of the recording are those of the other camera.
void CopyRows(double from, double to, double later_s, DoctorPatient* patient) {
  const server::CameraTrack& source = OtherTrackOf(patient);
  server::CameraTrack& track = TrackOf(patient);
  const auto [first_ns, span_s] = SpanOf(source.observations);
  const auto is_copied = [&, first = first_ns, span = span_s](const Observation& row) {
    const double share = 1e-9 * static_cast<double>(row.time_ns - first) / span;
    return share >= from && share <= to;
  };
  std::erase_if(track.observations, is_copied);
  for (Observation row : source.observations) {
    if (!is_copied(row)) continue;
    row.time_ns += std::llround(1e9 * later_s);
    track.observations.push_back(std::move(row));
  }
  std::ranges::stable_sort(track.observations, {}, &Observation::time_ns);
}

// A camera more, whose rows and lens are those of the one to disturb.
void NameTwice(DoctorPatient* patient) {
  server::CameraTrack twin = TrackOf(patient);
  twin.camera.camera += "_again";
  patient->cam_from_rig[twin.camera.camera] = patient->cam_from_rig.at(patient->camera);
  patient->input.tracks.push_back(std::move(twin));
}

// The camera's image stands still from `from` of the way on.
void Freeze(double from, DoctorPatient* patient) {
  std::vector<Observation>& rows = TrackOf(patient).observations;
  const auto [first_ns, span_s] = SpanOf(rows);
  const Observation* frozen = nullptr;
  for (Observation& row : rows) {
    const double share = 1e-9 * static_cast<double>(row.time_ns - first_ns) / span_s;
    if (share < from) continue;
    if (frozen != nullptr) row.markers = frozen->markers;
    if (frozen == nullptr && row.VisibleCount() == static_cast<int>(row.markers.size()))
      frozen = &row;
  }
}

// The first half of the cameras counts since 1970, the others since their PC's start.
void SplitClocks(DoctorPatient* patient) {
  std::vector<server::CameraTrack>& tracks = patient->input.tracks;
  int64_t least_ns = SpanOf(tracks.front().observations).first;
  for (const server::CameraTrack& track : tracks) {
    least_ns = std::min(least_ns, SpanOf(track.observations).first);
  }
  for (size_t t = 0; t < tracks.size(); ++t) {
    const int64_t begin_ns = 2 * t < tracks.size() ? kSince1970Ns : kSinceBootNs;
    for (Observation& row : tracks[t].observations) row.time_ns += begin_ns - least_ns;
  }
}

// Some of the rows show something else, anywhere.
void ScatterSome(uint32_t seed, double share, server::CameraTrack* track) {
  std::mt19937 random(seed);
  std::bernoulli_distribution chosen(share);
  const ImageSize size = track->camera.image_size_px;
  std::uniform_real_distribution<double> x(0, size.width - 1), y(0, size.height - 1);
  for (Observation& row : track->observations) {
    if (!chosen(random)) continue;
    for (MarkerObservation& marker : row.markers) {
      if (marker.visible) marker.centre_px = {x(random), y(random)};
    }
  }
}

// In seconds chosen by chance two cameras see another wand: one that is where this one is seven
// seconds later.
void WaveTwoWands(uint32_t seed, double share, DoctorPatient* patient) {
  constexpr int64_t kLaterNs = 7'000'000'000, kSpanNs = 1'000'000'000, kNearNs = 20'000'000;
  std::mt19937 random(seed);
  std::bernoulli_distribution chosen(share);
  std::vector<bool> is_second(10'000);
  for (size_t i = 0; i < is_second.size(); ++i) is_second[i] = chosen(random);
  for (server::CameraTrack* track : {&TrackOf(patient), &OtherTrackOf(patient)}) {
    const std::vector<Observation> before = track->observations;
    for (Observation& row : track->observations) {
      const auto second = static_cast<size_t>(row.time_ns / kSpanNs) % is_second.size();
      const auto later = std::ranges::lower_bound(before, row.time_ns + kLaterNs - kNearNs, {},
                                                  &Observation::time_ns);
      if (!is_second[second] || later == before.end()) continue;
      if (later->time_ns <= row.time_ns + kLaterNs + kNearNs) row.markers = later->markers;
    }
  }
}

// Stamps that are taken when a row arrives, in order.
void StampArrivals(uint32_t seed, bool one_sided, double jitter_s, server::CameraTrack* track) {
  std::mt19937 random(seed);
  std::normal_distribution<double> late(0, jitter_s);
  std::uniform_real_distribution<double> around(-jitter_s, jitter_s);
  int64_t last_ns = 0;
  for (Observation& row : track->observations) {
    const double added_s = one_sided ? std::abs(late(random)) : around(random);
    row.time_ns = std::max<int64_t>(row.time_ns + std::llround(1e9 * added_s), last_ns + 100'000);
    last_ns = row.time_ns;
  }
}

void ScaleLens(double factor, server::CameraTrack* track) {
  track->camera.intrinsics->fx_px *= factor;
  track->camera.intrinsics->fy_px *= factor;
}

Disturbance OfCopy(const std::string& name, const std::function<void(DoctorPatient*)>& change) {
  Disturbance copy{name, {FindingKind::kRowsCopied}, "same rows", false, false, {}};
  copy.of_clock = true;  // the stamps are copied, too
  copy.apply = [change](uint32_t, DoctorPatient* patient) { change(patient); };
  return copy;
}

Disturbance OfJitter(const std::string& name, bool one_sided, bool all) {
  Disturbance jitter = OfTrack(name, {FindingKind::kStampsJitter}, all,
                               [one_sided](uint32_t seed, server::CameraTrack* track) {
                                 StampArrivals(seed, one_sided, 0.02, track);
                               });
  jitter.of_clock = true;  // arrivals are late on average
  return jitter;
}

Disturbance Fixed(const std::string& name, bool wand, bool lenses) {
  Disturbance fixed{name, {}, "", false, false, {}};
  if (wand) fixed.causes.push_back(FindingKind::kWrongWandLength);
  if (lenses) fixed.causes.push_back(FindingKind::kWrongIntrinsics);
  if (wand) fixed.options.marker_positions = Estimate::kFixed;
  if (lenses) fixed.options.intrinsics = Estimate::kFixed;
  fixed.apply = [wand, lenses](uint32_t, DoctorPatient* patient) {
    if (wand) patient->input.target.marker_positions_m = {0, 0.13, 0.40};
    if (!lenses) return;
    for (server::CameraTrack& track : patient->input.tracks) ScaleLens(1.03, &track);
  };
  return fixed;
}

}  // namespace

std::vector<Disturbance> SickCameraDisturbances() {
  const auto copy = [](double from, double to, double later_s) {
    return [=](DoctorPatient* patient) { CopyRows(from, to, later_s, patient); };
  };
  const auto scatter = [](double share) {
    return [share](uint32_t seed, server::CameraTrack* track) { ScatterSome(seed, share, track); };
  };
  const auto freeze = [](double from) {
    return [from](uint32_t, DoctorPatient* patient) { Freeze(from, patient); };
  };
  const std::vector<FindingKind> frozen = {FindingKind::kRowsFrozen};
  return {
      OfCopy("file copied", copy(0, 1, 0)),
      OfCopy("file copied with its lens",
             [](DoctorPatient* patient) {
               CopyRows(0, 1, 0, patient);
               TrackOf(patient).camera.intrinsics = OtherTrackOf(patient).camera.intrinsics;
             }),
      OfCopy("file copied, 3 s later", copy(0, 1, 3)),
      OfCopy("file copied in 30 %", copy(0.3, 0.6, 0)),
      OfCopy("file under two names", NameTwice),
      {"frozen", frozen, "frozen", true, false, freeze(0)},
      {"frozen from half-way on", frozen, "frozen", true, false, freeze(0.5)},
      {"clocks since 1970 and since boot",
       {FindingKind::kClockFoundByMotion},
       "",
       false,
       true,
       [](uint32_t, DoctorPatient* patient) { SplitClocks(patient); }},
      OfTrack("30 % outliers", {FindingKind::kOutliersInCamera}, false, scatter(0.3)),
      OfTrack("70 % outliers", {FindingKind::kOutliersInCamera, FindingKind::kInconsistentCamera},
              false, scatter(0.7)),
      {"second wand in 30 % of two",
       {FindingKind::kSecondWandSeen},
       "",
       false,
       false,
       [](uint32_t seed, DoctorPatient* patient) { WaveTwoWands(seed, 0.3, patient); }},
      OfJitter("stamps 20 ms late, one", true, false),
      OfJitter("stamps 20 ms late, all", true, true),
      OfJitter("stamps +-20 ms, one", false, false),
      OfJitter("stamps +-20 ms, all", false, true),
      Fixed("wand 10 mm off, kept", true, false),
      Fixed("all lenses 3 % off, kept", false, true),
      Fixed("wand and lenses off, kept", true, true),
  };
}

}  // namespace rigcal::accuracy

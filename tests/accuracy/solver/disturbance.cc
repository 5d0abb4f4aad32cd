// SPDX-License-Identifier: Apache-2.0
#include "tests/accuracy/solver/disturbance.h"

#include <algorithm>
#include <iterator>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"

namespace rigcal::accuracy {
namespace {

// Keeps `keep_s` in the middle of the recording.
void Crop(double keep_s, DoctorPatient* patient) {
  int64_t first_ns = 0, last_ns = 0;
  for (const server::CameraTrack& track : patient->input.tracks) {
    const auto [begin_ns, span_s] = SpanOf(track.observations);
    if (first_ns == 0 || begin_ns > first_ns) first_ns = begin_ns;
    last_ns = std::max<int64_t>(last_ns, begin_ns + std::llround(1e9 * span_s));
  }
  const int64_t middle_ns = first_ns + (last_ns - first_ns) / 2;
  const int64_t half_ns = std::llround(0.5e9 * keep_s);
  for (server::CameraTrack& track : patient->input.tracks) {
    std::erase_if(track.observations, [&](const Observation& row) {
      return row.time_ns < middle_ns - half_ns || row.time_ns > middle_ns + half_ns;
    });
  }
}

Disturbance OfWand(const std::string& name, std::vector<double> positions_m) {
  return {name,
          {FindingKind::kWrongWandLength},
          "",
          false,
          false,
          [positions_m](uint32_t, DoctorPatient* patient) {
            patient->input.target.marker_positions_m = positions_m;
          }};
}

// The same of the second camera.
std::function<void(uint32_t, DoctorPatient*)> OfTheOther(const Disturbance& disturbance) {
  return [apply = disturbance.apply](uint32_t seed, DoctorPatient* patient) {
    std::swap(patient->camera, patient->other_camera);
    apply(seed, patient);
    std::swap(patient->camera, patient->other_camera);
  };
}

Disturbance Both(const Disturbance& one, const Disturbance& two) {
  Disturbance both = one;
  both.name = absl::StrCat(one.name, " + ", two.name);
  both.causes.insert(both.causes.end(), two.causes.begin(), two.causes.end());
  both.of_one_camera = false;
  both.of_clock = one.of_clock || two.of_clock;
  both.all_causes = true;
  both.apply = [first = one.apply, second = OfTheOther(two)](uint32_t seed,
                                                             DoctorPatient* patient) {
    first(seed, patient);
    second(seed, patient);
  };
  return both;
}

const Disturbance& Named(const std::vector<Disturbance>& list, const std::string& name) {
  return *std::ranges::find(list, name, &Disturbance::name);
}

std::vector<Disturbance> Combinations(const std::vector<Disturbance>& list) {
  return {Both(Named(list, "turned 0.40 degrees half-way"), Named(list, "clock jumps 30 ms")),
          Both(Named(list, "wand's end 10 mm off"), Named(list, "noise of 5 px")),
          Both(Named(list, "mirrored"), Named(list, "clock 20 ms off"))};
}

void Append(std::vector<Disturbance> from, std::vector<Disturbance>* to) {
  std::ranges::move(from, std::back_inserter(*to));
}

}  // namespace

// Of one camera, and of all.
Disturbance OfTrack(const std::string& name, std::vector<FindingKind> causes, bool all,
                    const std::function<void(uint32_t seed, server::CameraTrack*)>& change) {
  return {name,
          std::move(causes),
          "",
          !all,
          false,
          [all, change](uint32_t seed, DoctorPatient* patient) {
            if (!all) return change(seed, &TrackOf(patient));
            for (server::CameraTrack& track : patient->input.tracks) change(seed++, &track);
          }};
}

std::vector<Disturbance> AllDisturbances() {
  std::vector<Disturbance> list;
  list.push_back({"clean", {}, "", false, false, [](uint32_t, DoctorPatient*) {}});
  for (const double keep_s : {2.0, 4.0}) {
    list.push_back({absl::StrFormat("%.0f s of data", keep_s),
                    {FindingKind::kTooLittleData},
                    "",
                    false,
                    false,
                    [keep_s](uint32_t, DoctorPatient* patient) { Crop(keep_s, patient); }});
  }
  list.push_back(OfWand("wand's end 10 mm off", {0, 0.13, 0.40}));
  list.push_back(OfWand("wand's end -10 mm off", {0, 0.13, 0.38}));
  list.push_back(OfWand("wand's middle 10 mm off", {0, 0.14, 0.39}));
  list.push_back(OfWand("wand's middle 5 mm off", {0, 0.135, 0.39}));
  Append(UnitDisturbances(), &list);
  Append(ClockDisturbances(), &list);
  Append(ImageDisturbances(), &list);
  Append(MoveDisturbances(), &list);
  Append(WandDisturbances(), &list);
  Append(LensDisturbances(), &list);
  Append(RowDisturbances(), &list);
  Append(SickCameraDisturbances(), &list);
  Append(Combinations(list), &list);
  return list;
}

}  // namespace rigcal::accuracy

// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <map>
#include <string>
#include <vector>

#include "absl/strings/str_format.h"
#include "absl/strings/str_join.h"
#include "server/solve/diagnose/finding_causes.h"

namespace rigcal::server {
namespace {

// What is shorter is a late start. The same as a share of the session's recording.
constexpr double kLeastAbsenceS = 5, kLeastAbsenceShare = 0.05;

// When one camera has rows in one session, with or without a marker; rig times, ascending.
struct Presence {
  std::vector<int64_t> times_ns;
  bool has_empty_rows = false;  // else a time without rows may be one without the target
};

using Presences = std::map<int, Presence>;  // by camera

// By session.
std::map<std::string, Presences> PresencesOf(const CauseInput& input) {
  const auto times = RigTimes(input.rig.tracks, input.rig.index,
                              InitializationFrom(input.evaluated.solution).clocks);
  std::map<std::string, Presences> sessions;
  for (size_t t = 0; t < input.rig.tracks.size(); ++t) {
    const AlignedTrack& track = input.rig.tracks[t];
    if (track.is_static) continue;
    Presence& presence = sessions[track.track.session_id][input.rig.index.camera_of_track[t]];
    const ObservationTable& rows = track.track.observations;
    for (size_t row = 0; row < rows.size(); ++row) {
      presence.times_ns.push_back(times[t][row]);
      presence.has_empty_rows |= !rows.AnyVisible(row);
    }
  }
  for (auto& [session, presences] : sessions) {
    std::erase_if(presences, [](const auto& one) { return one.second.times_ns.empty(); });
    for (auto& [camera, presence] : presences) std::ranges::sort(presence.times_ns);
  }
  return sessions;
}

struct Span {
  int64_t from_ns = 0, to_ns = 0;

  double DurationS() const { return 1e-9 * static_cast<double>(to_ns - from_ns); }
};

// While at least two cameras had rows, by their first and last ones.
Span RecordingOf(const Presences& presences) {
  std::vector<int64_t> firsts, lasts;
  for (const auto& [camera, presence] : presences) {
    firsts.push_back(presence.times_ns.front());
    lasts.push_back(presence.times_ns.back());
  }
  std::ranges::sort(firsts);
  std::ranges::sort(lasts);
  return {firsts[1], lasts[lasts.size() - 2]};
}

std::vector<Span> AbsencesOf(const Presence& presence, const Span& recording) {
  const double least_s = std::max(kLeastAbsenceS, kLeastAbsenceShare * recording.DurationS());
  std::vector<Span> absences;
  int64_t last_ns = recording.from_ns;
  const auto look = [&](int64_t next_ns) {
    const Span span{last_ns, std::min(next_ns, recording.to_ns)};
    if (span.DurationS() >= least_s) absences.push_back(span);
    last_ns = std::max(last_ns, next_ns);
  };
  for (const int64_t time_ns : presence.times_ns) look(time_ns);
  look(recording.to_ns);
  return absences;
}

}  // namespace

std::vector<Cause> FindAbsences(const CauseInput& input) {
  std::vector<Cause> causes;
  for (const auto& [session, presences] : PresencesOf(input)) {
    if (presences.size() < 2) continue;
    const Span recording = RecordingOf(presences);
    for (const auto& [camera, presence] : presences) {
      if (!presence.has_empty_rows) continue;
      const std::vector<Span> absences = AbsencesOf(presence, recording);
      if (absences.empty()) continue;
      double total_s = 0;
      for (const Span& span : absences) total_s += span.DurationS();
      const auto span_text = [&](std::string* out, const Span& span) {
        absl::StrAppendFormat(out, "from %.1f s to %.1f s",
                              Span{recording.from_ns, span.from_ns}.DurationS(),
                              Span{recording.from_ns, span.to_ns}.DurationS());
      };
      causes.push_back(
          {{FindingKind::kCameraAbsent, input.rig.index.cameras[static_cast<size_t>(camera)].camera,
            total_s, "s",
            absl::StrFormat(
                "it has no rows %s of the recording of %.1f s, while other cameras have; "
                "the rest is used. If it was on, its file was cut off, or its rows are "
                "still with its agent",
                absl::StrJoin(absences, " and ", span_text), recording.DurationS())},
           0});
    }
  }
  return causes;
}

}  // namespace rigcal::server

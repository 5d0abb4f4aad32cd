// SPDX-License-Identifier: Apache-2.0
#include "server/solve/time_search_report.h"

#include <cmath>
#include <string>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/strings/str_join.h"
#include "server/solve/diagnose/readable_time.h"

namespace rigcal::server {
namespace {

// The name of a track's camera.
const std::string& NameOfTrack(const RigObservations& rig, int track) {
  return rig.tracks[static_cast<size_t>(track)].track.camera.camera;
}

}  // namespace

absl::Status CheckDecided(const RigObservations& rig, const TimeSearchOutcome& searched) {
  if (searched.ambiguous.empty()) return absl::OkStatus();
  const AmbiguousMotion& pair = searched.ambiguous.front();
  std::vector<std::string> offsets;
  for (const MotionPeak& peak : pair.peaks) {
    offsets.push_back(absl::StrFormat("%+.2f s", peak.offset_s));
  }
  return absl::FailedPreconditionError(absl::StrCat(
      "the clocks of cameras ", NameOfTrack(rig, pair.track_a), " and ",
      NameOfTrack(rig, pair.track_b),
      " are not known to each other, and the motion that both saw repeats itself: what ",
      NameOfTrack(rig, pair.track_b), " saw fits when its clock is moved by ",
      absl::StrJoin(offsets, " or "),
      ". Wave the wand without a rhythm, through all of what the cameras see, or give the cameras "
      "clocks that are known to each other"));
}

void AddSearchFindings(const RigObservations& rig, const TimeSearchOutcome& searched,
                       std::vector<Finding>* findings) {
  for (const ClockByMotion& clock : searched.by_motion) {
    const std::string& camera = NameOfTrack(rig, clock.track);
    const ReadableTime offset = ReadableTimeOf(clock.offset_s);
    findings->push_back(
        {FindingKind::kClockFoundByMotion, camera, offset.value, offset.unit,
         absl::StrFormat("the clock of %s was found %s %s the median clock by the motion of the "
                         "target that it and the others saw; its stamps gave no hint of that",
                         camera, FormatTime(clock.offset_s),
                         clock.offset_s > 0 ? "behind" : "ahead of")});
  }
  if (searched.period_s > 0) {
    findings->push_back(
        {FindingKind::kPeriodicMotion, "", searched.period_s, "s",
         absl::StrFormat(
             "the motion repeats itself every %.2f s: clocks that are off by that, or a "
             "multiple of it, would fit as well, and the stamps alone say that they are "
             "not. Wave without a rhythm, through all of what the cameras see",
             searched.period_s)});
  }
}

absl::Status WithPeriod(const absl::Status& failed, double period_s) {
  return absl::FailedPreconditionError(absl::StrCat(
      std::string(failed.message()),
      absl::StrFormat(". The motion repeats itself every %.2f s, so the clocks may have been "
                      "matched a period off: wave without a rhythm, through all of what the "
                      "cameras see",
                      period_s)));
}

}  // namespace rigcal::server

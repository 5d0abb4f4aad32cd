// SPDX-License-Identifier: Apache-2.0
#include "server/associate/far_clocks.h"

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <set>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/strings/str_join.h"
#include "common/statistics/robust_statistics.h"

namespace rigcal::server {
namespace {

constexpr int64_t kFarNs = int64_t{86'400} * 1'000'000'000;
// Stamps of these years are times since 1970.
constexpr int64_t kYear2000Ns = int64_t{946'684'800} * 1'000'000'000;
constexpr int64_t kYear2100Ns = int64_t{4'102'444'800} * 1'000'000'000;

// The rows of a camera by one clock.
struct Recording {
  std::string camera;
  ClockKey clock;
  int64_t first_ns = 0, last_ns = 0;

  int64_t MiddleNs() const { return first_ns / 2 + last_ns / 2; }
};
using Group = std::vector<Recording>;

// Of one session; those within a day of each other are one group.
std::vector<Group> GroupsOf(std::vector<Recording> recordings) {
  std::ranges::sort(recordings, {}, &Recording::first_ns);
  std::vector<Group> groups;
  int64_t last_ns = 0;
  for (Recording& recording : recordings) {
    // Stamps may be anything: the difference may not fit.
    const bool is_far = !groups.empty() && recording.first_ns > last_ns &&
                        static_cast<uint64_t>(recording.first_ns) - static_cast<uint64_t>(last_ns) >
                            static_cast<uint64_t>(kFarNs);
    if (groups.empty() || is_far) groups.emplace_back();
    last_ns = groups.back().empty() ? recording.last_ns : std::max(last_ns, recording.last_ns);
    groups.back().push_back(std::move(recording));
  }
  return groups;
}

std::set<std::string> NamesOf(const Group& group) {
  std::set<std::string> names;
  for (const Recording& recording : group) names.insert(recording.camera);
  return names;
}

// Every camera counts from one beginning.
bool AreApart(const std::vector<Group>& groups) {
  std::set<std::string> seen;
  for (const Group& group : groups) {
    for (const std::string& camera : NamesOf(group)) {
      if (!seen.insert(camera).second) return false;
    }
  }
  return groups.size() > 1;
}

int64_t MiddleNs(const Group& group) {
  std::vector<int64_t> middles_ns;
  for (const Recording& recording : group) middles_ns.push_back(recording.MiddleNs());
  return LowerMedian(std::move(middles_ns));
}

bool CanBeSubtracted(int64_t time_ns) { return std::abs(static_cast<double>(time_ns)) < 4e18; }

}  // namespace

void BringFarClocksTogether(const std::vector<CleanTrack>& clean,
                            std::map<ClockKey, ClockOffset>* known,
                            std::vector<StampFault>* faults) {
  std::map<std::string, std::vector<Recording>> sessions;
  for (const CleanTrack& track : clean) {
    const ClockKey key = {track.session_id, track.camera.clock.clock_id, track.clock_epoch};
    if (!known->contains(key) || track.observations.size() == 0) continue;
    const Recording recording = {track.camera.camera, key, track.observations.time_ns(0),
                                 track.observations.time_ns(track.observations.size() - 1)};
    if (!CanBeSubtracted(recording.first_ns) || !CanBeSubtracted(recording.last_ns)) continue;
    sessions[track.session_id].push_back(recording);
  }
  for (auto& [session_id, recordings] : sessions) {
    const std::vector<Group> groups = GroupsOf(std::move(recordings));
    if (!AreApart(groups)) continue;
    const Group& most = *std::ranges::max_element(groups, {}, &Group::size);
    for (const Group& group : groups) {
      if (&group == &most) continue;
      const int64_t offset_ns = MiddleNs(most) - MiddleNs(group);
      for (const Recording& recording : group) (*known)[recording.clock].offset_ns += offset_ns;
      if (faults == nullptr) continue;
      for (const std::string& camera : NamesOf(group)) {
        faults->push_back(
            {StampFault::Kind::kFarClock, session_id, camera, 1e-6 * static_cast<double>(offset_ns),
             absl::StrFormat("its clock counts from another beginning than that of %s: %.0f s "
                             "apart. The two recordings were laid on each other, and the motion "
                             "that both saw says the rest",
                             absl::StrJoin(NamesOf(most), ", "),
                             1e-9 * std::abs(static_cast<double>(offset_ns)))});
      }
    }
  }
}

std::string DescribeFarClocks(const std::vector<CameraTrack>& tracks) {
  std::map<std::pair<std::string, std::string>, Recording> by_camera;  // session, camera
  for (const CameraTrack& track : tracks) {
    for (const Observation& row : track.observations) {
      const auto [at, is_new] =
          by_camera.try_emplace({track.session_id, track.camera.camera},
                                Recording{track.camera.camera, {}, row.time_ns, row.time_ns});
      at->second.first_ns = std::min(at->second.first_ns, row.time_ns);
      at->second.last_ns = std::max(at->second.last_ns, row.time_ns);
    }
  }
  std::map<std::string, std::vector<Recording>> sessions;
  for (auto& [key, recording] : by_camera) sessions[key.first].push_back(recording);
  for (auto& [session_id, recordings] : sessions) {
    const std::vector<Group> groups = GroupsOf(std::move(recordings));
    if (!AreApart(groups)) continue;
    std::vector<std::string> texts;
    for (const Group& group : groups) {
      const std::set<std::string> names = NamesOf(group);
      const int64_t first_ns = group.front().first_ns;
      const bool since_1970 = first_ns >= kYear2000Ns && first_ns < kYear2100Ns;
      texts.push_back(absl::StrFormat(
          "%s %s %s (first stamp %.0f s)", absl::StrJoin(names, ", "),
          names.size() == 1 ? "counts" : "count",
          since_1970 ? "since 1970" : "from another beginning, as since a PC was started",
          1e-9 * static_cast<double>(first_ns)));
    }
    return absl::StrCat("the clocks count from different beginnings: ", absl::StrJoin(texts, "; "),
                        ". Stamp all cameras by one clock, or wave where cameras of both see the "
                        "wand");
  }
  return "";
}

}  // namespace rigcal::server
